import { memo, useMemo, useRef, type ReactNode } from "react";
import { Icon } from "../ui/Icon";
import { useSize } from "../ui/useSize";
import { CoverageLayer } from "./CoverageLayer";
import { FieldOfView } from "./FieldOfView";
import { pathOf, toScreen, type Plane, type Screen } from "./plane";
import { MarkName, SensorMark } from "./SensorMark";
import { stacksOf } from "./stacks";
import type { Point } from "./outline";
import { Ghost } from "./Ghost";
import { useMarkDrag } from "./useMarkDrag";
import { usePlaneCamera } from "./usePlaneCamera";
import { drawnReach, useRig } from "./useRig";
import type { VehicleShape } from "./mounts";
import type { CoverageChoice } from "./CoverageLayer";

interface Props {
  plane: Plane;
  coverage?: CoverageChoice;
  actions?: ReactNode;
}

/** The rig from above or from the side: drag sensors, turn them, nudge them with the keyboard. */
export function PlanView({ plane, coverage = "off", actions }: Props) {
  const rig = useRig();
  const [ref, size] = useSize<SVGSVGElement>();
  const [low, high] = useMemo(() => bounds(rig, plane, coverage), [rig, plane, coverage]);
  const { screen, ground, zoom, reset } = usePlaneCamera(ref, size, low, high);
  // What is nearer to the eye is drawn last, and so is on top.
  const stacks = useMemo(
    () => stacksOf(rig.sensors).sort((a, b) => plane.depth(a.pose) - plane.depth(b.pose)),
    [rig.sensors, plane],
  );
  const { begin, dragging } = useMarkDrag(plane, screen);
  const focused = useRef<string | null>(null);
  const chosen = new Set(rig.selected);
  const ordered = [...rig.sensors].sort((a, b) => Number(chosen.has(a.key)) - Number(chosen.has(b.key)));
  return (
    <section className={`view view-${plane.name}`} aria-label={`${plane.title} view`}>
      <header className="view-head">
        <h3>{plane.title}</h3>
        <span className="muted">{plane.axes}</span>
        <span className="spacer" />
        <button className="icon-button" aria-label={`Zoom in, ${plane.title}`} onClick={() => zoom(1.25)}>
          <Icon name="plus" />
        </button>
        <button className="icon-button" aria-label={`Zoom out, ${plane.title}`} onClick={() => zoom(0.8)}>
          <svg className="icon" width="16" height="16" viewBox="0 0 16 16" aria-hidden="true">
            <path d="M3 8h10" />
          </svg>
        </button>
        <button className="icon-button" aria-label={`Fit, ${plane.title}`} title="Fit" onClick={reset}>
          <Icon name="fit" />
        </button>
        {actions}
      </header>
      <div className="view-body">
        {plane.name === "top" && coverage !== "off" && <CoverageLayer screen={screen} choice={coverage} />}
        {!rig.shape && <p className="view-note">Loading the car…</p>}
        <svg ref={ref} className="plan" data-scale={screen.scale.toFixed(3)}>
          {size.width > 0 && (
            <>
              <rect className="ground" width="100%" height="100%" {...ground} onClick={() => rig.select([])} />
              <Grid screen={screen} />
              <g className="no-pointer">
                {rig.shape && <Outline shape={rig.shape} plane={plane} screen={screen} />}
                {ordered.map((sensor) => (
                  <FieldOfView
                    key={sensor.key}
                    sensor={sensor}
                    plane={plane}
                    screen={screen}
                    chosen={chosen.has(sensor.key)}
                  />
                ))}
                <Origin screen={screen} />
              </g>
              {stacks.map((stack) => (
                <SensorMark
                  key={stack.sensors[0]?.key}
                  stack={stack}
                  plane={plane}
                  screen={screen}
                  dragging={dragging}
                  focused={focused}
                  onBegin={begin}
                />
              ))}
              {stacks.map((stack) => (
                <MarkName key={stack.sensors[0]?.key} stack={stack} plane={plane} screen={screen} />
              ))}
              {rig.armed !== null && <Ghost plane={plane} screen={screen} kind={rig.armed} />}
              <ScaleBar screen={screen} />
            </>
          )}
        </svg>
      </div>
    </section>
  );
}

function bounds(rig: ReturnType<typeof useRig>, plane: Plane, coverage: CoverageChoice): [Point, Point] {
  if (coverage !== "off" && plane.name === "top") return [[-16, -16], [16, 16]];
  const car = rig.shape?.box ?? { location: [0, 0, 0.75], extent: [2.4, 1, 0.75] };
  const points: Point[] = [];
  for (const s of [-1, 1])
    points.push(
      plane.flat([
        car.location[0] + s * car.extent[0],
        car.location[1] + s * car.extent[1],
        s < 0 ? 0 : 2 * car.extent[2] + 0.4,
      ]),
    );
  let grow = 1.1;
  if (rig.trueRanges)
    for (const sensor of rig.sensors) {
      const view = rig.view(sensor);
      if (view) grow = Math.max(grow, drawnReach(view, true));
    }
  const [u, v] = [points.map((p) => p[0]), points.map((p) => p[1])];
  const up = plane.name === "side" ? Math.min(grow, 1.1) * 0.45 : grow;
  return [
    [Math.min(...u) - grow, Math.min(...v) - up],
    [Math.max(...u) + grow, Math.max(...v) + up],
  ];
}

const Grid = memo(function Grid({ screen }: { screen: Screen }) {
  const step = [1, 5, 10, 50].find((metres) => metres * screen.scale >= 14) ?? 100;
  const half: Point = [screen.width / screen.scale / 2, screen.height / screen.scale / 2];
  const lines: string[] = [];
  for (const axis of [0, 1] as const) {
    const from = Math.ceil((screen.center[axis] - half[axis]) / step);
    const to = Math.floor((screen.center[axis] + half[axis]) / step);
    for (let i = from; i <= to; i += 1) {
      const [x, y] = toScreen(screen, axis === 0 ? [i * step, 0] : [0, i * step]);
      lines.push(axis === 0 ? `M${x.toFixed(1)},0V${screen.height}` : `M0,${y.toFixed(1)}H${screen.width}`);
    }
  }
  return <path className="grid no-pointer" d={lines.join("")} />;
});

function Outline({ shape, plane, screen }: { shape: VehicleShape; plane: Plane; screen: Screen }) {
  const rings = plane.name === "top" ? shape.top.map((ring) => ring.map(([x, y]) => [y, x] as Point)) : shape.side;
  return (
    <g className="car">
      {plane.name === "side" && <line className="road" x1="0" x2={screen.width} y1={toScreen(screen, [0, 0])[1]} y2={toScreen(screen, [0, 0])[1]} />}
      {rings.map((ring, i) => (
        <path key={i} className="car-body" d={pathOf(ring.map((point) => toScreen(screen, point)))} />
      ))}
      <CarDetails shape={shape} plane={plane} screen={screen} />
    </g>
  );
}

/** Windows and wheels, drawn from the mesh, so that front and rear can be told apart. */
function CarDetails({ shape, plane, screen }: { shape: VehicleShape; plane: Plane; screen: Screen }) {
  const glass = useMemo(() => glassTriangles(shape, plane), [shape, plane]);
  const paths = glass.map((triangle) => pathOf(triangle.map((point) => toScreen(screen, point)))).join("");
  return (
    <>
      <path className="car-glass" d={paths} />
      {plane.name === "side" &&
        shape.wheels.slice(0, 4).map(({ location, radius }, i) => {
          const [x, y] = toScreen(screen, [location[0], location[2]]);
          return <circle key={i} className="car-wheel" cx={x} cy={y} r={radius * screen.scale} />;
        })}
    </>
  );
}

function glassTriangles(shape: VehicleShape, plane: Plane): Point[][] {
  const triangles: Point[][] = [];
  for (const { material, corners } of shape.parts) {
    if (material !== "glass") continue;
    for (let i = 0; i + 8 < corners.length; i += 9) {
      const three = [0, 3, 6].map((k) => [corners[i + k] ?? 0, corners[i + k + 1] ?? 0, corners[i + k + 2] ?? 0] as const);
      if (plane.name === "side" && three.some((corner) => corner[1] < 0)) continue;
      triangles.push(three.map((corner) => plane.flat(corner)));
    }
  }
  return triangles;
}

function Origin({ screen }: { screen: Screen }) {
  const [x, y] = toScreen(screen, [0, 0]);
  return (
    <g className="origin">
      <path d={`M${x - 6},${y}H${x + 6}M${x},${y - 6}V${y + 6}`} />
    </g>
  );
}

function ScaleBar({ screen }: { screen: Screen }) {
  const metres = [0.5, 1, 2, 5, 10, 20, 50].find((m) => m * screen.scale >= 46) ?? 100;
  const [x, y] = [12, screen.height - 12];
  return (
    <g className="scale-bar no-pointer">
      <path d={`M${x},${y - 4}V${y}H${x + metres * screen.scale}V${y - 4}`} />
      <text x={x + 5} y={y - 6}>
        {metres} m
      </text>
    </g>
  );
}
