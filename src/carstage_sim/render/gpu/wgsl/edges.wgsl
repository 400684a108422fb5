// Which pixels are sampled again, or become a mean of those around them: `EVEN` is told with them.

fn code_at(y: i32, x: i32, channel: i32) -> i32 {
  return i32((codes[u32(y) * shot.width + u32(x)] >> u32(16 - 8 * channel)) & 255u);
}
fn hit_row(i: i32) -> i32 { return bitcast<i32>(hits[pixel_count() + u32(i)]); }
fn hit_triangle(i: i32) -> i32 { return bitcast<i32>(hits[2u * pixel_count() + u32(i)]); }
fn leaf_at(i: i32) -> i32 { return LEAF(i); }

fn differ(y: i32, x: i32, v: i32, u: i32) -> bool {
  if (u < 0 || v < 0 || u >= i32(shot.width) || v >= i32(shot.height)) {
    return false;
  }
  let apart = APART(y, x, v, u);
  let i = y * i32(shot.width) + x;
  let j = v * i32(shot.width) + u;
  return apart > shot.strong || (apart > shot.weak && UNLIKE(i, j));
}

fn is_even(y: i32, x: i32) -> bool {
  if (!BLENDS || y < 1 || x < 1 || y + 1 >= i32(shot.height) || x + 1 >= i32(shot.width)) {
    return false;
  }
  return IS_EVEN(y * i32(shot.width) + x, i32(shot.width));
}

@compute @workgroup_size(64)
fn find_edges(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = pixel_of_invocation(id, groups);
  if (i >= pixel_count()) {
    return;
  }
  let y = i32(i / shot.width);
  let x = i32(i % shot.width);
  if (differ(y, x, y, x + 1) || differ(y, x, y + 1, x) || differ(y, x, y, x - 1) || differ(y, x, y - 1, x)) {
    let found = select(i, i | EVEN, is_even(y, x));
    atomicStore(&edges[1u + atomicAdd(&edges[0], 1u)], found);
  }
}
