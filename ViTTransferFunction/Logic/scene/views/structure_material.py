"""The light and the shader that structures are rendered with, as VTK has them: for Slicer's views and for pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from vtkmodules.vtkCommonCore import reference
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkVolumeProperty

from ...rendering.composition import SURFACE
from ...rendering.shader import shader_pieces

AMBIENT, DIFFUSE, SPECULAR, SPECULAR_POWER = 0.35, 0.65, 0.12, 20.0
"""How surfaces answer light."""


def set_material(material: vtkVolumeProperty) -> None:
    """Let a volume's four numbers be what its shader takes them for, and its surfaces shine a little."""
    material.IndependentComponentsOff()
    material.SetInterpolationTypeToLinear()
    # The shader decides what is seen. By this, VTK finds the surface that a click in a 3D view meets.
    opacity = vtkPiecewiseFunction()
    opacity.AddPoint(SURFACE, 0.0)
    opacity.AddPoint(SURFACE + 1.0, 1.0)
    material.SetScalarOpacity(opacity)
    material.ShadeOn()
    material.SetAmbient(AMBIENT)
    material.SetDiffuse(DIFFUSE)
    material.SetSpecular(SPECULAR)
    material.SetSpecularPower(SPECULAR_POWER)


def set_shader(shader: Any, structures: int) -> None:
    """Let a vtkShaderProperty show volumes of so many structures; where it does already, it is not touched."""
    pieces = shader_pieces(structures)
    # What is set anew makes the renderer compile.
    if _replacements(shader) != pieces:
        shader.ClearAllFragmentShaderReplacements()
        for mark, piece in pieces.items():
            shader.AddFragmentShaderReplacement(mark, True, piece, False)


def set_uniforms(shader: Any, uniforms: Mapping[str, np.ndarray]) -> None:
    """Give a vtkShaderProperty's variables the values of `StructureVolume.uniforms`."""
    variables = shader.GetFragmentCustomUniforms()
    for name, value in uniforms.items():
        numbers = value.ravel().tolist()
        if len(numbers) == 4:
            variables.SetUniform4f(name, numbers)
        else:
            variables.SetUniformMatrix4x4v(name, len(numbers) // 16, numbers)


def _replacements(shader: Any) -> dict[str, str]:
    """The pieces that a vtkShaderProperty has, by the marks that they stand for."""
    found = {}
    for index in range(shader.GetNumberOfShaderReplacements()):
        mark, first, piece, everywhere = reference(""), reference(False), reference(""), reference(False)
        shader.GetNthShaderReplacement(index, mark, first, piece, everywhere)
        found[str(mark)] = str(piece)
    return found
