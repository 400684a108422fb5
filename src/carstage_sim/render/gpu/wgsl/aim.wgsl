// The rays of a batch, one after the other: a lane takes several, as its stack is cleared but once.

var<private> the_pixel: u32;  // it goes through
var<private> the_place: u32;  // of what is known of it
var<private> the_ray: vec3f;

// How many there are; the card alone knows how many a list has.
fn ray_count() -> u32 {
  return select(shot.cameras * tile_count() * 64u, list[2u * batch.band + 1u], batch.listed != 0u);
}

// Find a ray; false where a tile reaches beyond the picture.
fn takes_ray(k: u32) -> bool {
  if (batch.listed == 0u) {
    the_pixel = pixel_in_tiles(k);
    the_place = the_pixel;
    if (the_pixel >= pixels_of_all()) {
      return false;
    }
    the_camera = the_pixel / pixel_count();
    the_ray = centre_direction(the_pixel);
    return true;
  }
  the_place = k;
  let entry = list[HEAD + k];
  the_pixel = entry >> 3u;
  the_camera = the_pixel / pixel_count();
  let aim = shot.aims[the_camera];
  let moved = shot.offsets[entry & 7u].xy * shot.angle;
  let away = moved.x * aim.right.xyz - moved.y * aim.up.xyz;
  the_ray = centre_direction(the_pixel) + away;
  return true;
}
