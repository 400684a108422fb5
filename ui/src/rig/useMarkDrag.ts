import { useEffect, useRef, useState, type PointerEvent as ReactPointerEvent } from "react";
import { snap, wrapDegrees, type Pose } from "./coordinates";
import type { Point } from "./outline";
import { toScreen, type Plane, type Screen } from "./plane";
import { nextSelection, type Stack } from "./stacks";
import { useRig, type Rig } from "./useRig";

const STEP_M = 0.05;
const FREE_M = 0.001;
const STEP_DEG = 5;
const FREE_DEG = 0.1;
const MOUNT_PX = 9;
const DEAD_PX = 3;

interface Drag {
  turn: boolean;
  start: Point;
  /** Middle of the mark on the page: what the handle turns about. */
  center: Point;
  lead: string;
  poses: Map<string, Pose>;
  moved: boolean;
  gesture: string;
  /** Called when the pointer did not move: it was a click on what was chosen already. */
  click(): void;
}

let gestures = 0;

/**
 * Dragging marks of one view. The view holds it and listens on the window, since a mark may become
 * another element on the way: a sensor that leaves its stack becomes a separate mark.
 */
export function useMarkDrag(plane: Plane, screen: Screen) {
  const rig = useRig();
  const [dragging, setDragging] = useState(false);
  const drag = useRef<Drag | null>(null);
  const now = useRef({ rig, screen });
  now.current = { rig, screen };

  useEffect(() => {
    if (!dragging) return;
    const move = (event: PointerEvent) => {
      const held = drag.current;
      if (!held) return;
      const by: Point = [event.clientX - held.start[0], event.clientY - held.start[1]];
      if (!held.moved && Math.hypot(...by) < DEAD_PX) return;
      held.moved = true;
      if (held.turn) turn(now.current.rig, plane, held, event);
      else shift(now.current.rig, plane, now.current.screen, held, by, event.shiftKey);
    };
    const end = () => {
      const held = drag.current;
      drag.current = null;
      setDragging(false);
      now.current.rig.endGesture();
      if (held && !held.moved) held.click();
    };
    window.addEventListener("pointermove", move);
    window.addEventListener("pointerup", end);
    window.addEventListener("pointercancel", end);
    return () => {
      window.removeEventListener("pointermove", move);
      window.removeEventListener("pointerup", end);
      window.removeEventListener("pointercancel", end);
    };
  }, [dragging, plane]);

  const begin = (event: ReactPointerEvent<SVGElement>, stack: Stack, turn: boolean) => {
    if (event.button !== 0) return;
    event.stopPropagation();
    const ids = stack.sensors.map((sensor) => sensor.key);
    const known = ids.some((id) => rig.selected.includes(id));
    const moving = known ? [...rig.selected] : nextSelection(stack, rig.selected);
    if (!known) rig.select(event.shiftKey ? [...rig.selected, ...moving] : moving);
    const sensors = rig.sensors.filter((sensor) => moving.includes(sensor.key));
    const box = event.currentTarget.ownerSVGElement?.getBoundingClientRect();
    const at = toScreen(screen, plane.flat([stack.pose.x, stack.pose.y, stack.pose.z]));
    gestures += 1;
    drag.current = {
      turn,
      start: [event.clientX, event.clientY],
      center: [at[0] + (box?.left ?? 0), at[1] + (box?.top ?? 0)],
      lead: ids.find((id) => moving.includes(id)) ?? moving[0] ?? "",
      poses: new Map(sensors.map((sensor) => [sensor.key, sensor.pose])),
      moved: false,
      gesture: `drag-${gestures}`,
      click: () => {
        if (known && !event.shiftKey) rig.select(nextSelection(stack, rig.selected));
      },
    };
    setDragging(true);
  };
  return { begin, dragging };
}

function turn(rig: Rig, plane: Plane, held: Drag, event: PointerEvent): void {
  const lead = held.poses.get(held.lead);
  if (!lead) return;
  const [dx, dy] = [event.clientX - held.center[0], event.clientY - held.center[1]];
  const goal = plane.turned(lead, (Math.atan2(-dy, dx) * 180) / Math.PI);
  const step = event.shiftKey ? FREE_DEG : STEP_DEG;
  const yaw = wrapDegrees(snap(wrapDegrees(goal.yaw_deg), step) - lead.yaw_deg);
  const pitch = snap(goal.pitch_deg, step) - lead.pitch_deg;
  rig.pose(
    [...held.poses.keys()],
    (pose, id) => {
      const was = held.poses.get(id) ?? pose;
      return plane.name === "top"
        ? { ...was, yaw_deg: was.yaw_deg + yaw }
        : { ...was, pitch_deg: was.pitch_deg + pitch };
    },
    held.gesture,
  );
}

function shift(rig: Rig, plane: Plane, screen: Screen, held: Drag, by: Point, free: boolean): void {
  const lead = held.poses.get(held.lead);
  if (!lead) return;
  const there = plane.moved(lead, [by[0] / screen.scale, -by[1] / screen.scale]);
  const goal = (free ? null : mountNear(rig, plane, screen, there)) ?? snapped(there, lead, free ? FREE_M : STEP_M);
  const delta = { x: goal.x - lead.x, y: goal.y - lead.y, z: goal.z - lead.z };
  rig.pose(
    [...held.poses.keys()],
    (pose, id) => {
      const was = held.poses.get(id) ?? pose;
      return { ...was, x: was.x + delta.x, y: was.y + delta.y, z: was.z + delta.z };
    },
    held.gesture,
  );
}

/** A usual place under the pointer; only what the view shows of it is taken. */
function mountNear(rig: Rig, plane: Plane, screen: Screen, free: Pose): Pose | null {
  const here = toScreen(screen, plane.flat([free.x, free.y, free.z]));
  for (const { pose } of rig.mounts) {
    const there = toScreen(screen, plane.flat([pose.x, pose.y, pose.z]));
    if (Math.hypot(here[0] - there[0], here[1] - there[1]) < MOUNT_PX)
      return plane.name === "top" ? { ...free, x: pose.x, y: pose.y } : { ...free, x: pose.x, z: pose.z };
  }
  return null;
}

/** Only what the drag has changed is snapped. */
function snapped(goal: Pose, from: Pose, step: number): Pose {
  const one = (axis: "x" | "y" | "z") => (goal[axis] === from[axis] ? from[axis] : snap(goal[axis], step));
  return { ...goal, x: one("x"), y: one("y"), z: one("z") };
}
