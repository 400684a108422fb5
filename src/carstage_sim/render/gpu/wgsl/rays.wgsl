// The rays of a pass.

@group(1) @binding(5) var<storage, read_write> edges: array<u32>;    // how many, then the pixels

// Rays that this pass has to send.
fn ray_count() -> u32 {
  if (pass_.edges == 0u) {
    return pass_.count;
  }
  let all = edges[0] * shot.samples;
  return min(select(0u, all - pass_.first, all > pass_.first), pass_.count);
}

// Keeps a compiler from rearranging what is exact only in this order.
fn kept(x: vec3f) -> vec3f {
  return bitcast<vec3f>(bitcast<vec3u>(x) ^ vec3u(shot.zero));
}

// What rounding took from a sum (Knuth's two-sum).
fn lost(a: vec3f, b: vec3f, sum: vec3f) -> vec3f {
  let b_part = kept(sum - a);
  return (a - kept(sum - b_part)) + (b - b_part);
}

// Direction through a pixel's centre whose part along the optical axis is 1, so that the ray's
// parameter is the depth. Rounded once, as on the CPU: a ray that passes an edge passes it there too.
fn centre_direction(pixel: u32) -> vec3f {
  let slope = slopes[pixel];
  let across = kept(shot.right.xyz * slope.x);
  let across_rest = fma(shot.right.xyz, vec3f(slope.x), -across)
    + (shot.right.xyz * slope.y + shot.right_rest.xyz * slope.x);
  let upwards = kept(shot.up.xyz * slope.z);
  let upwards_rest = fma(shot.up.xyz, vec3f(slope.z), -upwards)
    + (shot.up.xyz * slope.w + shot.up_rest.xyz * slope.z);
  let sum = kept(shot.forward.xyz + across);
  let total = kept(sum + upwards);
  let rest = lost(shot.forward.xyz, across, sum) + lost(sum, upwards, total);
  return total + (rest + (across_rest + upwards_rest + shot.forward_rest.xyz));
}

// Direction of a ray of this pass.
fn direction_of(i: u32) -> vec3f {
  if (pass_.edges == 0u) {
    return centre_direction(i);
  }
  let j = i + pass_.first;
  let moved = shot.offsets[j % shot.samples].xy * shot.angle;
  let away = moved.x * shot.right.xyz - moved.y * shot.up.xyz;
  return centre_direction(edges[1u + j / shot.samples]) + away;
}

// The ray of an invocation; pixels go in tiles of eight by eight, whose rays stay together. As many
// as `ray_count()` or more: none.
fn ray_of_invocation(id: vec3u, groups: vec3u) -> u32 {
  let i = linear_index(id, groups);
  if (pass_.edges != 0u) {
    return i;
  }
  let tiles = (shot.width + 7u) / 8u;
  let tile = i / 64u;
  let x = (tile % tiles) * 8u + i % 8u;
  let y = (tile / tiles) * 8u + (i % 64u) / 8u;
  return select(0xffffffffu, y * shot.width + x, x < shot.width && y < shot.height);
}
