import { useRef, useState, type KeyboardEvent, type PointerEvent } from "react";
import { snap, wrapDegrees, type Pose } from "./frames";
import { colourOf, kindInfo } from "./kinds";
import { toScreen, type Plane, type Screen } from "./plane";
import type { Point } from "./outline";
import { nextSelection, type Stack } from "./stacks";
import { useRig } from "./useRig";

const STEP_M = 0.05;
const FINE_M = 0.01;
const STEP_DEG = 5;
const MOUNT_PX = 9;
const HANDLE_PX = 44;

interface Props {
  stack: Stack;
  plane: Plane;
  screen: Screen;
}

interface Drag {
  pointer: number;
  turn: boolean;
  start: Point;
  poses: Map<string, Pose>;
  moved: boolean;
  gesture: string;
}

let gestures = 0;

/** The mark of the sensors at one place, with the handle that turns them. */
export function SensorMark({ stack, plane, screen }: Props) {
  const rig = useRig();
  const drag = useRef<Drag | null>(null);
  const [dragging, setDragging] = useState(false);
  const [px, py] = toScreen(screen, plane.flat([stack.pose.x, stack.pose.y, stack.pose.z]));
  const ids = stack.sensors.map((sensor) => sensor.id);
  const chosen = ids.filter((id) => rig.selected.includes(id));
  const lead = stack.sensors.find((sensor) => chosen.includes(sensor.id)) ?? stack.sensors[0];
  if (!lead || !Number.isFinite(px + py)) return null;
  const angle = (plane.angle(lead.pose) * Math.PI) / 180;
  const looks = stack.sensors.some((sensor) => kindInfo(sensor.kind).looks);
  const handle: Point = [px + HANDLE_PX * Math.cos(angle), py - HANDLE_PX * Math.sin(angle)];

  const begin = (event: PointerEvent<SVGElement>, turn: boolean) => {
    if (event.button !== 0) return;
    event.stopPropagation();
    event.currentTarget.setPointerCapture(event.pointerId);
    const moving = chosen.length > 0 ? [...rig.selected] : nextSelection(stack, rig.selected);
    if (chosen.length === 0) rig.select(event.shiftKey ? [...rig.selected, ...moving] : moving);
    const poses = new Map(
      rig.sensors.filter((sensor) => moving.includes(sensor.id)).map((sensor) => [sensor.id, sensor.pose]),
    );
    gestures += 1;
    const start: Point = [event.clientX, event.clientY];
    drag.current = { pointer: event.pointerId, turn, start, poses, moved: false, gesture: `drag-${gestures}` };
    setDragging(true);
  };

  const move = (event: PointerEvent<SVGElement>) => {
    const now = drag.current;
    if (now?.pointer !== event.pointerId) return;
    const by: Point = [event.clientX - now.start[0], event.clientY - now.start[1]];
    if (!now.moved && Math.hypot(...by) < 3) return;
    now.moved = true;
    const moving = [...now.poses.keys()];
    const first = now.poses.get(lead.id) ?? [...now.poses.values()][0];
    if (!first) return;
    if (now.turn) {
      const svg = event.currentTarget.ownerSVGElement?.getBoundingClientRect();
      const [cx, cy] = [px + (svg?.left ?? 0), py + (svg?.top ?? 0)];
      const raw = (Math.atan2(cy - event.clientY, event.clientX - cx) * 180) / Math.PI;
      const turned = plane.turned(first, raw);
      const step = event.shiftKey ? 0.1 : STEP_DEG;
      const by = {
        yaw: wrapDegrees(snap(wrapDegrees(turned.yaw_deg), step) - first.yaw_deg),
        pitch: snap(turned.pitch_deg, step) - first.pitch_deg,
      };
      rig.pose(
        moving,
        (pose, id) => {
          const was = now.poses.get(id) ?? pose;
          return plane.name === "top"
            ? { ...was, yaw_deg: was.yaw_deg + by.yaw }
            : { ...was, pitch_deg: was.pitch_deg + by.pitch };
        },
        now.gesture,
      );
      return;
    }
    const step = event.shiftKey ? 0.001 : STEP_M;
    const free = plane.moved(first, [by[0] / screen.scale, -by[1] / screen.scale]);
    const target = snapped(free, first, plane, step);
    const mount = event.shiftKey ? null : nearMount(free);
    const goal = mount ?? target;
    const delta = { x: goal.x - first.x, y: goal.y - first.y, z: goal.z - first.z };
    rig.pose(
      moving,
      (pose, id) => {
        const was = now.poses.get(id) ?? pose;
        return { ...was, x: was.x + delta.x, y: was.y + delta.y, z: was.z + delta.z };
      },
      now.gesture,
    );
  };

  /** A usual place under the pointer; only what the view shows of it is taken. */
  const nearMount = (free: Pose): Pose | null => {
    const here = toScreen(screen, plane.flat([free.x, free.y, free.z]));
    for (const { pose } of rig.mounts) {
      const there = toScreen(screen, plane.flat([pose.x, pose.y, pose.z]));
      if (Math.hypot(here[0] - there[0], here[1] - there[1]) < MOUNT_PX)
        return plane.name === "top" ? { ...free, x: pose.x, y: pose.y } : { ...free, x: pose.x, z: pose.z };
    }
    return null;
  };

  const end = (event: PointerEvent<SVGElement>) => {
    const now = drag.current;
    if (now?.pointer !== event.pointerId) return;
    drag.current = null;
    setDragging(false);
    rig.endGesture();
    if (!now.moved && chosen.length > 0 && !event.shiftKey) rig.select(nextSelection(stack, rig.selected));
  };

  const key = (event: KeyboardEvent) => {
    const step = event.shiftKey ? FINE_M : STEP_M;
    const moves: Record<string, Point> = {
      ArrowLeft: [-step, 0],
      ArrowRight: [step, 0],
      ArrowUp: [0, step],
      ArrowDown: [0, -step],
    };
    const moving = chosen.length > 0 ? rig.selected : ids;
    const by = moves[event.key];
    if (by) rig.pose(moving, (pose) => rounded(plane.moved(pose, by)), `nudge-${stack.sensors[0]?.id}`);
    else if (event.key === "[" || event.key === "]") {
      const turn = (event.key === "]" ? 1 : -1) * STEP_DEG;
      rig.pose(moving, (pose) =>
        plane.name === "top" ? { ...pose, yaw_deg: pose.yaw_deg + turn } : { ...pose, pitch_deg: pose.pitch_deg - turn },
      );
    } else if (event.key === "Enter" || event.key === " ") rig.select(nextSelection(stack, rig.selected));
    else return;
    event.preventDefault();
    event.stopPropagation();
  };

  const text = ids.length > 1 ? `${lead.id} and ${ids.length - 1} more` : lead.id;
  const { x, y, z } = stack.pose;
  return (
    <g
      className={`mark${chosen.length > 0 ? " mark-chosen" : ""}${dragging ? " mark-dragging" : ""}`}
      style={{ "--colour": colourOf(lead.kind) } as React.CSSProperties}
    >
      {chosen.length > 0 && dragging && <MountDots plane={plane} screen={screen} />}
      {chosen.length > 0 && looks && (
        <>
          <line className="turn-line" x1={px} y1={py} x2={handle[0]} y2={handle[1]} />
          <circle
            className="turn-handle"
            data-handle={lead.id}
            cx={handle[0]}
            cy={handle[1]}
            r={6}
            onPointerDown={(event) => begin(event, true)}
            onPointerMove={move}
            onPointerUp={end}
            onPointerCancel={end}
          />
        </>
      )}
      <g
        role="button"
        tabIndex={0}
        aria-label={`${text}, x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, z ${z.toFixed(2)} m`}
        aria-pressed={chosen.length > 0}
        data-sensor={lead.id}
        onPointerDown={(event) => begin(event, false)}
        onPointerMove={move}
        onPointerUp={end}
        onPointerCancel={end}
        onKeyDown={key}
        onFocus={() => {
          if (chosen.length === 0 && !drag.current) rig.select(ids);
        }}
        onBlur={rig.endGesture}
      >
        <circle className="mark-hit" cx={px} cy={py} r={12} />
        <circle className="mark-dot" cx={px} cy={py} r={chosen.length > 0 ? 8 : 6.5} />
        {ids.length > 1 && (
          <text className="mark-count" x={px} y={py + 3.2}>
            {ids.length}
          </text>
        )}
      </g>
      {chosen.length > 0 && (
        <text className="mark-name" {...beside(px, py, screen)}>
          {text}
        </text>
      )}
    </g>
  );
}

function MountDots({ plane, screen }: { plane: Plane; screen: Screen }) {
  const { mounts } = useRig();
  return (
    <g className="mounts no-pointer">
      {mounts.map(({ name, pose }) => {
        const [x, y] = toScreen(screen, plane.flat([pose.x, pose.y, pose.z]));
        return <circle key={name} cx={x} cy={y} r={3} />;
      })}
    </g>
  );
}

/** Where the name is written: beside the mark, on the side where there is room. */
function beside(px: number, py: number, screen: Screen): { x: number; y: number; textAnchor: "start" | "end" } {
  const right = px < screen.width * 0.6;
  return { x: px + (right ? 13 : -13), y: Math.min(py + 16, screen.height - 6), textAnchor: right ? "start" : "end" };
}

function snapped(free: Pose, first: Pose, plane: Plane, step: number): Pose {
  const goal = { ...free };
  const axes = plane.name === "top" ? (["x", "y"] as const) : (["x", "z"] as const);
  for (const axis of axes) goal[axis] = free[axis] === first[axis] ? first[axis] : snap(free[axis], step);
  return goal;
}

function rounded(pose: Pose): Pose {
  return { ...pose, x: snap(pose.x, 0.001), y: snap(pose.y, 0.001), z: snap(pose.z, 0.001) };
}
