// What comes of sun and sky to the places that rays met. A pass of its own: rays to the sun run side
// by side, and registers of the shading do not stand in their way.

@group(3) @binding(2) var<storage, read_write> light: array<f32>;

@compute @workgroup_size(64)
fn reach(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let lanes = groups.x * groups.y * 64u;
  for (var k = linear_index(id, groups); k < ray_count(); k += lanes) {
    if (!takes_ray(k)) {
      continue;
    }
    take_hit();
    if (the_hit.row == LENT) {
      continue;
    }
    light[the_place] = REACHING(0);
  }
}
