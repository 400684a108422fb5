// From display light to 8-bit codes.

@group(3) @binding(2) var<storage, read> curve: array<u32>;             // 8192 codes, four a word
@group(3) @binding(3) var<storage, COLOURS> colours: array<vec4f>;      // of one ray each
@group(3) @binding(4) var<storage, read_write> picture: array<u32>;     // B, G, R, A a word

fn code_of(value: f32) -> u32 {
  let step = u32(clamp(value, 0.0, 1.0) * 8191.0 + 0.5);
  return (curve[step >> 2u] >> ((step & 3u) * 8u)) & 255u;
}

fn developed(colour: vec3f) -> u32 {
  return code_of(colour.z) | (code_of(colour.y) << 8u) | (code_of(colour.x) << 16u) | 0xff000000u;
}
