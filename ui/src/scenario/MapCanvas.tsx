import { useMemo, useRef, useState, type KeyboardEvent, type PointerEvent } from "react";
import type { TownMap } from "../api/types";
import type { Point } from "../rig/outline";
import { fromScreen, type Screen } from "../rig/plane";
import { usePlaneCamera } from "../rig/usePlaneCamera";
import { Icon } from "../ui/Icon";
import { lanePaths } from "../ui/lanes";
import { useSize } from "../ui/useSize";
import type { Start, Stop } from "./scenario";
import { nearestSpawn, neighbour, placeOnRoad, type Place } from "./townMap";

interface Props {
  town: TownMap | null;
  note: string;
  start: Start;
  stops: readonly Stop[];
  /** Circles around the start within which others begin. */
  circles: readonly { label: string; radius: number }[];
  /** What a press means; null: nothing can be chosen. */
  tool: "start" | "route" | null;
  onPick(place: number | Place): void;
  /** What is to be told: where the cursor is, or that there is no road. */
  onTell(text: string): void;
}

/** Pixels per metre: a town of kilometres fits, and a car fills the view at most. */
const SCALES = { fitted: 0.02, least: 0.02, most: 60 };
const CLOSE_PX = 14;
const DRAG_PX = 4;
const STEPS: Record<string, readonly [number, number]> = {
  ArrowLeft: [-1, 0],
  ArrowRight: [1, 0],
  ArrowUp: [0, -1],
  ArrowDown: [0, 1],
};

/** The town from above, x to the right, y down: press on a spawn point or a road, or walk by keys. */
export function MapCanvas({ town, note, start, stops, circles, tool, onPick, onTell }: Props) {
  const [ref, size] = useSize<SVGSVGElement>();
  const [low, high] = useMemo(() => bounds(town), [town]);
  const { screen, ground, zoom, show, reset } = usePlaneCamera(ref, size, low, high, SCALES);
  const lanes = useMemo(() => lanePaths(town?.lanes ?? [], town?.lane_widths_m ?? []), [town]);
  const points = useMemo(() => town?.spawn_points ?? [], [town]);
  const [cursor, setCursor] = useState<number | null>(null);
  const pressed = useRef<Point | null>(null);
  const here = cursor !== null && cursor < points.length ? cursor : null;

  const press = (event: PointerEvent<SVGElement>) => {
    const from = pressed.current;
    pressed.current = null;
    if (!town || tool === null || !from || Math.hypot(event.clientX - from[0], event.clientY - from[1]) > DRAG_PX) return;
    const box = event.currentTarget.getBoundingClientRect();
    const [u, v] = fromScreen(screen, [event.clientX - box.left, event.clientY - box.top]);
    const spawn = nearestSpawn(points, u, -v, CLOSE_PX / screen.scale);
    const place = spawn ?? placeOnRoad(town, u, -v);
    if (place === null) onTell("No road is there.");
    else onPick(place);
    if (spawn !== null) setCursor(spawn);
  };
  const keys = (event: KeyboardEvent) => {
    const step = STEPS[event.key];
    if (step && points.length > 0) {
      const next = here === null ? (typeof start === "number" ? start : middle(points, screen)) : neighbour(points, here, step);
      const [x = 0, y = 0] = points[next] ?? [];
      setCursor(next);
      show([x, -y]);
      onTell(`Spawn point ${next} at ${x}, ${y}.`);
    } else if (event.key === "Enter" && here !== null && tool !== null) onPick(here);
    else if (event.key === "+" || event.key === "=") zoom(1.25);
    else if (event.key === "-") zoom(0.8);
    else if (event.key === "0") reset();
    else return;
    event.preventDefault();
  };
  const metres = 1 / screen.scale;
  const inMetres = `translate(${screen.width / 2 - screen.center[0] * screen.scale} ${screen.height / 2 + screen.center[1] * screen.scale}) scale(${screen.scale})`;
  const begin = placeOf(start, points);
  const way = [begin, ...stops.map((stop) => placeOf(stop, points))].filter((one) => one !== null);
  return (
    <section className="view town-map" aria-label="Map">
      <header className="view-head">
        <h3>{town?.map ?? "Map"}</h3>
        <span className="muted">x → right, y ↓ down</span>
        <span className="spacer" />
        <button type="button" className="icon-button" aria-label="Zoom in, map" onClick={() => zoom(1.25)}>
          <Icon name="plus" />
        </button>
        <button type="button" className="icon-button" aria-label="Zoom out, map" onClick={() => zoom(0.8)}>
          <svg className="icon" width="16" height="16" viewBox="0 0 16 16" aria-hidden="true">
            <path d="M3 8h10" />
          </svg>
        </button>
        <button type="button" className="icon-button" aria-label="Fit, map" title="Fit (0)" onClick={reset}>
          <Icon name="fit" />
        </button>
      </header>
      <div className="view-body">
        {note && <p className="view-note">{note}</p>}
        <div
          className="town-keys"
          role="application"
          tabIndex={0}
          aria-label="Spawn points on the map: arrow keys go from one to the next, Enter takes it"
          onKeyDown={keys}
        >
          <svg ref={ref} className="plan" data-scale={screen.scale.toFixed(4)}>
            <rect
              className="ground"
              width="100%"
              height="100%"
              {...ground}
              onPointerDown={(event) => {
                pressed.current = [event.clientX, event.clientY];
                ground.onPointerDown(event);
              }}
              onPointerUp={(event) => {
                ground.onPointerUp(event);
                press(event);
              }}
            />
            {size.width > 0 && (
              <g className="no-pointer" transform={inMetres}>
                {lanes.map(({ width, path }) => (
                  <path key={width} className="lane" d={path} strokeWidth={width} />
                ))}
                {begin &&
                  circles.map(({ label, radius }) => (
                    <circle key={label} className="within" cx={begin.x} cy={begin.y} r={radius} strokeWidth={metres} data-within={label} />
                  ))}
                <SpawnArrows points={points} metres={metres} />
                {way.length > 1 && (
                  <path className="way" d={`M${way.map(({ x, y }) => `${x},${y}`).join("L")}`} strokeWidth={2 * metres} strokeDasharray={`${7 * metres} ${5 * metres}`} />
                )}
                {stops.map((stop, i) => (
                  <StopMark key={i} place={placeOf(stop, points)} number={i + 1} metres={metres} />
                ))}
                {begin && <StartMark place={begin} metres={metres} />}
                {here !== null && (
                  <circle className="cursor" cx={points[here]?.[0]} cy={points[here]?.[1]} r={11 * metres} strokeWidth={2.5 * metres} data-cursor={here} />
                )}
              </g>
            )}
          </svg>
        </div>
      </div>
    </section>
  );
}

/** All spawn points as one path of arrows, large enough to be seen from afar. */
function SpawnArrows({ points, metres }: { points: readonly (readonly number[])[]; metres: number }) {
  const half = Math.max(2.2, 4.5 * metres);
  const path = points
    .map(([x = 0, y = 0, , yaw = 0]) => {
      const [c, s] = [Math.cos((yaw * Math.PI) / 180) * half, Math.sin((yaw * Math.PI) / 180) * half];
      const corner = (along: number, across: number) =>
        `${(x + along * c - across * s).toFixed(2)},${(y + along * s + across * c).toFixed(2)}`;
      return `M${corner(1, 0)}L${corner(-0.8, 0.6)}L${corner(-0.4, 0)}L${corner(-0.8, -0.6)}Z`;
    })
    .join("");
  return <path className="spawn-points" d={path} strokeWidth={metres} data-count={points.length} />;
}

function StartMark({ place, metres }: { place: { x: number; y: number; yaw?: number }; metres: number }) {
  return (
    <g className="start-mark" data-start transform={`translate(${place.x} ${place.y})`}>
      <circle r={9 * metres} strokeWidth={2 * metres} />
      {place.yaw !== undefined && (
        <path transform={`rotate(${place.yaw}) scale(${metres})`} d="M6,0L-4,4.500L-2,0L-4,-4.500Z" />
      )}
      <text transform={`scale(${metres})`} x={13} y={4}>
        Start
      </text>
    </g>
  );
}

function StopMark({ place, number, metres }: { place: { x: number; y: number } | null; number: number; metres: number }) {
  if (place === null) return null;
  return (
    <g className="stop-mark" data-stop={number} transform={`translate(${place.x} ${place.y}) scale(${metres})`}>
      <circle r={9} />
      <text textAnchor="middle" y={4}>
        {number}
      </text>
    </g>
  );
}

/** Where a start or a stop lies; null: it is drawn, or the map has no such spawn point. */
function placeOf(one: Start | Stop, points: readonly (readonly number[])[]): { x: number; y: number; yaw?: number } | null {
  if (one === "random") return null;
  if (typeof one === "object") return { x: one.x, y: one.y, yaw: "yaw_deg" in one ? one.yaw_deg : undefined };
  const point = points[one];
  return point ? { x: point[0] ?? 0, y: point[1] ?? 0, yaw: point[3] } : null;
}

function bounds(town: TownMap | null): [Point, Point] {
  const points = [...(town?.lanes ?? []).flat(), ...(town?.spawn_points ?? [])];
  if (points.length === 0) return [[-50, -50], [50, 50]];
  let [x0, y0, x1, y1] = [Infinity, Infinity, -Infinity, -Infinity];
  for (const [x = 0, y = 0] of points) {
    [x0, x1] = [Math.min(x0, x), Math.max(x1, x)];
    [y0, y1] = [Math.min(y0, -y), Math.max(y1, -y)];
  }
  return [[x0, y0], [x1, y1]];
}

/** The spawn point that is nearest to the middle of the view. */
function middle(points: readonly (readonly number[])[], screen: Screen): number {
  return nearestSpawn(points, screen.center[0], -screen.center[1], Infinity) ?? 0;
}
