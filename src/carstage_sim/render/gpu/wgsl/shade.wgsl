// Colours of pixels. The translated shading kernel reads and writes the ray of this invocation.

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

// Codes of all pixels, one ray each; and no edges yet.
@compute @workgroup_size(64)
fn shade(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let i = pixel_of_invocation(id, groups);
  let n = pixel_count();
  if (i >= n) {
    return;
  }
  if (i == 0u) {
    atomicStore(&edges[0], 0u);
  }
  the_ray = centre_direction(i);
  the_hit = Hit(
    bitcast<f32>(hits[i]), bitcast<i32>(hits[n + i]), bitcast<i32>(hits[2u * n + i]),
    bitcast<f32>(hits[3u * n + i]), bitcast<f32>(hits[4u * n + i]));
  SHADE(0, 1);
  colours[i] = vec4f(the_colour, 0.0);
  codes[i] = developed(the_colour);
}

// Colours of the extra rays of a work group.
var<workgroup> sampled: array<vec3f, 64>;

fn mean_of_nine(pixel: u32) -> vec3f {
  var total = vec3f(0.0);
  for (var down = -1; down < 2; down++) {
    for (var right = -1; right < 2; right++) {
      let weight = WEIGHT(abs(right), abs(down));
      total += weight * colours[i32(pixel) + down * i32(shot.width) + right].xyz;
    }
  }
  return total;
}

fn centre_row(i: i32) -> i32 { return bitcast<i32>(hits[pixel_count() + u32(i)]); }
fn centre_triangle(i: i32) -> i32 { return bitcast<i32>(hits[2u * pixel_count() + u32(i)]); }

// Which way the other three of the four pixels around a place near a pixel's centre are.
fn steps_of(offset: vec2f) -> vec2i {
  return select(vec2i(1), vec2i(-1), offset < vec2f(0.0));
}

// Whether the four pixels around a place show one surface: then it has the colour between theirs.
fn is_amid_its_like(pixel: u32, offset: vec2f) -> bool {
  let width = i32(shot.width);
  let i = i32(pixel);
  let to = steps_of(offset);
  let other = vec2i(i % width, i / width) + to;
  if (!BLENDS || any(other < vec2i(0)) || other.x >= width || other.y >= i32(shot.height)) {
    return false;
  }
  let below = i + to.y * width;
  return ALIKE(i, i + to.x) && ALIKE(i, below) && ALIKE(i, below + to.x);
}

fn colour_between(pixel: u32, offset: vec2f) -> vec3f {
  let i = i32(pixel);
  let to = steps_of(offset);
  let below = i + to.y * i32(shot.width);
  let away = abs(offset);
  let level = mix(colours[i].xyz, colours[i + to.x].xyz, away.x);
  let under = mix(colours[below].xyz, colours[below + to.x].xyz, away.x);
  return mix(level, under, away.y);
}

// Edge pixels become the mean of their rays. As many pixels as a work group has rays for.
@compute @workgroup_size(64)
fn sample_edges(
  @builtin(workgroup_id) group: vec3u,
  @builtin(num_workgroups) groups: vec3u,
  @builtin(local_invocation_index) lane: u32,
) {
  let held = 64u / shot.samples;
  let edge = (group.x + group.y * groups.x) * held + lane / shot.samples;
  let number = lane % shot.samples;
  let used = lane < held * shot.samples && edge < atomicLoad(&edges[0]);
  var pixel = 0u;
  var even = false;
  if (used) {
    let found = atomicLoad(&edges[1u + edge]);
    pixel = found & ~EVEN;
    even = found != pixel;
  }
  let offset = shot.offsets[number].xy;
  if (used && !even && is_amid_its_like(pixel, offset)) {
    sampled[lane] = colour_between(pixel, offset);
  } else if (used && !even) {
    let moved = offset * shot.angle;
    let away = moved.x * shot.right.xyz - moved.y * shot.up.xyz;
    the_ray = centre_direction(pixel) + away;
    the_hit = trace(shot.origin.xyz, the_ray, shot.low, shot.high, shot.skip, false);
    SHADE(0, 1);
    sampled[lane] = the_colour;
  }
  workgroupBarrier();
  if (used && even && number == 0u) {
    codes[pixel] = developed(mean_of_nine(pixel));
  }
  if (used && !even && number == 0u) {
    var total = vec3f(0.0);
    for (var k = 0u; k < shot.samples; k++) {
      total += sampled[lane + k];
    }
    total += colours[pixel].xyz;
    codes[pixel] = developed(total / f32(shot.samples + 1u));
  }
}
