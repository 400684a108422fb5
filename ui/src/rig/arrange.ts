import type { Pose } from "./coordinates";

/** What several sensors can be made to share, or be spread along. */
export type Axis = "x" | "y" | "z";

/** All at the place of the first along an axis. */
export function aligned(poses: ReadonlyMap<string, Pose>, axis: Axis): Map<string, Pose> {
  const [lead] = poses.values();
  return changed(poses, (pose) => ({ ...pose, [axis]: lead?.[axis] ?? pose[axis] }));
}

/** All turned as the first. */
export function turnedAlike(poses: ReadonlyMap<string, Pose>): Map<string, Pose> {
  const [lead] = poses.values();
  if (!lead) return new Map();
  const { roll_deg, pitch_deg, yaw_deg } = lead;
  return changed(poses, (pose) => ({ ...pose, roll_deg, pitch_deg, yaw_deg }));
}

/** At equal distances between the outermost two along an axis, in the order in which they stand. */
export function distributed(poses: ReadonlyMap<string, Pose>, axis: Axis): Map<string, Pose> {
  const ordered = [...poses].sort(([, a], [, b]) => a[axis] - b[axis]);
  const [low, high] = [ordered[0]?.[1][axis] ?? 0, ordered.at(-1)?.[1][axis] ?? 0];
  return new Map(ordered.map(([id, pose], i) => [id, { ...pose, [axis]: low + ((high - low) * i) / Math.max(1, ordered.length - 1) }]));
}

/** Headings at equal angles all around, from that of the first, in the order of their headings. */
export function around(poses: ReadonlyMap<string, Pose>): Map<string, Pose> {
  const [lead] = poses.values();
  const first = lead?.yaw_deg ?? 0;
  const from = (yaw: number) => (((yaw - first) % 360) + 360) % 360;
  const ordered = [...poses].sort(([, a], [, b]) => from(a.yaw_deg) - from(b.yaw_deg));
  return new Map(ordered.map(([id, pose], i) => [id, { ...pose, yaw_deg: first + (360 * i) / ordered.length }]));
}

function changed(poses: ReadonlyMap<string, Pose>, change: (pose: Pose) => Pose): Map<string, Pose> {
  return new Map([...poses].map(([id, pose]) => [id, change(pose)]));
}
