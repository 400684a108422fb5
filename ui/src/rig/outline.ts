import { add, rotate, rotation, scale, type Vector } from "./coordinates";
import type { RigSensor, View } from "./sensors";

/** A point of a plane view, metres: u to the right, v up. */
export type Point = readonly [number, number];

const RAD = Math.PI / 180;

/** Unit direction in the sensor's axes: azimuth to the right, elevation up, degrees. */
export function direction(azimuth: number, elevation: number): Vector {
  const c = Math.cos(elevation * RAD);
  return [c * Math.cos(azimuth * RAD), c * Math.sin(azimuth * RAD), Math.sin(elevation * RAD)];
}

/** Unit direction through a pinhole's image at shares (-1..1) of half its width and height. */
export function pinhole(h: number, v: number, right: number, up: number): Vector {
  const y = Math.tan((Math.min(h, 175) * RAD) / 2) * right;
  const z = Math.tan((Math.min(v, 175) * RAD) / 2) * up;
  const length = Math.hypot(1, y, z);
  return [1 / length, y / length, z / length];
}

function range(from: number, to: number, steps: number): number[] {
  return Array.from({ length: steps + 1 }, (_, i) => from + ((to - from) * i) / steps);
}

/** Closed lines around what a sensor sees out to a distance, in vehicle coordinates. */
export function reach(sensor: RigSensor, view: View, distance: number): Vector[][] {
  const matrix = rotation(sensor.pose);
  const origin: Vector = [sensor.pose.x, sensor.pose.y, sensor.pose.z];
  const out = (d: Vector) => add(origin, rotate(matrix, scale(d, distance)));
  if (view.shape === "sweep") {
    if (view.h >= 360) return [range(0, 360, 72).map((azimuth) => out(direction(azimuth, 0)))];
    return [[origin, ...range(-view.h / 2, view.h / 2, 36).map((a) => out(direction(a, 0)))]];
  }
  if (view.shape === "cone") {
    const arc = range(-view.h / 2, view.h / 2, 12);
    return [[origin, ...arc.flatMap((a) => [out(direction(a, view.v / 2)), out(direction(a, -view.v / 2))])]];
  }
  const shares = range(-1, 1, 12);
  return [
    [origin, ...shares.flatMap((s) => [-1, 0, 1].map((t) => out(pinhole(view.h, view.v, s, t))))],
  ];
}

/** The vertical fans of a LiDAR, ahead and behind, in vehicle coordinates. */
export function fans(sensor: RigSensor, view: View & { shape: "sweep" }, distance: number): Vector[][] {
  const matrix = rotation(sensor.pose);
  const origin: Vector = [sensor.pose.x, sensor.pose.y, sensor.pose.z];
  const sides = view.h >= 360 ? [0, 180] : [0];
  return sides.map((azimuth) => [
    origin,
    ...range(view.lower, view.upper, 10).map((elevation) =>
      add(origin, rotate(matrix, scale(direction(azimuth, elevation), distance))),
    ),
  ]);
}

/** Where a LiDAR's beams meet the ground, for some of its channels: closed lines, metres. */
export function groundRings(sensor: RigSensor, view: View & { shape: "sweep" }, farthest: number): Vector[][] {
  const matrix = rotation(sensor.pose);
  const origin: Vector = [sensor.pose.x, sensor.pose.y, sensor.pose.z];
  const step = Math.max(1, Math.floor(view.channels / 32));
  const rings: Vector[][] = [];
  for (let channel = 0; channel < view.channels; channel += step) {
    const share = view.channels > 1 ? channel / (view.channels - 1) : 0;
    const elevation = view.lower + (view.upper - view.lower) * share;
    const ring = range(-view.h / 2, view.h / 2, 60).map((azimuth) => {
      const d = rotate(matrix, direction(azimuth, elevation));
      const t = d[2] < -1e-3 ? -origin[2] / d[2] : Infinity;
      return t > 0 && t < farthest ? add(origin, scale(d, t)) : null;
    });
    if (ring.every((point) => point !== null)) rings.push(ring);
  }
  return rings;
}

/** Convex hull, counter-clockwise (Andrew's monotone chain). */
export function hull(points: readonly Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list: Point[]) => {
    const chain: Point[] = [];
    for (const p of list) {
      for (;;) {
        const [a, b] = [chain.at(-2), chain.at(-1)];
        if (!a || !b) break;
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}
