import type { Pose } from "./coordinates";
import type { RigSensor } from "./sensors";

/** Sensors that stand in one place, such as a camera and its ground truth: one mark for all. */
export interface Stack {
  key: string;
  pose: Pose;
  sensors: RigSensor[];
}

/** Group what coincides, in the order of the rig. Sensors off the car are left out. */
export function stacksOf(sensors: readonly RigSensor[]): Stack[] {
  const stacks = new Map<string, Stack>();
  for (const sensor of sensors) {
    if (!sensor.onEgo) continue;
    const { pose } = sensor;
    const key = [pose.x, pose.y, pose.z].map((value) => value.toFixed(3)).join(",");
    const stack = stacks.get(key);
    if (stack) stack.sensors.push(sensor);
    else stacks.set(key, { key, pose, sensors: [sensor] });
  }
  return [...stacks.values()];
}

/** What a click on a stack selects: all of it first, then its sensors in turn. */
export function nextSelection(stack: Stack, selected: readonly string[]): string[] {
  const ids = stack.sensors.map((sensor) => sensor.key);
  if (ids.length === 1) return ids;
  const here = selected.filter((id) => ids.includes(id));
  if (here.length === 0) return ids;
  if (here.length > 1) return ids.slice(0, 1);
  const next = ids[ids.indexOf(here[0] ?? "") + 1];
  return next === undefined ? ids : [next];
}
