// What the volume of structures (`composition`) says of a place, in [0, 1] along each axis.

vec3 vittf_size = vec3(1.0);       // Of the volume, in voxels.
ivec3 vittf_end = ivec3(0);        // Its last voxel.

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
