// What the translated shading kernels read: the ray of this invocation and what it met.

var<private> the_hit: Hit;

fn take_hit() {
  let n = batch.room;
  let i = the_place;
  the_hit = Hit(
    bitcast<f32>(hits[i]), bitcast<i32>(hits[n + i]), bitcast<i32>(hits[2u * n + i]),
    bitcast<f32>(hits[3u * n + i]), bitcast<f32>(hits[4u * n + i]));
}

fn ray_origin(axis: i32) -> f32 { return shot.aims[the_camera].origin[axis]; }
fn ray_direction(i: i32, axis: i32) -> f32 { return the_ray[axis]; }
fn hit_t(i: i32) -> f32 { return the_hit.t; }
fn hit_row(i: i32) -> i32 { return the_hit.row; }
fn hit_triangle(i: i32) -> i32 { return the_hit.triangle; }
fn hit_weight(i: i32, corner: i32) -> f32 { return select(the_hit.v, the_hit.u, corner == 0); }
