// The way of a ray through the volume, and what it meets. Of `vittf_scene`, x says whether anything is seen of what belongs to no
// structure, y how much of that gives way to structures, and z and w between which intensities it is seen (`scene_vector`).

int vittf_before = -1;             // The structure at the last sample, 0: none, -1: there is no last sample.
float vittf_number = -1.0;         // What its voxels have as number, visible or not.
float vittf_last = -1.0;           // The intensity at the last sample, and at this one.
float vittf_now = -1.0;
bool vittf_hit = false;            // Whether the ray has met a structure.
vec4 vittf_veil = vec4(0.0);       // What it passed before, of what belongs to none.
float vittf_length = 0.0;          // Of a step, in edges of cubes as large as a voxel.
float vittf_steps = 0.0;           // After which the ray has left the volume, or what is to be shown of it.

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
    look = vittf_outside(voxel, vittf_last, change, share);
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
    if (wall > 0 && vittf_row(wall, 1).x > 0.0)
    {
      bool cut = vittf_before < 0;
      vec4 seen = vittf_wall(cut ? g_dataPos : vittf_crossing(wall, entering), wall, cut);
      vittf_compose(seen.rgb, seen.a);
    }
    vittf_before = structure;
  }
}
