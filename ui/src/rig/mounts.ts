import type { Point } from "./outline";
import type { Pose } from "./coordinates";
import { snap } from "./coordinates";
import type { Box } from "./coverage";

/** A vehicle's shape as the server describes it. */
export interface VehicleShape {
  id: string;
  box: Box;
  wheels: { location: [number, number, number]; radius: number }[];
  top: Point[][];
  side: Point[][];
  parts: { material: string; corners: number[] }[];
}

export interface Mount {
  name: string;
  pose: Pose;
}

/** Height of the body at a place along the car, metres; the highest of the side outline. */
export function heightAt(side: readonly Point[][], x: number): number {
  let highest = 0;
  for (const ring of side)
    for (let i = 0; i + 1 < ring.length; i += 1) {
      const [a, b] = [ring[i], ring[i + 1]];
      if (!a || !b || (a[0] - x) * (b[0] - x) > 0) continue;
      const share = a[0] === b[0] ? 0 : (x - a[0]) / (b[0] - a[0]);
      highest = Math.max(highest, a[1] + share * (b[1] - a[1]), a[0] === b[0] ? b[1] : 0);
    }
  return highest;
}

/** Usual places for sensors on a car, out of its outline. */
export function mountsOf(shape: VehicleShape): Mount[] {
  const { location, extent } = shape.box;
  const [front, rear] = [location[0] + extent[0], location[0] - extent[0]];
  const half = extent[1];
  const height = (x: number) => heightAt(shape.side, x);
  const roof = [...Array(41).keys()]
    .map((i) => rear + ((front - rear) * i) / 40)
    .filter((x) => height(x) > 0.94 * (location[2] + extent[2]));
  const [roofRear, roofFront] = [roof[0] ?? location[0] - 0.5, roof.at(-1) ?? location[0] + 0.5];
  const middle = (roofRear + roofFront) / 2;
  const top = height(middle);
  const at = (name: string, x: number, y: number, z: number, yaw_deg = 0): Mount => ({
    name,
    pose: { x: snap(x, 0.01), y: snap(y, 0.01), z: snap(z, 0.01), roll_deg: 0, pitch_deg: 0, yaw_deg },
  });
  return [
    at("Roof, middle", middle, 0, top + 0.3),
    at("Roof, front", roofFront, 0, top + 0.1),
    at("Roof, front left", roofFront, -0.55 * half, top + 0.1, -45),
    at("Roof, front right", roofFront, 0.55 * half, top + 0.1, 45),
    at("Roof, left", middle, -0.6 * half, top + 0.1, -90),
    at("Roof, right", middle, 0.6 * half, top + 0.1, 90),
    at("Roof, rear", roofRear, 0, top + 0.1, 180),
    at("Behind the windscreen", roofFront + 0.25, 0, height(roofFront + 0.25) - 0.08),
    at("Front bumper", front, 0, 0.5),
    at("Front corner, left", front - 0.25, -0.85 * half, 0.55, -45),
    at("Front corner, right", front - 0.25, 0.85 * half, 0.55, 45),
    at("Mirror, left", roofFront + 0.45, -half, 0.66 * top, -110),
    at("Mirror, right", roofFront + 0.45, half, 0.66 * top, 110),
    at("Rear corner, left", rear + 0.2, -0.85 * half, 0.55, -135),
    at("Rear corner, right", rear + 0.2, 0.85 * half, 0.55, 135),
    at("Rear bumper", rear, 0, 0.55, 180),
  ];
}
