// Extra rays that meet what pixels beside them show take the colour of one; see
// carstage_sim.render.lending. `hits` are those of the pixels.

@group(3) @binding(2) var<storage, read> colours: array<vec4f>;          // of the pixels
@group(3) @binding(3) var<storage, read_write> sampled: array<vec4f>;    // of the extra rays
@group(3) @binding(4) var<storage, read_write> met: array<u32>;          // what those met

var<private> the_ray: u32;
var<private> the_first: u32;  // pixel of the ray's camera
var<private> the_pixel: i32;  // of that camera
var<private> the_step: vec2i;
var<private> the_colour: vec3f;

fn row_at(i: i32) -> i32 { return bitcast<i32>(hits[pixels_of_all() + the_first + u32(i)]); }
fn triangle_at(i: i32) -> i32 { return bitcast<i32>(hits[2u * pixels_of_all() + the_first + u32(i)]); }
fn colour_at(i: i32, channel: i32) -> f32 { return colours[the_first + u32(i)][channel]; }
fn pixel_of(i: i32) -> i32 { return the_pixel; }
fn step_of(i: i32, axis: i32) -> i32 { return the_step[axis]; }
fn row_met(i: i32) -> i32 { return bitcast<i32>(met[batch.room + the_ray]); }
fn triangle_met(i: i32) -> i32 { return bitcast<i32>(met[2u * batch.room + the_ray]); }
fn set_sampled(i: i32, channel: i32, value: f32) { the_colour[channel] = value; }

@compute @workgroup_size(64)
fn lend(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let lanes = groups.x * groups.y * 64u;
  for (var k = linear_index(id, groups); k < list[2u * batch.band + 1u]; k += lanes) {
    let entry = list[HEAD + k];
    the_ray = k;
    let pixel = entry >> 3u;
    the_first = pixel - pixel % pixel_count();
    the_pixel = i32(pixel - the_first);
    the_step = steps_of(shot.offsets[entry & 7u].xy);
    if (LENDS(i32(shot.width), i32(shot.height), 0)) {
      sampled[k] = vec4f(the_colour, 0.0);
      met[batch.room + k] = bitcast<u32>(LENT);
    }
  }
}
