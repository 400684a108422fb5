// A camera: its rays, the hits of its pixels, and those of the extra rays through its edges.

struct Shot {
  forward: vec4f,  // the camera's axes in the world
  right: vec4f,
  up: vec4f,
  origin: vec4f,
  forward_rest: vec4f,  // what single precision leaves of them
  right_rest: vec4f,
  up_rest: vec4f,
  width: u32,
  height: u32,
  skip: i32,
  samples: u32,    // extra rays of an edge pixel
  low: f32,
  high: f32,
  angle: f32,      // of a pixel
  strong: i32,     // see carstage_sim.render.quality.Sampling
  weak: i32,
  zero: u32,       // always 0, which no compiler knows
  wanted: u32,     // bits of the products, as carstage_sim.render.gpu.camera.Product counts them
  half_width: f32, // slopes of the picture's sides
  offsets: array<vec4f, 8>,
}

// Rays of a pass: those of all pixels, or a part of those of the edges.
struct Pass {
  count: u32,   // rays that there is room for
  edges: u32,   // 1: extra rays
  first: u32,   // edge ray that the first one is
  pad: u32,
}

@group(1) @binding(0) var<uniform> shot: Shot;
@group(1) @binding(1) var<uniform> pass_: Pass;
@group(1) @binding(2) var<storage, read> slopes: array<vec4f>;  // right, its rest, up, its rest
@group(1) @binding(3) var<storage, read_write> hits: array<u32>;    // t, row, triangle, u, v
@group(1) @binding(4) var<storage, read_write> colours: array<vec4f>;

fn linear_index(id: vec3u, groups: vec3u) -> u32 {
  return id.x + id.y * groups.x * 64u;
}
