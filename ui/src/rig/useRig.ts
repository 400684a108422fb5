import { createContext, useContext } from "react";
import type { JsonObject } from "../state/json";
import type { Pose } from "./coordinates";
import type { Mount, VehicleShape } from "./mounts";
import type { RigSensor, View } from "./sensors";

/** What all parts of the rig editor share. */
export interface Rig {
  document: JsonObject;
  sensors: readonly RigSensor[];
  shape: VehicleShape | null;
  mounts: readonly Mount[];
  /** Keys of the chosen sensors. */
  selected: readonly string[];
  select(keys: readonly string[]): void;
  view(sensor: RigSensor): View | null;
  /** Draw fields of view as far as they reach, not as symbols. */
  trueRanges: boolean;
  /** Move or turn sensors; one gesture is one undo step. */
  pose(keys: readonly string[], change: (pose: Pose, key: string) => Pose, gesture?: string): void;
  endGesture(): void;
  /** Put a sensor of a kind there, and choose it. */
  add(kind: string, pose: Pose): void;
  /** The kind that the next press on the car places; null: presses choose. */
  armed: string | null;
  arm(kind: string | null): void;
  /** Put a sensor of the armed kind there; it stays armed where several are to be placed. */
  placeArmed(pose: Pose, several: boolean): void;
  remove(keys: readonly string[]): void;
  duplicate(keys: readonly string[]): void;
  mirror(keys: readonly string[]): void;
}

export const RigContext = createContext<Rig | null>(null);

export function useRig(): Rig {
  const rig = useContext(RigContext);
  if (!rig) throw new Error("a part of the rig editor stands outside of it");
  return rig;
}

const SYMBOL_M: Record<View["shape"], number> = { pyramid: 2.2, cone: 2.8, sweep: 3.4 };
const MOST_M = 120;

/** How far to draw what a sensor sees, metres. */
export function drawnReach(view: View, trueRanges: boolean): number {
  return trueRanges ? Math.min(view.range, MOST_M) : Math.min(SYMBOL_M[view.shape], view.range);
}
