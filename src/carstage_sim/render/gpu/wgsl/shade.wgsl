// Colours of rays; of those through pixels' centres the codes, too.

@group(3) @binding(5) var<storage, read_write> codes: array<u32>;  // of one ray each
@group(3) @binding(6) var<storage, read> light: array<f32>;        // that comes to what rays met

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let lanes = groups.x * groups.y * 64u;
  for (var k = linear_index(id, groups); k < ray_count(); k += lanes) {
    if (!takes_ray(k)) {
      continue;
    }
    take_hit();
    if (the_hit.row == LENT) {
      continue;
    }
    let reaching = light[the_place];
    let shown = SHADE(shot.lamps_on != 0u, 0, reaching);
    let colour = vec3f(shown.m0, shown.m1, shown.m2);
    colours[the_place] = vec4f(colour, 0.0);
    if (batch.listed == 0u) {
      let code = developed(colour);
      codes[the_place] = code;
      picture[the_place] = code;
    }
  }
}
