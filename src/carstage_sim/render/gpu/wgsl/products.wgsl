// Pictures of what the cameras' pixels met, in CARLA's formats: B, G, R, A a word.

@group(3) @binding(0) var<storage, read_write> pixels: array<u32>;  // of each camera product after product
@group(3) @binding(1) var<storage, read> motions: array<vec4f>;     // as carstage_sim.render.gpu.camera writes them

const DEPTH: u32 = 2u;
const TAGS: u32 = 4u;
const INSTANCES: u32 = 8u;
const NORMALS: u32 = 16u;
const FLOW: u32 = 32u;
const LARGEST_FLOW: f32 = 2.0;
const BEHIND: f32 = 1e-9;
const SKY_TAG: u32 = 11u;
const OPAQUE: u32 = 0xff000000u;

fn row_of(i: u32) -> i32 { return bitcast<i32>(hits[pixels_of_all() + i]); }
fn triangle_of(i: u32) -> i32 { return bitcast<i32>(hits[2u * pixels_of_all() + i]); }

fn tag_of(i: u32) -> u32 {
  let row = row_of(i);
  if (row == -2) {
    return SKY_TAG;
  }
  if (row >= 0) {
    return u32(actors_tag(triangle_of(i)));
  }
  return u32(static_tag(triangle_of(i)));
}

fn instance_of(i: u32) -> u32 {
  let row = row_of(i);
  if (row == -2) {
    return 0u;
  }
  if (row >= 0) {
    return u32(actor_id_(row)) & 0xffffu;
  }
  let object = u32(static_object_id(triangle_of(i)));
  return select(0u, 0x8000u + (object - 1u) % 0x8000u, object > 0u);
}

fn normal_of(i: u32) -> vec3f {
  let row = row_of(i);
  if (row == -2) {
    return vec3f(0.0);
  }
  let u = bitcast<f32>(hits[3u * pixels_of_all() + i]);
  let v = bitcast<f32>(hits[4u * pixels_of_all() + i]);
  let d = normalize(centre_direction(i));
  let n = FACING(row < 0, row, triangle_of(i), u, v, d.x, d.y, d.z);
  return vec3f(n.m0, n.m1, n.m2);
}

fn depth_code(i: u32) -> u32 {
  // Sixteen million steps over a kilometre: a product in single precision would lose the last.
  let metres = clamp(bitcast<f32>(hits[i]), 0.0, 1000.0);
  let whole = floor(metres);
  let rest = whole * 0.215 + (metres - whole) * 16777.215;
  let code = min(u32(whole * 16777.0) + u32(floor(rest + 0.5)), 16777215u);
  return OPAQUE | ((code & 255u) << 16u) | (code & 0xff00u) | (code >> 16u);
}

// Current minus previous place in the picture, in halves of its sides, y upwards. The turn comes
// without the identity, so that small motions keep their digits.
fn flow_of(i: u32) -> vec2f {
  let row = row_of(i);
  let first = select(0u, 4u * u32(row + 1), row >= 0);
  let slope = slopes[i - the_camera * pixel_count()].xz;
  let near = select(1.0 / bitcast<f32>(hits[i]), 0.0, row == -2);
  let at = vec4f(1.0, slope, near);
  var ahead = dot(motions[first], at);
  var change = vec2f(dot(motions[first + 1u], at), dot(motions[first + 2u], at));
  let bend = motions[first + 3u];
  if (bend.y != 0.0) {
    let corner = u32(bitcast<i32>(bend.x) + 3 * triangle_of(i));
    let u = bitcast<f32>(hits[3u * pixels_of_all() + i]);
    let v = bitcast<f32>(hits[4u * pixels_of_all() + i]);
    let by = motions[corner] * u + motions[corner + 1u] * v + motions[corner + 2u] * (1.0 - u - v);
    ahead += by.x * near;
    change += by.yz * near;
  }
  let forward = max(1.0 + ahead, BEHIND);
  let sides = vec2f(1.0, f32(shot.height) / f32(shot.width)) * shot.half_width;
  let moved = (slope * select(ahead, forward - 1.0, forward == BEHIND) - change) / forward / sides;
  return clamp(moved, vec2f(-LARGEST_FLOW), vec2f(LARGEST_FLOW));
}

// One of the two words of a pixel. The lanes beside this one write the words beside it: a lane that
// wrote both would leave gaps in what goes to the program's memory, which takes four times as long.
// The picture comes before all others, and is of one camera.
fn write_flow(word: u32) {
  let moved = flow_of(word / 2u);
  pixels[word] = bitcast<u32>(select(moved.x, moved.y, word % 2u == 1u));
}

// All other pictures that are wanted but the colours, one behind the other.
fn write_products(i: u32) {
  let n = pixel_count();
  the_camera = i / n;
  let place = i - the_camera * n;
  var at = the_camera * shot.words + place;
  if ((shot.wanted & FLOW) != 0u) {
    at += 2u * n;
  }
  if ((shot.wanted & DEPTH) != 0u) {
    pixels[at] = depth_code(i);
    at += n;
  }
  if ((shot.wanted & TAGS) != 0u) {
    pixels[at] = OPAQUE | (tag_of(i) << 16u);
    at += n;
  }
  if ((shot.wanted & INSTANCES) != 0u) {
    let instance = instance_of(i);
    pixels[at] = OPAQUE | (tag_of(i) << 16u) | ((instance & 255u) << 8u) | (instance >> 8u);
    at += n;
  }
  if ((shot.wanted & NORMALS) != 0u) {
    let code = vec3u(clamp(floor((normal_of(i) + 1.0) * 127.5 + 0.5), vec3f(0.0), vec3f(255.0)));
    pixels[at] = OPAQUE | (code.x << 16u) | (code.y << 8u) | code.z;
    at += n;
  }
}

@compute @workgroup_size(64)
fn products(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
  let lanes = groups.x * groups.y * 64u;
  if ((shot.wanted & FLOW) != 0u) {
    for (var word = linear_index(id, groups); word < 2u * pixel_count(); word += lanes) {
      write_flow(word);
    }
  }
  for (var i = linear_index(id, groups); i < pixels_of_all(); i += lanes) {
    write_products(i);
  }
}
