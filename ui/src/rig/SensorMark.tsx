import { useEffect, useRef, type KeyboardEvent, type PointerEvent, type RefObject } from "react";
import { snap, type Pose } from "./coordinates";
import { colourOf, looks } from "./kinds";
import type { Point } from "./outline";
import { toScreen, type Plane, type Screen } from "./plane";
import { nextSelection, type Stack } from "./stacks";
import { useRig } from "./useRig";

const STEP_M = 0.05;
const FINE_M = 0.01;
const STEP_DEG = 5;
const HANDLE_PX = 44;

interface Props {
  stack: Stack;
  plane: Plane;
  screen: Screen;
  dragging: boolean;
  /** The sensor that has the keyboard; kept when its mark becomes another element. */
  focused: RefObject<string | null>;
  onBegin(event: PointerEvent<SVGElement>, stack: Stack, turn: boolean): void;
}

/** The mark of the sensors at one place, with the handle that turns them. */
export function SensorMark({ stack, plane, screen, dragging, focused, onBegin }: Props) {
  const rig = useRig();
  const button = useRef<SVGGElement>(null);
  const [px, py] = toScreen(screen, plane.flat([stack.pose.x, stack.pose.y, stack.pose.z]));
  const ids = stack.sensors.map((sensor) => sensor.key);
  const chosen = ids.filter((id) => rig.selected.includes(id));
  const lead = stack.sensors.find((sensor) => chosen.includes(sensor.key)) ?? stack.sensors[0];
  useEffect(() => {
    if (focused.current !== null && lead?.key === focused.current) button.current?.focus();
  }, [focused, lead?.key]);
  if (!lead || !Number.isFinite(px + py)) return null;
  const angle = (plane.angle(lead.pose) * Math.PI) / 180;
  const turns = stack.sensors.some((sensor) => looks(sensor.kind));
  const handle: Point = [px + HANDLE_PX * Math.cos(angle), py - HANDLE_PX * Math.sin(angle)];

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
    if (by) rig.pose(moving, (pose) => rounded(plane.moved(pose, by)), `nudge-${lead.key}`);
    else if (event.key === "[" || event.key === "]") {
      const turn = (event.key === "]" ? 1 : -1) * STEP_DEG;
      rig.pose(moving, (pose) =>
        plane.name === "top" ? { ...pose, yaw_deg: pose.yaw_deg + turn } : { ...pose, pitch_deg: pose.pitch_deg - turn },
      );
    } else if (event.key === "Enter" || event.key === " ") rig.select(nextSelection(stack, rig.selected));
    else return;
    focused.current = lead.key;
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
      {chosen.length > 0 && turns && (
        <>
          <line className="turn-line" x1={px} y1={py} x2={handle[0]} y2={handle[1]} />
          <circle
            className="turn-handle"
            data-handle={lead.id}
            cx={handle[0]}
            cy={handle[1]}
            r={6}
            onPointerDown={(event) => onBegin(event, stack, true)}
          />
        </>
      )}
      <g
        ref={button}
        role="button"
        tabIndex={0}
        aria-label={`${text}, x ${x.toFixed(2)} m, y ${y.toFixed(2)} m, z ${z.toFixed(2)} m`}
        aria-pressed={chosen.length > 0}
        data-sensor={lead.id}
        onPointerDown={(event) => onBegin(event, stack, false)}
        onKeyDown={key}
        onFocus={() => {
          if (chosen.length === 0) rig.select(ids);
        }}
        onBlur={() => {
          focused.current = null;
          rig.endGesture();
        }}
      >
        <circle className="mark-hit" cx={px} cy={py} r={12} />
        <circle className="mark-dot" cx={px} cy={py} r={chosen.length > 0 ? 8 : 6.5} />
      </g>
      {ids.length > 1 && (
        <text className="mark-count" x={px} y={py + 3.2} aria-hidden="true">
          {ids.length}
        </text>
      )}
    </g>
  );
}

/** Whose mark is chosen; drawn after all marks, so that none covers it. */
export function MarkName({ stack, plane, screen }: Pick<Props, "stack" | "plane" | "screen">) {
  const rig = useRig();
  const [px, py] = toScreen(screen, plane.flat([stack.pose.x, stack.pose.y, stack.pose.z]));
  const chosen = stack.sensors.filter((sensor) => rig.selected.includes(sensor.key));
  if (!chosen[0] || !Number.isFinite(px + py)) return null;
  return (
    <text className="mark-name" {...beside(px, py, screen)}>
      {chosen.length > 1 ? `${chosen[0].id} and ${chosen.length - 1} more` : chosen[0].id}
    </text>
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

function rounded(pose: Pose): Pose {
  return { ...pose, x: snap(pose.x, 0.001), y: snap(pose.y, 0.001), z: snap(pose.z, 0.001) };
}
