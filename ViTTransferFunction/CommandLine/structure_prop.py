"""A volume of structures as VTK renders it in a picture: as Slicer's 3D views show it."""

from __future__ import annotations

from collections.abc import Sequence

import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkVolume
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

from ViTTransferFunction.Logic.rendering.appearance import Appearance
from ViTTransferFunction.Logic.rendering.structure_volume import StructureVolume
from ViTTransferFunction.Logic.rendering.surroundings import Surroundings
from ViTTransferFunction.Logic.scene.views.structure_material import set_material, set_shader, set_uniforms

STEP_VOXELS = 0.7
"""Length of a ray's steps."""


def structure_prop(
    structures: StructureVolume, looks: Sequence[Appearance], surroundings: Surroundings | None = None
) -> vtkVolume:
    """Structures, to be added to a renderer.

    Args:
        structures: what to show.
        looks: how each of them looks, in the order of their numbers.
        surroundings: how what belongs to none looks; None: it is not shown.
    """
    image = vtkImageData()
    image.SetDimensions(*structures.voxels.shape[2::-1])
    image.GetPointData().SetScalars(numpy_to_vtk(structures.voxels.reshape(-1, 4), deep=True))
    mapper = vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(STEP_VOXELS)
    # Rays that start at random depths turn the rings that steps leave on what is translucent into faint grain.
    mapper.UseJitteringOn()
    matrix = vtkMatrix4x4()
    matrix.DeepCopy(structures.geometry.ijk_to_ras.ravel().tolist())
    volume = vtkVolume()
    volume.SetMapper(mapper)
    # Voxels are 1 apart, and only this places them: VTK measures steps and lengths before.
    volume.SetUserMatrix(matrix)
    set_material(volume.GetProperty())
    set_shader(volume.GetShaderProperty(), len(looks))
    set_uniforms(volume.GetShaderProperty(), structures.uniforms(looks, surroundings or Surroundings()))
    return volume
