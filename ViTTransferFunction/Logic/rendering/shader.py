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

from .composition import BLOCK_VOXELS, MOST_STRUCTURES

ROWS = 4
"""Vectors of four numbers that say how a structure looks."""

CONTEXT_COLORS = 64
"""Colours, and integrals of the density, from the lowest intensity to the highest, of what belongs to no structure."""

STEP = 16
"""The number of structures that a shader has room for is a multiple of this, so that few of them need another shader."""

STRUCTURES, CONTEXT, SCENE = "vittf_structures", "vittf_context", "vittf_scene"
"""Names of the uniform variables; `structure_volume.StructureVolume.uniforms` has their values."""

_FUNCTIONS = """
int vittf_before = -1;             // The structure at the last sample, 0: none, -1: there is no last sample.
float vittf_number = -1.0;         // What its voxels have as number, visible or not.
float vittf_last = -1.0;           // The intensity at the last sample, and at this one.
float vittf_now = -1.0;
bool vittf_hit = false;            // Whether the ray has met a structure.
vec4 vittf_veil = vec4(0.0);       // What it passed before, of what belongs to none.
mat3 vittf_eye = mat3(0.0);        // From voxels to the viewer's frame, of the world's units.
vec3 vittf_along = vec3(0.0);      // Of the ray, in that frame.
float vittf_length = 0.0;          // Of a step, in edges of cubes as large as a voxel.
vec3 vittf_size = vec3(1.0);       // Of the volume, in voxels.
ivec3 vittf_end = ivec3(0);        // Its last voxel.
float vittf_steps = 0.0;           // After which the ray has left the volume, or what is to be shown of it.

vec4 vittf_row(int structure, int row)
{
  return vittf_structures[structure][row];
}

vec4 vittf_context_at(int level)
{
  return vittf_context[level / 4][level % 4];
}

ivec3 vittf_nearest(vec3 place)
{
  return clamp(ivec3(place * vittf_size), ivec3(0), vittf_end);
}

// Number and depth of one of the eight voxels around a place, and its weight in the interpolation.
vec3 vittf_corner(ivec3 base, vec3 share, int n)
{
  ivec3 corner = ivec3(n & 1, (n >> 1) & 1, n >> 2);
  vec3 weights = mix(1.0 - share, share, vec3(corner));
  vec2 voxel = texelFetch(in_volume[0], clamp(base + corner, ivec3(0), vittf_end), 0).ra;
  return vec3(voxel.r * 255.0, voxel.g, weights.x * weights.y * weights.z);
}

// How deep a place lies in a structure: 0.5 on its surface, more inside.
float vittf_depth(vec3 place, int structure)
{
  vec3 at = place * vittf_size - 0.5;
  vec3 base = floor(at);
  float depth = 0.0;
  for (int n = 0; n < 8; ++n)
  {
    vec3 corner = vittf_corner(ivec3(base), at - base, n);
    bool other = abs(corner.x - float(structure)) > 0.5 && corner.y > 0.5;
    depth += corner.z * (other ? 1.0 - corner.y : corner.y);
  }
  return depth;
}

// The structure that a place lies in, visible or not; 0: none.
int vittf_structure(vec3 place)
{
  float depth = texture3D(in_volume[0], place).a;
  if (depth < 0.5)
  {
    return 0;
  }
  int structure = int(texelFetch(in_volume[0], vittf_nearest(place), 0).r * 255.0 + 0.5);
  if (depth < 0.995 && vittf_depth(place, structure) < 0.5)
  {
    vec3 at = place * vittf_size - 0.5;
    vec3 base = floor(at);
    float most = 0.0;
    int other = 0;
    for (int n = 0; n < 8; ++n)
    {
      vec3 corner = vittf_corner(ivec3(base), at - base, n);
      if (abs(corner.x - float(structure)) > 0.5 && corner.y > 0.5 && corner.z > most)
      {
        most = corner.z;
        other = int(corner.x + 0.5);
      }
    }
    structure = other != 0 && vittf_depth(place, other) >= 0.5 ? other : 0;
  }
  return structure;
}

// Towards the inside of a structure, per voxel: from the corners of a tetrahedron, four samples instead of six.
vec3 vittf_depth_gradient(vec3 place, int structure)
{
  vec3 sum = vec3(0.0);
  for (int n = 0; n < 4; ++n)
  {
    vec3 towards = vec3(n == 0 || n == 3 ? 1.0 : -1.0, n >= 2 ? 1.0 : -1.0, n == 1 || n == 3 ? 1.0 : -1.0);
    sum += towards * vittf_depth(place + 0.75 * towards / vittf_size, structure);
  }
  return sum;
}

// Towards higher intensities, per voxel.
vec3 vittf_intensity_gradient(vec3 place)
{
  vec3 cell = 1.0 / vittf_size;
  vec3 x = vec3(cell.x, 0.0, 0.0), y = vec3(0.0, cell.y, 0.0), z = vec3(0.0, 0.0, cell.z);
  return 0.5 * vec3(texture3D(in_volume[0], place + x).b - texture3D(in_volume[0], place - x).b,
                    texture3D(in_volume[0], place + y).b - texture3D(in_volume[0], place - y).b,
                    texture3D(in_volume[0], place + z).b - texture3D(in_volume[0], place - z).b);
}

// What is the same for all of a ray.
void vittf_begin()
{
  ivec3 size = textureSize(in_volume[0], 0);
  vittf_size = vec3(size);
  vittf_end = size - 1;
  mat3 to_eye = mat3(in_modelViewMatrix * in_volumeMatrix[0]);
  vittf_eye = mat3(to_eye[0] * in_cellSpacing[0].x, to_eye[1] * in_cellSpacing[0].y, to_eye[2] * in_cellSpacing[0].z);
  vec3 step_eye = vittf_eye * (g_dirStep * vittf_size);
  vittf_along = normalize(step_eye);
  vittf_length = length(step_eye) / pow(max(abs(determinant(vittf_eye)), 1e-30), 1.0 / 3.0);
}

// Of the surface that a gradient per voxel is at a right angle to, towards the viewer, in the viewer's frame.
vec3 vittf_normal(vec3 gradient)
{
  vec3 normal = gradient.x * cross(vittf_eye[1], vittf_eye[2]) + gradient.y * cross(vittf_eye[2], vittf_eye[0])
    + gradient.z * cross(vittf_eye[0], vittf_eye[1]);
  float size = length(normal);
  return size > 0.0 ? faceforward(normal / size, vittf_along, normal) : -vittf_along;
}

// How much of a colour's light leaves a surface. VTK's own function takes normals for right only where all edges of the volume
// are as long, and parallel to those of the world.
vec3 vittf_lit(vec3 color, vec3 normal)
{
  vec3 diffuse = vec3(0.0), specular = vec3(0.0), ambient = vec3(0.0);
#ifdef TOTAL_NUMBER_LIGHTS
  for (int n = 0; n < TOTAL_NUMBER_LIGHTS; ++n)
  {
    vec3 direction = in_lightDirection[n], bright = in_lightDiffuseColor[n], shine = in_lightSpecularColor[n];
    ambient += in_lightAmbientColor[n];
#else
  // A headlight, or none: then VTK declares no colours of lights.
  {
    vec3 direction = vittf_along, bright = vec3(1.0), shine = vec3(1.0);
    ambient = color;
#endif
    float light = max(-dot(normal, direction), 0.0);
    float mirrored = max(-dot(reflect(direction, normal), vittf_along), 0.0);
    diffuse += light * bright;
    specular += light > 0.0 ? pow(mirrored, in_shininess[0]) * shine : vec3(0.0);
  }
  return in_ambient[0] * ambient + in_diffuse[0] * diffuse * color + in_specular[0] * specular;
}

void vittf_compose(vec3 color, float opacity)
{
  if (!vittf_hit)
  {
    // What hides structures gives way, as far as wanted.
    g_fragColor = vittf_veil * (1.0 - vittf_scene.y);
    vittf_hit = true;
  }
  g_fragColor += (1.0 - g_fragColor.a) * vec4(color * opacity, opacity);
}

// Where an intensity lies in a structure's window.
float vittf_in_window(float intensity, vec4 window)
{
  return clamp((intensity - window.x) / max(window.y - window.x, 0.001), 0.0, 1.0);
}

vec3 vittf_toned(vec3 color, float tone, float level)
{
  return color * (1.0 - tone * (1.0 - level));
}

void vittf_wall(vec3 place, int structure, bool cut)
{
  vec4 look = vittf_row(structure, 0), style = vittf_row(structure, 1), window = vittf_row(structure, 2);
  if (style.x <= 0.0)
  {
    return;
  }
  vec3 inward = cut ? vec3(0.0) : vittf_depth_gradient(place, structure);
  vec3 normal = vittf_normal(inward);
  // A little below the surface: on it, voxels are half of something else.
  vec3 below = place + 1.5 * inward / max(length(inward), 1e-6) / vittf_size;
  vec4 voxel = texture3D(in_volume[0], below);
  float level = vittf_in_window(voxel.b, window);
  float facing = min(abs(dot(normal, vittf_along)), 1.0);
  float opacity = style.x * look.a * mix(window.z, 1.0, level);
  // As of a wall of some thickness; of glass, what faces the viewer is clear.
  opacity = 1.0 - pow(max(1.0 - opacity, 0.0), 1.0 / max(facing, 0.25));
  opacity *= mix(1.0, cut ? 1.0 : 0.12 + 0.88 * pow(1.0 - facing, 1.5), style.y);
  // What is cut away no longer takes light from the face of the cut.
  float light = cut ? 1.0 : texture3D(in_volume[0], place).g;
  vec3 color = vittf_toned(look.rgb, cut ? max(style.z, 0.6) : style.z, level);
  vittf_compose(vittf_lit(color, normal) * light, opacity);
}

// Colour and density of the inside of a structure, before its light, of which it needs a share.
vec4 vittf_inside(vec4 voxel, int structure, float change, out float share)
{
  vec4 look = vittf_row(structure, 0), style = vittf_row(structure, 1), window = vittf_row(structure, 2);
  float level = vittf_in_window(voxel.b, window);
  // The map has a say: less where it is in doubt.
  float density = style.w * look.a * mix(window.z, 1.0, level) * smoothstep(0.5, 0.8, voxel.a);
  float edge = min(change * 8.0 / max(window.y - window.x, 0.05), 1.0);
  share = edge * vittf_row(structure, 3).x;
  return vec4(vittf_toned(look.rgb, style.z, level), density * mix(1.0, edge, window.w));
}

vec4 vittf_context_of(float intensity)
{
  float position = clamp(intensity, 0.0, 1.0) * 63.0;
  int low = int(min(position, 62.0));
  return mix(vittf_context_at(low), vittf_context_at(low + 1), position - float(low));
}

// Colour and mean density of the intensities from one sample to the next: what is thinner than a step is not missed. The table
// has the integral of the density.
vec4 vittf_context_between(float from, float to)
{
  float middle = 0.5 * (from + to);
  float half_width = max(0.5 * abs(to - from), 0.008);
  float mean = (vittf_context_of(middle + half_width).a - vittf_context_of(middle - half_width).a)
    / (min(middle + half_width, 1.0) - max(middle - half_width, 0.0));
  return vec4(vittf_context_of(middle).rgb, mean);
}

// The same of what belongs to no structure.
vec4 vittf_outside(vec4 voxel, float change, out float share)
{
  vec4 look = vittf_context_between(vittf_last, vittf_now);
  share = min(change * 40.0, 1.0);
  // Around structures, voxels are half of them. Those of hidden ones are seen as they are.
  return vec4(look.rgb, look.a * (voxel.a < 0.5 ? 1.0 - smoothstep(0.05, 0.45, voxel.a) : 1.0));
}

// What a step adds. Many renderers compute both sides of each branch: what both need comes before or after.
void vittf_emit(vec4 voxel)
{
  vec3 gradient = vittf_intensity_gradient(g_dataPos);
  float change = length(gradient), share = 0.0;
  vec4 look = vec4(0.0);
  if (vittf_before > 0)
  {
    look = vittf_inside(voxel, vittf_before, change, share);
  }
  else
  {
    look = vittf_outside(voxel, change, share);
  }
  // What is even has no side that faces the light.
  vec3 color = share > 0.0 ? mix(look.rgb, vittf_lit(look.rgb, vittf_normal(gradient)), share) : look.rgb;
  float opacity = 1.0 - exp(-look.a * vittf_length);
  if (vittf_before > 0)
  {
    vittf_compose(color, opacity);
  }
  else if (vittf_hit)
  {
    g_fragColor += (1.0 - g_fragColor.a) * vec4(color * opacity, opacity);
  }
  else
  {
    vittf_veil += (1.0 - vittf_veil.a) * vec4(color * opacity, opacity);
  }
}

// Whether the ray has left the volume, or there is nothing more to be seen.
bool vittf_over()
{
  // Structures make their way through what is before them, if that gives way at all.
  bool veiled = !vittf_hit && vittf_veil.a > 0.99 && vittf_scene.y <= 0.0;
  return veiled || g_fragColor.a > 0.99 || g_currentT >= vittf_steps;
}

// Whether it is clear without a closer look that a sample is where the last one was.
bool vittf_settled(vec4 voxel)
{
  return voxel.a < 0.5 ? vittf_before == 0 : abs(voxel.r * 255.0 - vittf_number) < 0.01;
}

bool vittf_emits()
{
  return vittf_before > 0
    ? vittf_row(vittf_before, 1).w > 0.0
    : vittf_scene.x > 0.0 && max(vittf_last, vittf_now) >= vittf_scene.z && min(vittf_last, vittf_now) <= vittf_scene.w;
}

vec4 vittf_taken()
{
  vec4 voxel = texture3D(in_volume[0], g_dataPos);
  vittf_last = vittf_now < 0.0 ? voxel.b : vittf_now;
  vittf_now = voxel.b;
  return voxel;
}

void vittf_advance(float steps)
{
  g_dataPos += steps * g_dirStep;
  g_currentT += steps;
}

vec4 vittf_advanced()
{
  vittf_advance(1.0);
  return vittf_taken();
}

// How many steps a ray takes along each axis to cover a distance of one.
vec3 vittf_steps_for(vec3 stride)
{
  return 1.0 / max(abs(stride), vec3(1e-9));
}

float vittf_least(vec3 numbers)
{
  return min(min(numbers.x, numbers.y), numbers.z);
}

// Finds out where the ray ends.
void vittf_look_ahead()
{
  vec3 side = mix(in_texMin[0], in_texMax[0], vec3(greaterThan(g_dirStep, vec3(0.0))));
  vec3 way = (side - g_dataPos) * sign(g_dirStep);
  vec3 leaving = mix(way * vittf_steps_for(g_dirStep), vec3(1e9), vec3(equal(g_dirStep, vec3(0.0))));
  vittf_steps = min(g_currentT + vittf_least(leaving), g_terminatePointMax);
}

// Goes on to the next sample, or beyond what is known to be empty: for where nothing but structures is to be seen.
vec4 vittf_leapt()
{
  vec3 voxels = g_dataPos * vittf_size, stride = g_dirStep * vittf_size;
  vec3 forward = vec3(greaterThan(stride, vec3(0.0))), steps_for = vittf_block * vittf_steps_for(stride);
  float farthest = vittf_steps - g_currentT, done = 0.0, more = 1.0;
  while (more > 0.0)
  {
    done += more;
    vec3 at = (voxels + done * stride) / vittf_block, block = floor(at), share = at - block;
    // All voxels of a block say the same; always to ask the first needs a sixteenth of the volume's memory.
    float number = texelFetch(in_volume[0], clamp(ivec3(vittf_block * block), ivec3(0), vittf_end), 0).r * 255.0;
    // So many blocks away are all surfaces, along each axis: the ray goes on to the side of the cube of blocks that are empty.
    float away = number - vittf_most_structures;
    float leaving = vittf_least((away + mix(share - 1.0, -share, forward)) * steps_for);
    // The last sample in it, and one more.
    more = away > 0.5 && done < farthest ? floor(leaving) + 1.0 : 0.0;
  }
  vittf_advance(done);
  return vittf_taken();
}

// Where, between the last sample and this one, the ray passes the surface of a structure.
vec3 vittf_crossing(int structure, bool entering)
{
  // Shares of the step, and how deep the ray is there; halved, then between the last two as if depths were even.
  vec2 outer = vec2(0.0, -1.0), inner = vec2(1.0, -1.0);
  for (int n = 0; n < 3; ++n)
  {
    float middle = 0.5 * (outer.x + inner.x);
    float depth = vittf_depth(g_dataPos - (1.0 - middle) * g_dirStep, structure);
    if ((depth >= 0.5) == entering)
    {
      inner = vec2(middle, depth);
    }
    else
    {
      outer = vec2(middle, depth);
    }
  }
  bool known = outer.y >= 0.0 && inner.y >= 0.0 && inner.y != outer.y;
  float share = known ? (0.5 - outer.y) / (inner.y - outer.y) : 0.5;
  return g_dataPos - (1.0 - mix(outer.x, inner.x, share)) * g_dirStep;
}

// Goes on to where the ray passes a surface. With loops of their own for what comes before, and called as rarely as can be:
// many renderers do for all rays of a group what one of them needs.
void vittf_march()
{
  vittf_look_ahead();
  vec4 voxel = vittf_taken();
  if (vittf_before < 0 && voxel.a < 0.5)
  {
    vittf_before = 0;
  }
  bool over = vittf_over();
  while (!over && vittf_scene.x <= 0.0 && vittf_settled(voxel) && !vittf_emits())
  {
    voxel = vittf_leapt();
    over = vittf_over();
  }
  while (!over && vittf_settled(voxel) && !vittf_emits())
  {
    voxel = vittf_advanced();
    over = vittf_over();
  }
  while (!over && vittf_settled(voxel) && vittf_emits())
  {
    vittf_emit(voxel);
    voxel = vittf_advanced();
    over = vittf_over();
  }
  if (over)
  {
    g_exit = true;
    return;
  }
  if (vittf_settled(voxel))
  {
    // Where it has just stopped to emit: the next call goes on here.
    vittf_advance(-1.0);
    vittf_now = vittf_last;
    return;
  }
  int structure = vittf_structure(g_dataPos);
  vittf_number = structure > 0 ? float(structure) : -1.0;
  structure = vittf_row(structure, 0).a > 0.0 ? structure : 0;
  if (structure != vittf_before)
  {
    // Of two that touch, the more opaque one has the surface.
    bool entering = structure > 0
      && (vittf_before <= 0 || vittf_row(structure, 0).a >= vittf_row(vittf_before, 0).a);
    int wall = entering ? structure : vittf_before;
    if (wall > 0)
    {
      bool cut = vittf_before < 0;
      vittf_wall(cut ? g_dataPos : vittf_crossing(wall, entering), wall, cut);
    }
    vittf_before = structure;
  }
}
"""

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
const float vittf_block = {float(BLOCK_VOXELS)};
const float vittf_most_structures = {float(MOST_STRUCTURES)};
"""
    return {
        "//VTK::CustomUniforms::Dec": uniforms,
        # The last of VTK's functions: all others can be called.
        "//VTK::ComputeRayDirection::Dec": "//VTK::ComputeRayDirection::Dec\n" + _FUNCTIONS,
        "//VTK::Shading::Impl": _SAMPLE,
        "//VTK::Shading::Exit": _FINISH,
    }
