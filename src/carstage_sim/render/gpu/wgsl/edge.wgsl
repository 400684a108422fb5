// A pixel on an edge is two words: its number, and where its extra rays begin in the list, times 256,
// with a bit for each that is traced.

// The bit of a pixel's number that tells that it becomes a mean of nine.
const EVEN: u32 = 0x80000000u;

// Which way the other three of the four pixels around a place near a pixel's centre are.
fn steps_of(offset: vec2f) -> vec2i {
  return select(vec2i(1), vec2i(-1), offset < vec2f(0.0));
}
