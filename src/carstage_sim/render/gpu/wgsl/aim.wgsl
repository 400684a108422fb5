// The ray of an invocation.

var<private> the_pixel: u32;  // it goes through
var<private> the_place: u32;  // of what is known of it
var<private> the_ray: vec3f;

// Find the ray of this invocation; false where there is none: the card alone knows how many a list has.
fn takes_ray(id: vec3u, groups: vec3u) -> bool {
  if (batch.listed == 0u) {
    the_pixel = pixel_of_invocation(id, groups);
    the_place = the_pixel;
    if (the_pixel >= pixel_count()) {
      return false;
    }
    the_ray = centre_direction(the_pixel);
    return true;
  }
  the_place = linear_index(id, groups);
  if (the_place >= list[2u * batch.band + 1u]) {
    return false;
  }
  let entry = list[HEAD + the_place];
  the_pixel = entry >> 3u;
  let moved = shot.offsets[entry & 7u].xy * shot.angle;
  let away = moved.x * shot.right.xyz - moved.y * shot.up.xyz;
  the_ray = centre_direction(the_pixel) + away;
  return true;
}
