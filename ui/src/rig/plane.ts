import type { Pose, Vector } from "./coordinates";
import type { Point } from "./outline";

/** A plane view of the car: what lies to the right and what lies up on the screen. */
export interface Plane {
  name: "top" | "side";
  title: string;
  axes: string;
  /** From vehicle coordinates to the plane, metres. */
  flat(v: Vector): Point;
  /** How near to the eye. */
  depth(pose: Pose): number;
  /** A pose moved within the plane. */
  moved(pose: Pose, by: Point): Pose;
  /** The angle that the handle turns, and the direction that it points to, degrees. */
  turned(pose: Pose, angle: number): Pose;
  angle(pose: Pose): number;
}

export const TOP: Plane = {
  name: "top",
  title: "Top",
  axes: "x ↑ forward, y → right",
  flat: ([x, y]) => [y, x],
  depth: ({ z }) => z,
  moved: (pose, [u, v]) => ({ ...pose, x: pose.x + v, y: pose.y + u }),
  // On the screen forward is up: yaw grows clockwise from there.
  turned: (pose, angle) => ({ ...pose, yaw_deg: 90 - angle }),
  angle: (pose) => 90 - pose.yaw_deg,
};

export const SIDE: Plane = {
  name: "side",
  title: "Side",
  axes: "x → forward, z ↑ up",
  flat: ([x, , z]) => [x, z],
  depth: ({ y }) => y,
  moved: (pose, [u, v]) => ({ ...pose, x: pose.x + u, z: pose.z + v }),
  turned: (pose, angle) => ({ ...pose, pitch_deg: pitchFrom(angle, facesBack(pose)) }),
  angle: (pose) => (facesBack(pose) ? 180 - pose.pitch_deg : pose.pitch_deg),
};

function facesBack(pose: Pose): boolean {
  return Math.cos((pose.yaw_deg * Math.PI) / 180) < -1e-9;
}

function pitchFrom(angle: number, back: boolean): number {
  const pitch = back ? 180 - angle : angle;
  const turned = ((((pitch + 180) % 360) + 360) % 360) - 180;
  return Math.min(90, Math.max(-90, turned));
}

/** Which part of the plane is on the screen. */
export interface Camera {
  center: Point;
  /** Pixels per metre. */
  scale: number;
}

export interface Screen extends Camera {
  width: number;
  height: number;
}

export function toScreen(screen: Screen, [u, v]: Point): Point {
  return [
    screen.width / 2 + (u - screen.center[0]) * screen.scale,
    screen.height / 2 - (v - screen.center[1]) * screen.scale,
  ];
}

export function fromScreen(screen: Screen, [px, py]: Point): Point {
  return [
    (px - screen.width / 2) / screen.scale + screen.center[0],
    (screen.height / 2 - py) / screen.scale + screen.center[1],
  ];
}

/** The camera that shows a rectangle, with a margin in pixels and so many pixels per metre at least. */
export function fit(low: Point, high: Point, width: number, height: number, least = 0.5, margin = 18): Camera {
  const scale = Math.min(
    (width - 2 * margin) / Math.max(high[0] - low[0], 0.1),
    (height - 2 * margin) / Math.max(high[1] - low[1], 0.1),
  );
  return {
    center: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2],
    scale: Math.max(scale, least),
  };
}

export function pathOf(points: readonly Point[], closed = true): string {
  const text = points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L");
  return text ? `M${text}${closed ? "Z" : ""}` : "";
}
