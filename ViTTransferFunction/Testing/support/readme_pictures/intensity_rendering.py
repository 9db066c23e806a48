"""What a plain 1D transfer function shows of a volume: colour and opacity by intensity alone, as Slicer's presets have them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  (importing it gives VTK its OpenGL classes)
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import vtkCamera, vtkColorTransferFunction, vtkRenderer, vtkVolume, vtkVolumeProperty
from vtkmodules.vtkRenderingVolume import vtkGPUVolumeRayCastMapper

from ViTTransferFunction.CommandLine.offscreen_window import OffscreenWindow
from ViTTransferFunction.CommandLine.rendering_picture import add_lights
from ViTTransferFunction.Logic.core.classes.colors import Color
from ViTTransferFunction.Logic.core.volumes.camera import Size
from ViTTransferFunction.Logic.core.volumes.volume import Volume

STEP_VOXELS = 0.5
"""Length of a ray's steps, in voxels of the finest spacing."""


@dataclass(frozen=True)
class IntensityStop:
    """A point of a 1D transfer function; between two of them it is linear.

    Attributes:
        intensity: where.
        opacity: of a millimetre, 0 to 1.
        color: there.
    """

    intensity: float
    opacity: float
    color: Color


def intensity_picture(volume: Volume, stops: Sequence[IntensityStop], camera: vtkCamera, size: Size) -> np.ndarray:
    """A volume through a 1D transfer function, (H, W, 3) uint8."""
    renderer = vtkRenderer()
    renderer.AddVolume(_prop(volume, stops))
    add_lights(renderer)
    with OffscreenWindow(renderer) as window:
        return window.picture(camera, size)


def _prop(volume: Volume, stops: Sequence[IntensityStop]) -> vtkVolume:
    spacing_mm = volume.geometry.spacing_mm
    image = vtkImageData()
    image.SetDimensions(*volume.shape[::-1])
    image.SetSpacing(*spacing_mm)
    image.GetPointData().SetScalars(numpy_to_vtk(np.nan_to_num(volume.array).astype(np.float32).ravel(), deep=True))
    mapper = vtkGPUVolumeRayCastMapper()
    mapper.SetInputData(image)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetSampleDistance(STEP_VOXELS * float(spacing_mm.min()))
    mapper.UseJitteringOn()
    # The image has the spacing.
    matrix = vtkMatrix4x4()
    matrix.DeepCopy((volume.geometry.ijk_to_ras @ np.diag([*(1.0 / spacing_mm), 1.0])).ravel().tolist())
    prop = vtkVolume()
    prop.SetMapper(mapper)
    prop.SetUserMatrix(matrix)
    prop.SetProperty(_material(stops))
    return prop


def _material(stops: Sequence[IntensityStop]) -> vtkVolumeProperty:
    colors, opacities = vtkColorTransferFunction(), vtkPiecewiseFunction()
    for stop in stops:
        colors.AddRGBPoint(stop.intensity, *stop.color)
        opacities.AddPoint(stop.intensity, stop.opacity)
    material = vtkVolumeProperty()
    material.SetInterpolationTypeToLinear()
    material.SetColor(colors)
    material.SetScalarOpacity(opacities)
    material.SetScalarOpacityUnitDistance(1.0)
    material.ShadeOn()
    # As Slicer's presets have it.
    material.SetAmbient(0.2)
    material.SetDiffuse(1.0)
    material.SetSpecular(0.0)
    return material
