// Nearest hits of a batch of rays whose origins and directions the CPU gives.

struct Batch {
  count: u32,
  shared_origin: u32,
  skip: i32,
  weights: u32,  // whether u and v are wanted
  low: f32,
  high: f32,
}

@group(1) @binding(0) var<storage, read> origins: array<f32>;
@group(1) @binding(1) var<storage, read> directions: array<f32>;
@group(1) @binding(2) var<storage, read_write> hits: array<u32>;  // t, row, triangle, then u and v
@group(1) @binding(3) var<uniform> batch: Batch;

@compute @workgroup_size(64)
fn cast_rays(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let n = batch.count;
  let lanes = groups.x * groups.y * 64u;
  // A lane takes several rays: its stack is cleared but once.
  for (var i = id.x + id.y * groups.x * 64u; i < n; i += lanes) {
    let j = select(i * 3u, 0u, batch.shared_origin != 0u);
    let o = vec3f(origins[j], origins[j + 1u], origins[j + 2u]);
    let d = vec3f(directions[i * 3u], directions[i * 3u + 1u], directions[i * 3u + 2u]);
    let hit = trace(o, d, batch.low, batch.high, batch.skip, false);
    hits[i] = bitcast<u32>(hit.t);
    hits[n + i] = bitcast<u32>(hit.row);
    hits[2u * n + i] = bitcast<u32>(hit.triangle);
    if (batch.weights != 0u) {
      hits[3u * n + 2u * i] = bitcast<u32>(hit.u);
      hits[3u * n + 2u * i + 1u] = bitcast<u32>(hit.v);
    }
  }
}
