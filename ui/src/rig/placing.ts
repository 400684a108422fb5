import { snap, type Pose } from "./coordinates";
import { heightAt, type Mount, type VehicleShape } from "./mounts";
import type { Point } from "./outline";
import { toScreen, type Plane, type Screen } from "./plane";

const STEP_M = 0.05;
/** A usual place takes what is pressed so near to it, pixels. */
const MOUNT_PX = 22;
/** A sensor stands on the roof, not in it. */
const FOOT_M = 0.1;

export interface Placed {
  pose: Pose;
  /** The usual place that it was drawn to. */
  mount: string | null;
}

/** Where a press at a place of a view puts a sensor: at a usual place nearby, else on the car's body there. */
export function placedAt(shape: VehicleShape | null, mounts: readonly Mount[], plane: Plane, screen: Screen, at: Point, free: boolean): Placed {
  let best: Mount | null = null;
  let least = free ? 0 : MOUNT_PX;
  for (const mount of mounts) {
    const there = toScreen(screen, plane.flat([mount.pose.x, mount.pose.y, mount.pose.z]));
    const off = Math.hypot(there[0] - at[0], there[1] - at[1]);
    if (off < least) [least, best] = [off, mount];
  }
  if (best) return { pose: best.pose, mount: best.name };
  const u = (at[0] - screen.width / 2) / screen.scale + screen.center[0];
  const v = (screen.height / 2 - at[1]) / screen.scale + screen.center[1];
  const zero: Pose = { x: 0, y: 0, z: 0, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
  if (plane.name === "side") return { pose: { ...zero, x: snap(u, STEP_M), z: Math.max(0, snap(v, STEP_M)) }, mount: null };
  const [x, y] = [snap(v, STEP_M), snap(u, STEP_M)];
  return { pose: { ...zero, x, y, z: bodyHeight(shape, x, y) }, mount: null };
}

/** Above the body where there is one; else as high as a bumper. */
function bodyHeight(shape: VehicleShape | null, x: number, y: number): number {
  if (!shape) return 1.6;
  const { location, extent } = shape.box;
  const onBody = Math.abs(x - location[0]) <= extent[0] && Math.abs(y - location[1]) <= extent[1];
  return onBody ? snap(heightAt(shape.side, x) + FOOT_M, 0.01) : 0.5;
}

/** The usual place that is nearest to a point of the car's surface, within some distance, m. */
export function mountAround(mounts: readonly Mount[], [x, y, z]: readonly [number, number, number], within: number): Mount | null {
  let best: Mount | null = null;
  let least = within;
  for (const mount of mounts) {
    const off = Math.hypot(mount.pose.x - x, mount.pose.y - y, mount.pose.z - z);
    if (off < least) [least, best] = [off, mount];
  }
  return best;
}
