// Nearest hit and any hit in the two-level hierarchy, as carstage_sim.render.cast has them.
//
// The same triangles, the same tests in the same order of operations, the same rules for ties: which
// triangle a ray meets differs from the CPU's only where a direction or a quotient is rounded otherwise.

const STATIC: i32 = -1;
const NOTHING: i32 = -2;
const NODE_WORDS: u32 = 4u;      // vec4: x and y of the first box, of the second, z of both, children
const TRIANGLE_WORDS: u32 = 3u;  // vec4: a corner each; behind them the triangle's number, its cells, 0
const PLACE_WORDS: u32 = 4u;     // vec4: columns of the rotation with the position, then root, row
const ABSENT: i32 = 0;

struct Extent {
  instances: u32,    // 0 where there are none, else 1; the hierarchy over them begins at node 0
  static_root: i32,  // -1 where there is no town
  // Always 0, which no compiler knows: keeps products from being fused into sums, which would
  // make the edge functions of neighbours disagree and let rays through between them.
  zero: u32,
  pad: u32,
}

struct Hit {
  t: f32,
  row: i32,
  triangle: i32,
  u: f32,
  v: f32,
}

@group(0) @binding(0) var<storage, read> nodes: array<vec4u>;
@group(0) @binding(1) var<storage, read> triangles: array<vec4u>;
@group(0) @binding(2) var<storage, read> places: array<vec4u>;
@group(0) @binding(3) var<uniform> extent: Extent;

// Nodes to visit. Where a ray enters each is not kept beside it: that saves few visits, and doubles
// the memory that a lane clears and reads.
var<private> stack: array<i32, STACK>;

fn rounded(x: f32) -> f32 {
  return bitcast<f32>(bitcast<u32>(x) ^ extent.zero);
}

fn rounded3(x: vec3f) -> vec3f {
  return bitcast<vec3f>(bitcast<vec3u>(x) ^ vec3u(extent.zero));
}

// Reciprocals of a direction's components, finite: no ray is parallel to a plane.
fn inverse_of(d: vec3f) -> vec3f {
  let safe = select(d, vec3f(1.0), abs(d) < vec3f(1e-12));
  let large = select(vec3f(-1e12), vec3f(1e12), d >= vec3f(0.0));
  return select(1.0 / safe, large, abs(d) < vec3f(1e-12));
}

// A reciprocal rounded as the CPU rounds it: GPUs divide with an error of a few units. What has no
// fused multiply-add is a CPU and divides exactly; there the correction would add an error.
fn reciprocal(x: f32) -> f32 {
  let guess = 1.0 / x;
  if (!FUSED) {
    return guess;
  }
  return fma(fma(-x, guess, 1.0), guess, guess);
}

// A ray in the axes of what it is tested against.
struct Ray {
  o: vec3f,
  inverse: vec3f,
  longest: u32,   // axis of the direction's largest component, which comes last
  start: vec3f,   // origin along the axes in that order
  shear: vec3f,
}

fn ordered(x: vec3f, longest: u32) -> vec3f {
  return select(select(x, x.zxy, longest == 1u), x.yzx, longest == 0u);
}

fn ray_of(o: vec3f, d: vec3f) -> Ray {
  let a = abs(d);
  let longest = select(select(2u, 1u, a.y >= a.z), 0u, a.x >= a.y && a.x >= a.z);
  let turned = ordered(d, longest);
  let sz = reciprocal(turned.z);
  let shear = vec3f(rounded(turned.x * sz), rounded(turned.y * sz), sz);
  return Ray(o, inverse_of(d), longest, ordered(o, longest), shear);
}

// A corner as the ray sees it: sheared so that the ray runs along the last axis.
fn sheared(corner: vec3f, ray: Ray) -> vec3f {
  let p = ordered(corner, ray.longest) - ray.start;
  let along = rounded3(ray.shear * p.z);
  return vec3f(p.x - along.x, p.y - along.y, along.z);
}

fn sum_of_products(a: vec3f, b: vec3f) -> f32 {
  return rounded(a.x * b.x) + rounded(a.y * b.y) + rounded(a.z * b.z);
}

fn leaf_hash(i: u32, j: u32, seed: u32) -> f32 {
  var h = i * 374761393u + j * 668265263u + seed * 2246822519u;
  h = (h ^ (h >> 13u)) * 1274126177u;
  h = (h ^ (h >> 16u)) * 2654435761u;
  return f32(h >> 8u) * (1.0 / 16777216.0);
}

// Whether a ray passes between the leaves of a card; see carstage_sim.render.leaves.leaf_at.
fn is_gap(cells: u32, number: i32, u: f32, v: f32) -> bool {
  let counts = vec2f(f32(cells & 15u), f32(cells >> 4u));
  let place = vec2f(rounded(u * counts.x), rounded(v * counts.y));
  let whole = max(floor(place), vec2f(0.0));
  let cut = (whole.x + 1.0) * counts.y + (whole.y + 1.0) * counts.x > counts.x * counts.y + 0.01;
  let cell = u32(whole.x) + 16u * u32(whole.y);
  let chance = leaf_hash(cell, u32(number), 101u);
  if (cut || chance < 0.08) {
    return true;
  }
  let turn = leaf_hash(cell, u32(number), 102u) * 2.0 - 1.0;
  let scale = 1.0 / (1.0 + turn * turn);
  let cosine = (1.0 - turn * turn) * scale;
  let sine = (turn + turn) * scale;
  let off = place - whole - 0.5 - 0.17 * vec2f(turn, chance + chance - 1.0);
  let size = 1.0 / (1.0 + 0.36 * chance);
  let along = (cosine * off.x + sine * off.y) * size * (1.0 / 0.48);
  let across = (cosine * off.y - sine * off.x) * size * (1.0 / 0.34);
  return abs(across) > 1.0 - along * along;
}

const IN_TOWN: u32 = 0u;
const OVER_INSTANCES: u32 = 1u;
const IN_INSTANCE: u32 = 2u;

// What a ray meets first between `low` and `high`; see carstage_sim.render.cast.trace.
// One loop for both levels: what is tested in it stands in the code once.
fn trace(o: vec3f, d: vec3f, low: f32, high: f32, skip: i32, any_hit: bool) -> Hit {
  var hit = Hit(high, NOTHING, -1, 0.0, 0.0);
  let world = ray_of(o, d);
  var ray = world;
  var phase = IN_TOWN;
  var depth = 0;
  var base = 0;         // where the stack of this instance begins
  var row = STATIC;     // what the current hierarchy belongs to
  var number = -1;      // its nearest triangle so far
  var owned = high;     // and where the nearest hit was when it began
  var ties = false;     // whether a triangle there counts
  var node = extent.static_root;
  if (node < 0) {
    if (extent.instances == 0u) {
      return hit;
    }
    phase = OVER_INSTANCES;
    node = 0;
  }
  loop {
    var pops = true;
    if (node >= 0) {
      let word = u32(node) * NODE_WORDS;
      let a = bitcast<vec4f>(nodes[word]);
      let b = bitcast<vec4f>(nodes[word + 1u]);
      let c = bitcast<vec4f>(nodes[word + 2u]);
      let children = bitcast<vec4i>(nodes[word + 3u]);
      let ax = (a.xy - ray.o.x) * ray.inverse.x;
      let ay = (a.zw - ray.o.y) * ray.inverse.y;
      let az = (c.xy - ray.o.z) * ray.inverse.z;
      let bx = (b.xy - ray.o.x) * ray.inverse.x;
      let by = (b.zw - ray.o.y) * ray.inverse.y;
      let bz = (c.zw - ray.o.z) * ray.inverse.z;
      // Rounding is met by growing each interval a little, so that no triangle of a box is lost.
      let enter = max(vec2f(
        max(max(min(ax.x, ax.y), min(ay.x, ay.y)), min(az.x, az.y)),
        max(max(min(bx.x, bx.y), min(by.x, by.y)), min(bz.x, bz.y))) * (1.0 - 1e-6), vec2f(low));
      let leave = min(vec2f(
        min(min(max(ax.x, ax.y), max(ay.x, ay.y)), max(az.x, az.y)),
        min(min(max(bx.x, bx.y), max(by.x, by.y)), max(bz.x, bz.y))) * (1.0 + 1e-6), vec2f(hit.t));
      let first = enter.x <= leave.x;
      let second = (enter.y <= leave.y) && (children.y != ABSENT);
      if (first && second) {
        let swap = enter.y < enter.x;
        stack[depth] = select(children.y, children.x, swap);
        node = select(children.x, children.y, swap);
        depth += 1;
        pops = false;
      } else if (first || second) {
        node = select(children.y, children.x, first);
        pops = false;
      }
    } else if (phase != OVER_INSTANCES) {
      let leaf = u32(-1 - node);
      let begin = leaf >> 4u;
      for (var k = begin; k < begin + (leaf & 15u); k++) {
        let word = k * TRIANGLE_WORDS;
        let corner = triangles[word];
        let index = i32(corner.w);
        let a = sheared(bitcast<vec3f>(corner.xyz), ray);
        let second = triangles[word + 1u];
        let b = sheared(bitcast<vec3f>(second.xyz), ray);
        let c = sheared(bitcast<vec3f>(triangles[word + 2u].xyz), ray);
        let u = rounded(c.x * b.y) - rounded(c.y * b.x);
        let v = rounded(a.x * c.y) - rounded(a.y * c.x);
        let w = rounded(b.x * a.y) - rounded(b.y * a.x);
        let determinant = u + v + w;
        if (((min(min(u, v), w) < 0.0) && (max(max(u, v), w) > 0.0)) || (determinant == 0.0)) {
          continue;
        }
        let scaled = rounded(u * a.z) + rounded(v * b.z) + rounded(w * c.z);
        let inverse = reciprocal(determinant);
        let t = rounded(scaled * inverse);
        let fresh = number < 0;
        let wins_tie = (fresh && (ties || (t < owned))) || (!fresh && (index < number));
        if ((t >= low) && ((t < hit.t) || ((t == hit.t) && wins_tie))) {
          let weight = vec2f(rounded(u * inverse), rounded(v * inverse));
          if (second.w != 0u && is_gap(second.w, index, weight.x, weight.y)) {
            continue;
          }
          number = index;
          hit = Hit(t, row, index, weight.x, weight.y);
          if (any_hit) {
            return hit;
          }
        }
      }
    } else {
      let word = u32(-1 - node) * PLACE_WORDS;
      let place = bitcast<vec4i>(places[word + 3u]);
      if (place.y != skip) {
        let x = bitcast<vec4f>(places[word]);
        let y = bitcast<vec4f>(places[word + 1u]);
        let z = bitcast<vec4f>(places[word + 2u]);
        let away = o - vec3f(x.w, y.w, z.w);
        ray = ray_of(
          vec3f(sum_of_products(x.xyz, away), sum_of_products(y.xyz, away), sum_of_products(z.xyz, away)),
          vec3f(sum_of_products(x.xyz, d), sum_of_products(y.xyz, d), sum_of_products(z.xyz, d)));
        phase = IN_INSTANCE;
        row = place.y;
        number = -1;
        owned = hit.t;
        ties = row < hit.row;
        base = depth;
        node = place.x;
        pops = false;
      }
    }
    while (pops) {
      if (depth == base) {
        if (phase == IN_INSTANCE) {
          phase = OVER_INSTANCES;
          ray = world;
          base = 0;
          continue;
        }
        if (phase == OVER_INSTANCES || extent.instances == 0u) {
          return hit;
        }
        phase = OVER_INSTANCES;
        node = 0;
        pops = false;
      } else {
        depth -= 1;
        node = stack[depth];
        pops = false;
      }
    }
  }
  return hit;
}
