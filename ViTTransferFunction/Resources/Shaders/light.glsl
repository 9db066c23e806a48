// How surfaces answer light.

mat3 vittf_eye = mat3(0.0);        // From voxels to the viewer's frame, of the world's units.
vec3 vittf_along = vec3(0.0);      // Of the ray, in that frame.

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
