import { rotateBack, rotation, type Matrix, type Vector } from "./coordinates";
import type { RigSensor, View } from "./sensors";

const RAD = Math.PI / 180;

/** A box around the car, metres, CARLA's axes. */
export interface Box {
  location: Vector;
  extent: Vector;
}

interface Eye {
  origin: Vector;
  matrix: Matrix;
  view: View;
  inside: boolean;
}

/**
 * How many sensors see each place of the ground around the car.
 *
 * The car hides what is behind its box; a sensor inside the box is not hidden by it.
 *
 * @returns counts row by row; row 0 is farthest ahead, column 0 farthest left.
 */
export function groundCoverage(
  sensors: readonly { sensor: RigSensor; view: View }[],
  car: Box | null,
  half: number,
  cells: number,
): Uint8Array {
  // A little smaller than the box: what is mounted on its skin looks past it.
  const body = car && {
    low: car.location.map((c, i) => c - (car.extent[i] ?? 0) * 0.94) as unknown as Vector,
    high: car.location.map((c, i) => c + (car.extent[i] ?? 0) * 0.94) as unknown as Vector,
  };
  const eyes: Eye[] = sensors.map(({ sensor, view }) => {
    const origin: Vector = [sensor.pose.x, sensor.pose.y, sensor.pose.z];
    const inside =
      body !== null && origin.every((value, i) => value > (body.low[i] ?? 0) && value < (body.high[i] ?? 0));
    return { origin, matrix: rotation(sensor.pose), view, inside };
  });
  const counts = new Uint8Array(cells * cells);
  const size = (2 * half) / cells;
  for (let row = 0; row < cells; row += 1) {
    const x = half - (row + 0.5) * size;
    for (let column = 0; column < cells; column += 1) {
      const ground: Vector = [x, -half + (column + 0.5) * size, 0];
      let seen = 0;
      for (const eye of eyes) {
        if (!sees(eye, ground)) continue;
        if (body && !eye.inside && crosses(eye.origin, ground, body.low, body.high)) continue;
        seen += 1;
      }
      counts[row * cells + column] = seen;
    }
  }
  return counts;
}

function sees({ origin, matrix, view }: Eye, point: Vector): boolean {
  const away: Vector = [point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]];
  const distance = Math.hypot(...away);
  if (distance > view.range || distance < 1e-6) return false;
  const [fx, fy, fz] = rotateBack(matrix, away);
  if (view.shape === "pyramid")
    return (
      fx > 0 &&
      Math.abs(fy) <= fx * Math.tan((Math.min(view.h, 179) * RAD) / 2) &&
      Math.abs(fz) <= fx * Math.tan((Math.min(view.v, 179) * RAD) / 2)
    );
  const azimuth = Math.atan2(fy, fx) / RAD;
  const elevation = Math.atan2(fz, Math.hypot(fx, fy)) / RAD;
  if (view.shape === "cone") return Math.abs(azimuth) <= view.h / 2 && Math.abs(elevation) <= view.v / 2;
  return Math.abs(azimuth) <= view.h / 2 && elevation >= view.lower && elevation <= view.upper;
}

/** Whether the way from a to b goes through a box (slab test). */
export function crosses(a: Vector, b: Vector, low: Vector, high: Vector): boolean {
  let [enter, leave] = [0, 1];
  for (let axis = 0; axis < 3; axis += 1) {
    const [from, to] = [a[axis] ?? 0, b[axis] ?? 0];
    const [near, far] = [low[axis] ?? 0, high[axis] ?? 0];
    const way = to - from;
    if (Math.abs(way) < 1e-9) {
      if (from < near || from > far) return false;
      continue;
    }
    const [s, t] = [(near - from) / way, (far - from) / way];
    enter = Math.max(enter, Math.min(s, t));
    leave = Math.min(leave, Math.max(s, t));
    if (enter >= leave) return false;
  }
  return true;
}

/** Share of a ring around the car, from its box out to a distance, that no sensor sees. */
export function blindShare(counts: Uint8Array, car: Box | null, half: number, cells: number, out: number): number {
  const size = (2 * half) / cells;
  let [all, blind] = [0, 0];
  counts.forEach((count, i) => {
    const x = half - (Math.floor(i / cells) + 0.5) * size - (car?.location[0] ?? 0);
    const y = -half + ((i % cells) + 0.5) * size - (car?.location[1] ?? 0);
    if (car && Math.abs(x) < car.extent[0] && Math.abs(y) < car.extent[1]) return;
    if (Math.hypot(x, y) > out) return;
    all += 1;
    if (count === 0) blind += 1;
  });
  return all === 0 ? 0 : blind / all;
}
