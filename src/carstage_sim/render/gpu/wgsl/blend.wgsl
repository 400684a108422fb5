// Pixels on edges become the mean of their rays.

@group(3) @binding(5) var<storage, read> edges: array<u32>;
@group(3) @binding(6) var<storage, read> sampled: array<vec4f>;  // colours of the extra rays

fn mean_of_nine(pixel: u32) -> vec3f {
  var total = vec3f(0.0);
  for (var down = -1; down < 2; down++) {
    for (var right = -1; right < 2; right++) {
      let weight = WEIGHT(abs(right), abs(down));
      total += weight * colours[i32(pixel) + down * i32(shot.width) + right].xyz;
    }
  }
  return total;
}

fn colour_between(pixel: u32, offset: vec2f) -> vec3f {
  let i = i32(pixel);
  let to = steps_of(offset);
  let below = i + to.y * i32(shot.width);
  let away = abs(offset);
  let level = mix(colours[i].xyz, colours[i + to.x].xyz, away.x);
  let under = mix(colours[below].xyz, colours[below + to.x].xyz, away.x);
  return mix(level, under, away.y);
}

@compute @workgroup_size(64)
fn blend_edges(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let at = linear_index(id, groups);
  if (at >= list[2u * batch.band]) {
    return;
  }
  let word = edges[2u * at];
  let pixel = word & ~EVEN;
  if (word != pixel) {
    picture[pixel] = developed(mean_of_nine(pixel));
    return;
  }
  var next = edges[2u * at + 1u] >> 8u;
  var total = vec3f(0.0);
  for (var k = 0u; k < shot.samples; k++) {
    if ((edges[2u * at + 1u] & (1u << k)) != 0u) {
      total += sampled[next].xyz;
      next += 1u;
    } else {
      total += colour_between(pixel, shot.offsets[k].xy);
    }
  }
  total += colours[pixel].xyz;
  picture[pixel] = developed(total / f32(shot.samples + 1u));
}
