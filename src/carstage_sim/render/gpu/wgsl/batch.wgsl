// The rays of a pass: one through each pixel's centre, or the extra ones of pixels on edges.

struct Batch {
  listed: u32,     // whether they are those of the list
  room: u32,       // rays that `hits` has room for
  first_row: u32,  // half-open range of the rows of all cameras whose edges are sampled together: a band
  last_row: u32,
  band: u32,       // its number
}

@group(3) @binding(0) var<uniform> batch: Batch;
// Of each band how many pixels are on edges and how many extra rays there are; then the rays of a
// band: the pixel times eight, and the number of the ray.
@group(3) @binding(1) var<storage, LIST> list: array<LISTED>;

const HEAD: u32 = 512u;
// The row of an extra ray that has the colour of a pixel beside it.
const LENT: i32 = -3;
