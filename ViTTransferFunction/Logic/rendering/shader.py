"""How a renderer shows a volume of structures (`structure_volume`), in OpenGL's shading language.

It is the one definition for Slicer's views, for pictures, and for scenes that are opened where this extension is not.

VTK's volume renderer takes pieces of its shader from outside. These pieces march along a ray and, where it passes from one
structure into another or out of all of them, find the place between the samples and shade it: surfaces are smooth whatever the
length of the steps. How each structure looks is read from uniform variables (`appearance`, `surroundings`), so that a change
costs no more than a picture.

A voxel between two structures lies outside each by as much as it lies inside the other. So a structure's surface is smooth
also where another one touches it that is hidden.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

from .composition import BLOCK_VOXELS, MOST_STRUCTURES

ROWS = 4
"""Vectors of four numbers that say how a structure looks."""

CONTEXT_COLORS = 64
"""Colours, and integrals of the density, from the lowest intensity to the highest, of what belongs to no structure."""

STEP = 16
"""The number of structures that a shader has room for is a multiple of this, so that few of them need another shader."""

STRUCTURES, CONTEXT, SCENE = "vittf_structures", "vittf_context", "vittf_scene"
"""Names of the uniform variables; `structure_volume.StructureVolume.uniforms` has their values."""

_FILES = ("structures", "light", "looks", "ray")
"""The functions, in `Resources/Shaders`; each file uses what those before it define."""

_SAMPLE = """
    if (g_skip)
    {
      vittf_before = -1;
      vittf_now = -1.0;
    }
    else
    {
      if (vittf_length <= 0.0)
      {
        vittf_begin();
      }
      vittf_march();
    }
"""

_FINISH = """
  if (!vittf_hit)
  {
    g_fragColor = vittf_veil;
  }
"""
"""In place of what VTK has here for views that project maxima or minima: it would draw those of numbers that are none."""


def capacity(structures: int) -> int:
    """How many structures a shader for so many has room for, with none, number 0."""
    return -(-(structures + 1) // STEP) * STEP


def shader_pieces(structures: int) -> dict[str, str]:
    """What stands in the shader instead of each of VTK's marks.

    Args:
        structures: how many of them there is to be room for.
    """
    uniforms = f"""
uniform mat4 {STRUCTURES}[{capacity(structures)}];
uniform mat4 {CONTEXT}[{CONTEXT_COLORS // 4}];
uniform vec4 {SCENE};
const int vittf_context_colors = {CONTEXT_COLORS};
const float vittf_block = {float(BLOCK_VOXELS)};
const float vittf_most_structures = {float(MOST_STRUCTURES)};
"""
    return {
        "//VTK::CustomUniforms::Dec": uniforms,
        # The last of VTK's functions: all others can be called.
        "//VTK::ComputeRayDirection::Dec": "//VTK::ComputeRayDirection::Dec\n" + _functions(),
        "//VTK::Shading::Impl": _SAMPLE,
        "//VTK::Shading::Exit": _FINISH,
    }


@cache
def _functions() -> str:
    folder = Path(__file__).parents[2] / "Resources" / "Shaders"
    return "\n".join((folder / f"{name}.glsl").read_text(encoding="utf-8") for name in _FILES)
