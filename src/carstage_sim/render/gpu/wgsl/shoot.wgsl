// Nearest hits of the cameras' rays.

@compute @workgroup_size(64)
fn shoot(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let n = batch.room;
  let lanes = groups.x * groups.y * 64u;
  for (var k = linear_index(id, groups); k < ray_count(); k += lanes) {
    if (!takes_ray(k)) {
      continue;
    }
    let aim = shot.aims[the_camera];
    let hit = trace(aim.origin.xyz, the_ray, shot.low, shot.high, aim.skip, false);
    let i = the_place;
    hits[i] = bitcast<u32>(hit.t);
    hits[n + i] = bitcast<u32>(hit.row);
    hits[2u * n + i] = bitcast<u32>(hit.triangle);
    hits[3u * n + i] = bitcast<u32>(hit.u);
    hits[4u * n + i] = bitcast<u32>(hit.v);
  }
}
