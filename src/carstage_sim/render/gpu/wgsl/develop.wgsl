// From display light to 8-bit codes, and which pixels are sampled again.

@group(1) @binding(5) var<storage, read_write> edges: array<atomic<u32>>;  // how many, then the pixels
@group(3) @binding(0) var<storage, read> curve: array<u32>;               // 8192 codes, four a word
@group(3) @binding(1) var<storage, read_write> codes: array<u32>;         // B, G, R, A a word
@group(3) @binding(2) var<storage, read> extra: array<vec4f>;             // colours of the extra rays
@group(3) @binding(3) var<storage, read_write> plan: array<u32>;           // work groups of each round

fn code_of(value: f32) -> u32 {
  let step = u32(clamp(value, 0.0, 1.0) * 8191.0 + 0.5);
  return (curve[step >> 2u] >> ((step & 3u) * 8u)) & 255u;
}

fn developed(colour: vec3f) -> u32 {
  return code_of(colour.z) | (code_of(colour.y) << 8u) | (code_of(colour.x) << 16u) | 0xff000000u;
}

// Codes of all pixels, one ray each; and no edges yet.
@compute @workgroup_size(64)
fn develop(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = linear_index(id, groups);
  if (i == 0u) {
    atomicStore(&edges[0], 0u);
  }
  if (i < pass_.count) {
    codes[i] = developed(colours[i].xyz);
  }
}

fn code_at(y: i32, x: i32, channel: i32) -> i32 {
  return i32((codes[u32(y) * shot.width + u32(x)] >> u32(16 - 8 * channel)) & 255u);
}
fn hit_row(i: i32) -> i32 { return bitcast<i32>(hits[pass_.count + u32(i)]); }
fn hit_triangle(i: i32) -> i32 { return bitcast<i32>(hits[2u * pass_.count + u32(i)]); }

fn differ(y: i32, x: i32, v: i32, u: i32) -> bool {
  if (u < 0 || v < 0 || u >= i32(shot.width) || v >= i32(shot.height)) {
    return false;
  }
  let apart = APART(y, x, v, u);
  let i = y * i32(shot.width) + x;
  let j = v * i32(shot.width) + u;
  return apart > shot.strong || (apart > shot.weak && UNLIKE(i, j));
}

@compute @workgroup_size(64)
fn find_edges(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = linear_index(id, groups);
  if (i >= pass_.count) {
    return;
  }
  let y = i32(i / shot.width);
  let x = i32(i % shot.width);
  if (differ(y, x, y, x + 1) || differ(y, x, y + 1, x) || differ(y, x, y, x - 1) || differ(y, x, y - 1, x)) {
    atomicStore(&edges[1u + atomicAdd(&edges[0], 1u)], i);
  }
}

// How many work groups each round of extra rays takes.
@compute @workgroup_size(1)
fn plan_rounds() {
  let all = atomicLoad(&edges[0]) * shot.samples;
  for (var round = 0u; round < arrayLength(&plan) / 4u; round++) {
    let before = round * pass_.count;
    let rays = min(select(0u, all - before, all > before), pass_.count);
    plan[4u * round] = (rays + 63u) / 64u;
    plan[4u * round + 1u] = 1u;
    plan[4u * round + 2u] = 1u;
  }
}

// Edge pixels become the mean of their rays.
@compute @workgroup_size(64)
fn blend(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = linear_index(id, groups);
  let edge = pass_.first / shot.samples + i;
  if (edge >= atomicLoad(&edges[0]) || i * shot.samples >= pass_.count) {
    return;
  }
  var total = vec3f(0.0);
  for (var k = 0u; k < shot.samples; k++) {
    total += extra[i * shot.samples + k].xyz;
  }
  let pixel = atomicLoad(&edges[1u + edge]);
  total += colours[pixel].xyz;
  codes[pixel] = developed(total / f32(shot.samples + 1u));
}
