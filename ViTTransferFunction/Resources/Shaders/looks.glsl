// How a structure looks, and what belongs to none.

// 0: colour, and opacity. 1: opacity of the surface, rim, tone, density of the inside. 2: the ends of the window, opacity at its
// low end, edges. 3: how much the light matters inside. `appearance_rows` makes them.
vec4 vittf_row(int structure, int row)
{
  return vittf_structures[structure][row];
}

vec4 vittf_context_at(int level)
{
  return vittf_context[level / 4][level % 4];
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

// Colour and opacity of a structure's surface, or of the face where it is cut.
vec4 vittf_wall(vec3 place, int structure, bool cut)
{
  vec4 look = vittf_row(structure, 0), style = vittf_row(structure, 1), window = vittf_row(structure, 2);
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
  return vec4(vittf_lit(color, normal) * light, opacity);
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
  float position = clamp(intensity, 0.0, 1.0) * float(vittf_context_colors - 1);
  int low = min(int(position), vittf_context_colors - 2);
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

// As `vittf_inside`, of what belongs to no structure; `before` is the intensity at the last sample.
vec4 vittf_outside(vec4 voxel, float before, float change, out float share)
{
  vec4 look = vittf_context_between(before, voxel.b);
  share = min(change * 40.0, 1.0);
  // Around structures, voxels are half of them. Those of hidden ones are seen as they are.
  return vec4(look.rgb, look.a * (voxel.a < 0.5 ? 1.0 - smoothstep(0.05, 0.45, voxel.a) : 1.0));
}
