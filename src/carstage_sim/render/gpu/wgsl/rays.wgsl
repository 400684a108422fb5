// The rays of the cameras.

// Keeps a compiler from rearranging what is exact only in this order.
fn kept(x: vec3f) -> vec3f {
  return bitcast<vec3f>(bitcast<vec3u>(x) ^ vec3u(shot.zero));
}

// What rounding took from a sum (Knuth's two-sum).
fn lost(a: vec3f, b: vec3f, sum: vec3f) -> vec3f {
  let b_part = kept(sum - a);
  return (a - kept(sum - b_part)) + (b - b_part);
}

// A number's upper half, whose products have no more digits than there is room for (Veltkamp).
fn upper_half(x: vec3f) -> vec3f {
  let wide = kept(x * 4097.0);
  return kept(wide - kept(wide - x));
}

// What rounding took from a product.
fn rest_of_product(a: vec3f, b: f32, product: vec3f) -> vec3f {
  if (FUSED) {
    return fma(a, vec3f(b), -product);
  }
  // Dekker's product.
  let a_high = upper_half(a);
  let a_low = a - a_high;
  let b_high = upper_half(vec3f(b));
  let b_low = vec3f(b) - b_high;
  let upper = kept(kept(a_high * b_high) - product);
  return kept(kept(upper + kept(a_high * b_low)) + kept(a_low * b_high)) + kept(a_low * b_low);
}

// Direction through the centre of a pixel of `the_camera` whose part along the optical axis is 1, so that the ray's
// parameter is the depth. Rounded once, as on the CPU: a ray that passes an edge passes it there too.
fn centre_direction(pixel: u32) -> vec3f {
  let slope = slopes[pixel - the_camera * pixel_count()];
  let aim = shot.aims[the_camera];
  let across = kept(aim.right.xyz * slope.x);
  let across_rest = rest_of_product(aim.right.xyz, slope.x, across)
    + (aim.right.xyz * slope.y + aim.right_rest.xyz * slope.x);
  let upwards = kept(aim.up.xyz * slope.z);
  let upwards_rest = rest_of_product(aim.up.xyz, slope.z, upwards)
    + (aim.up.xyz * slope.w + aim.up_rest.xyz * slope.z);
  let sum = kept(aim.forward.xyz + across);
  let total = kept(sum + upwards);
  let rest = lost(aim.forward.xyz, across, sum) + lost(sum, upwards, total);
  return total + (rest + (across_rest + upwards_rest + aim.forward_rest.xyz));
}
