// Nearest hits of a camera's rays.

@compute @workgroup_size(64)
fn shoot(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = pixel_of_invocation(id, groups);
  let n = pixel_count();
  if (i >= n) {
    return;
  }
  let hit = trace(shot.origin.xyz, centre_direction(i), shot.low, shot.high, shot.skip, false);
  hits[i] = bitcast<u32>(hit.t);
  hits[n + i] = bitcast<u32>(hit.row);
  hits[2u * n + i] = bitcast<u32>(hit.triangle);
  hits[3u * n + i] = bitcast<u32>(hit.u);
  hits[4u * n + i] = bitcast<u32>(hit.v);
}
