// Cameras of one lens, their rays, and what the rays through the centres of their pixels met. The pixels
// of all are counted on, camera after camera.

struct Aim {
  forward: vec4f,  // the camera's axes in the world
  right: vec4f,
  up: vec4f,
  origin: vec4f,
  forward_rest: vec4f,  // what single precision leaves of them
  right_rest: vec4f,
  up_rest: vec4f,
  skip: i32,       // row of the instance that its rays pass through
  unused_a: i32,
  unused_b: i32,
  unused_c: i32,
}

struct Shot {
  width: u32,
  height: u32,
  samples: u32,    // extra rays of an edge pixel
  cameras: u32,
  low: f32,
  high: f32,
  angle: f32,      // of a pixel
  half_width: f32, // slopes of the picture's sides
  strong: i32,     // see carstage_sim.render.quality.Sampling
  weak: i32,
  zero: u32,       // always 0, which no compiler knows
  wanted: u32,     // bits of the products, as carstage_sim.render.gpu.passes.Product counts them
  words: u32,      // of a camera's pictures but the colours
  lamps_on: u32,   // whether any lamp shines
  unused_a: u32,
  unused_b: u32,
  offsets: array<vec4f, 8>,
  aims: array<Aim, 8>,
}

@group(1) @binding(0) var<uniform> shot: Shot;
@group(1) @binding(1) var<storage, read> slopes: array<vec4f>;  // right, its rest, up, its rest
@group(1) @binding(2) var<storage, HITS> hits: array<u32>;      // t, row, triangle, u, v

var<private> the_camera: u32;

// Of one camera.
fn pixel_count() -> u32 { return shot.width * shot.height; }

fn pixels_of_all() -> u32 { return pixel_count() * shot.cameras; }

fn linear_index(id: vec3u, groups: vec3u) -> u32 {
  return id.x + id.y * groups.x * 64u;
}

// Of one camera.
fn tile_count() -> u32 {
  return ((shot.width + 7u) / 8u) * ((shot.height + 7u) / 8u);
}

// Pixels go in tiles of eight by eight, whose rays stay together. Beyond the picture: none, which is
// as many as `pixels_of_all()` or more.
fn pixel_in_tiles(i: u32) -> u32 {
  let tiles = (shot.width + 7u) / 8u;
  let camera = i / 64u / tile_count();
  let tile = i / 64u - camera * tile_count();
  let x = (tile % tiles) * 8u + i % 8u;
  let y = (tile / tiles) * 8u + (i % 64u) / 8u;
  let pixel = camera * pixel_count() + y * shot.width + x;
  return select(0xffffffffu, pixel, x < shot.width && y < shot.height);
}
