// Which pixels of a band are sampled again, or become a mean of those around them.

@group(3) @binding(2) var<storage, read> codes: array<u32>;         // of one ray each
@group(3) @binding(3) var<storage, read_write> edges: array<u32>;   // two words each, see edge.wgsl

// Of `the_camera`.
fn first_pixel() -> u32 { return the_camera * pixel_count(); }

fn code_at(y: i32, x: i32, channel: i32) -> i32 {
  return i32((codes[first_pixel() + u32(y) * shot.width + u32(x)] >> u32(16 - 8 * channel)) & 255u);
}
fn hit_row(i: i32) -> i32 { return bitcast<i32>(hits[pixels_of_all() + u32(i)]); }
fn hit_triangle(i: i32) -> i32 { return bitcast<i32>(hits[2u * pixels_of_all() + u32(i)]); }
fn leaf_at(i: i32) -> i32 { return LEAF(i); }

fn differ(y: i32, x: i32, v: i32, u: i32) -> bool {
  if (u < 0 || v < 0 || u >= i32(shot.width) || v >= i32(shot.height)) {
    return false;
  }
  let apart = APART(y, x, v, u);
  let i = i32(first_pixel()) + y * i32(shot.width) + x;
  let j = i32(first_pixel()) + v * i32(shot.width) + u;
  return apart > shot.strong || (apart > shot.weak && UNLIKE(i, j));
}

fn is_even(y: i32, x: i32) -> bool {
  if (!BLENDS || y < 1 || x < 1 || y + 1 >= i32(shot.height) || x + 1 >= i32(shot.width)) {
    return false;
  }
  return IS_EVEN(i32(first_pixel()) + y * i32(shot.width) + x, i32(shot.width));
}

// Whether the four pixels around a place show one surface: then it has the colour between theirs.
fn is_amid_its_like(y: i32, x: i32, offset: vec2f) -> bool {
  let width = i32(shot.width);
  let to = steps_of(offset);
  let other = vec2i(x, y) + to;
  if (!BLENDS || any(other < vec2i(0)) || other.x >= width || other.y >= i32(shot.height)) {
    return false;
  }
  let i = i32(first_pixel()) + y * width + x;
  let below = i + to.y * width;
  return ALIKE(i, i + to.x) && ALIKE(i, below) && ALIKE(i, below + to.x);
}

// How many edges and extra rays the work group has, and where they begin.
var<workgroup> edges_found: atomic<u32>;
var<workgroup> rays_found: atomic<u32>;
var<workgroup> first_edge: u32;
var<workgroup> first_ray: u32;

@compute @workgroup_size(64)
fn find_edges(
  @builtin(global_invocation_id) id: vec3u,
  @builtin(num_workgroups) groups: vec3u,
  @builtin(local_invocation_index) lane: u32,
) {
  if (lane == 0u) {
    atomicStore(&edges_found, 0u);
    atomicStore(&rays_found, 0u);
  }
  workgroupBarrier();
  let i = pixel_in_tiles(linear_index(id, groups));
  the_camera = i / pixel_count();
  let row = i / shot.width;
  let y = i32(row - the_camera * shot.height);
  let x = i32(i % shot.width);
  var is_edge = i < pixels_of_all() && row >= batch.first_row && row < batch.last_row;
  var even = false;
  var traced = 0u;
  if (is_edge) {
    is_edge = differ(y, x, y, x + 1) || differ(y, x, y + 1, x) || differ(y, x, y, x - 1) || differ(y, x, y - 1, x);
  }
  if (is_edge) {
    even = is_even(y, x);
  }
  if (is_edge && !even) {
    for (var k = 0u; k < shot.samples; k++) {
      traced |= select(1u << k, 0u, is_amid_its_like(y, x, shot.offsets[k].xy));
    }
  }
  let edge = atomicAdd(&edges_found, select(0u, 1u, is_edge));
  let ray = atomicAdd(&rays_found, countOneBits(traced));
  workgroupBarrier();
  if (lane == 0u) {
    first_edge = atomicAdd(&list[2u * batch.band], atomicLoad(&edges_found));
    first_ray = atomicAdd(&list[2u * batch.band + 1u], atomicLoad(&rays_found));
  }
  workgroupBarrier();
  if (!is_edge) {
    return;
  }
  let at = 2u * (first_edge + edge);
  var next = first_ray + ray;
  edges[at] = select(i, i | EVEN, even);
  edges[at + 1u] = (next << 8u) | traced;
  for (var k = 0u; k < shot.samples; k++) {
    if ((traced & (1u << k)) != 0u) {
      atomicStore(&list[HEAD + next], (i << 3u) | k);
      next += 1u;
    }
  }
}
