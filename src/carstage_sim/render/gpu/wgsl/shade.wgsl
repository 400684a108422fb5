// What the translated shading kernel reads and writes: the ray of this invocation.

var<private> the_ray: vec3f;
var<private> the_hit: Hit;
var<private> the_colour: vec3f;

fn ray_origin(axis: i32) -> f32 { return shot.origin[axis]; }
fn ray_direction(i: i32, axis: i32) -> f32 { return the_ray[axis]; }
fn hit_t(i: i32) -> f32 { return the_hit.t; }
fn hit_row(i: i32) -> i32 { return the_hit.row; }
fn hit_triangle(i: i32) -> i32 { return the_hit.triangle; }
fn hit_weight(i: i32, corner: i32) -> f32 { return select(the_hit.v, the_hit.u, corner == 0); }
fn set_colour(i: i32, channel: i32, value: f32) { the_colour[channel] = value; }

@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = ray_of_invocation(id, groups);
  if (i >= ray_count()) {
    return;
  }
  let n = pass_.count;
  the_ray = direction_of(i);
  the_hit = Hit(
    bitcast<f32>(hits[i]), bitcast<i32>(hits[n + i]), bitcast<i32>(hits[2u * n + i]),
    bitcast<f32>(hits[3u * n + i]), bitcast<f32>(hits[4u * n + i]));
  SHADE(0, 1);
  colours[i] = vec4f(the_colour, 0.0);
}
