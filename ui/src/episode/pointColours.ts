import type { EpisodeDetail, FrameObject } from "../api/types";

/** Colours of points: x, y, z and a value each in, red, green and blue from 0 to 1 out. */
export type PointColour = "height" | "range" | "value" | "class" | "instance";

type Rgb = readonly [number, number, number];
/** Dark blue over green to yellow: brightness alone tells them apart, too. */
const STOPS: readonly Rgb[] = [
  [68, 60, 160],
  [49, 104, 190],
  [33, 145, 160],
  [53, 183, 121],
  [160, 218, 57],
  [253, 231, 37],
];
const STEPS = 256;
const RAMP = ramp(STOPS);
/** Comes nearer, stands, goes away. */
const RATES = ramp([[255, 90, 90], [200, 200, 205], [90, 160, 255]]);
const OTHER: Rgb = [128, 134, 146];

function ramp(stops: readonly Rgb[]): Float32Array {
  const table = new Float32Array(STEPS * 3);
  for (let i = 0; i < STEPS; i += 1) {
    const at = (i / (STEPS - 1)) * (stops.length - 1);
    const [low, high] = [stops[Math.floor(at)] ?? OTHER, stops[Math.ceil(at)] ?? OTHER];
    for (let c = 0; c < 3; c += 1) table[i * 3 + c] = ((low[c] ?? 0) + ((high[c] ?? 0) - (low[c] ?? 0)) * (at % 1)) / 255;
  }
  return table;
}

export interface Scale {
  low: number;
  high: number;
  unit: string;
  stops: string;
}

/** What the ends of the colours stand for; null where colours stand for names. */
export function scaleOf(by: PointColour, kind: string): Scale | null {
  const stops = css(STOPS);
  if (by === "height") return { low: -0.5, high: 4, unit: "m above the ground", stops };
  if (by === "range") return { low: 0, high: 80, unit: "m from the ego", stops };
  if (by === "value" && kind === "radar") return { low: -10, high: 10, unit: "m/s, nearer to farther", stops: css([[255, 90, 90], [200, 200, 205], [90, 160, 255]]) };
  if (by === "value") return { low: 0, high: 1, unit: "intensity", stops };
  return null;
}

function css(stops: readonly Rgb[]): string {
  return stops.map((stop) => `rgb(${stop.join(",")})`).join(", ");
}

export interface Painted {
  detail: Pick<EpisodeDetail, "tags">;
  /** `semantic_lidar`, `lidar`, `radar`: what the value is. */
  kind: string;
  objects: readonly FrameObject[];
}

export function paint(points: Float32Array, colours: Float32Array, by: PointColour, painted: Painted): void {
  const count = points.length / 4;
  const scale = scaleOf(by, painted.kind);
  if (scale) {
    const table = by === "value" && painted.kind === "radar" ? RATES : RAMP;
    const factor = (STEPS - 1) / (scale.high - scale.low);
    for (let i = 0; i < count; i += 1) {
      const at = i * 4;
      const x = points[at] ?? 0;
      const y = points[at + 1] ?? 0;
      const value = by === "height" ? (points[at + 2] ?? 0) : by === "range" ? Math.hypot(x, y) : (points[at + 3] ?? 0);
      const step = Math.min(STEPS - 1, Math.max(0, Math.round((value - scale.low) * factor))) * 3;
      colours[i * 3] = table[step] ?? 0;
      colours[i * 3 + 1] = table[step + 1] ?? 0;
      colours[i * 3 + 2] = table[step + 2] ?? 0;
    }
    return;
  }
  for (let i = 0; i < count; i += 1) set(colours, i, OTHER);
  if (by === "class" && painted.kind === "semantic_lidar") {
    const tags = new Map(painted.detail.tags.map(({ value, rgb }) => [value, rgb as unknown as Rgb]));
    for (let i = 0; i < count; i += 1) set(colours, i, tags.get(points[i * 4 + 3] ?? -1) ?? OTHER);
    return;
  }
  for (const object of painted.objects) {
    const colour = by === "class" ? (object.colour as unknown as Rgb) : instanceColour(object.track_id);
    eachInside(points, object, (i) => set(colours, i, colour));
  }
}

function set(colours: Float32Array, i: number, [r, g, b]: Rgb): void {
  colours[i * 3] = r / 255;
  colours[i * 3 + 1] = g / 255;
  colours[i * 3 + 2] = b / 255;
}

/** Neighbouring ids get colours far from each other: steps of the golden angle. */
export function instanceColour(track: number): Rgb {
  const hue = (track * 137.508) % 360;
  const channel = (offset: number): number => {
    const at = (offset + hue / 30) % 12;
    return Math.round(255 * (0.6 - 0.4 * Math.max(-1, Math.min(at - 3, 9 - at, 1))));
  };
  return [channel(0), channel(8), channel(4)];
}

/** Boxes end where the object does; rays end a little beside. */
const MARGIN_M = 0.1;

/** Calls with the number of each point in an object's box. */
export function eachInside(points: Float32Array, object: FrameObject, call: (i: number) => void): void {
  const m = object.ego_from_box;
  const [cx = 0, cy = 0, cz = 0] = [m[0]?.[3], m[1]?.[3], m[2]?.[3]];
  const [ex = 0, ey = 0, ez = 0] = object.extent;
  const radius = Math.hypot(ex, ey, ez) + MARGIN_M;
  const axis = (c: number): Rgb => [m[0]?.[c] ?? 0, m[1]?.[c] ?? 0, m[2]?.[c] ?? 0];
  const [ax, ay, az] = [axis(0), axis(1), axis(2)];
  const inside = (a: Rgb, dx: number, dy: number, dz: number, extent: number): boolean =>
    Math.abs(a[0] * dx + a[1] * dy + a[2] * dz) <= extent + MARGIN_M;
  for (let i = 0; i * 4 < points.length; i += 1) {
    const dx = (points[i * 4] ?? 0) - cx;
    if (dx > radius || dx < -radius) continue;
    const dy = (points[i * 4 + 1] ?? 0) - cy;
    if (dy > radius || dy < -radius) continue;
    const dz = (points[i * 4 + 2] ?? 0) - cz;
    if (inside(ax, dx, dy, dz, ex) && inside(ay, dx, dy, dz, ey) && inside(az, dx, dy, dz, ez)) call(i);
  }
}
