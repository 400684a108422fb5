// Nearest hits of a batch of rays whose origins and directions the CPU gives.

struct Batch {
  origin: vec3f,       // of all rays, if they share one
  shared_origin: u32,
  count: u32,
  first: u32,          // of all that are cast the place of these
  total: u32,          // and how many those are
  unused: u32,
  skip: i32,
  weights: u32,        // whether u and v are wanted
  low: f32,
  high: f32,
}

@group(1) @binding(0) var<storage, read> origins: array<f32>;
@group(1) @binding(1) var<storage, read> directions: array<f32>;
@group(1) @binding(2) var<storage, read_write> hits: array<u32>;  // t, row, triangle, then u and v: the program's memory
@group(1) @binding(3) var<uniform> batch: Batch;

@compute @workgroup_size(64)
fn cast_rays(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let n = batch.count;
  let lanes = groups.x * groups.y * 64u;
  // A lane takes several rays: its stack is cleared but once.
  for (var i = id.x + id.y * groups.x * 64u; i < n; i += lanes) {
    var o = batch.origin;
    if (batch.shared_origin == 0u) {
      o = vec3f(origins[i * 3u], origins[i * 3u + 1u], origins[i * 3u + 2u]);
    }
    let d = vec3f(directions[i * 3u], directions[i * 3u + 1u], directions[i * 3u + 2u]);
    let hit = trace(o, d, batch.low, batch.high, batch.skip, false);
    let place = batch.first + i;
    hits[place] = bitcast<u32>(hit.t);
    hits[batch.total + place] = bitcast<u32>(hit.row);
    hits[2u * batch.total + place] = bitcast<u32>(hit.triangle);
    if (batch.weights != 0u) {
      hits[3u * batch.total + 2u * place] = bitcast<u32>(hit.u);
      hits[3u * batch.total + 2u * place + 1u] = bitcast<u32>(hit.v);
    }
  }
}
