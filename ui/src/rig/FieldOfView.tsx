import { colourOf } from "./kinds";
import { fans, groundRings, hull, reach } from "./outline";
import { pathOf, toScreen, type Plane, type Screen } from "./plane";
import type { RigSensor } from "./sensors";
import { drawnReach, useRig } from "./useRig";

interface Props {
  sensor: RigSensor;
  plane: Plane;
  screen: Screen;
  chosen: boolean;
}

/** What a sensor sees, flat: wedge, cone, ring or fan. */
export function FieldOfView({ sensor, plane, screen, chosen }: Props) {
  const rig = useRig();
  const view = sensor.onEgo ? rig.view(sensor) : null;
  if (!view) return null;
  const distance = drawnReach(view, rig.trueRanges);
  const style = { "--colour": colourOf(sensor.kind) } as React.CSSProperties;
  const name = `fov${chosen ? " fov-chosen" : ""}`;
  const flat = (line: Parameters<Plane["flat"]>[0][]) =>
    line.map((point) => toScreen(screen, plane.flat(point)));
  if (view.shape === "sweep") {
    const lines = plane.name === "side" ? fans(sensor, view, distance) : reach(sensor, view, distance);
    const rings = chosen && plane.name === "top" ? groundRings(sensor, view, rig.trueRanges ? 60 : 14) : [];
    return (
      <g className={name} style={style}>
        {lines.map((line, i) => (
          <path key={i} className={view.h >= 360 && plane.name === "top" ? "fov-ring" : "fov-area"} d={pathOf(flat(line))} />
        ))}
        {rings.map((ring, i) => (
          <path key={i} className="fov-scan" d={pathOf(flat(ring), false)} />
        ))}
      </g>
    );
  }
  return (
    <g className={name} style={style}>
      {reach(sensor, view, distance).map((points, i) => (
        <path key={i} className="fov-area" d={pathOf(hull(flat(points)))} />
      ))}
    </g>
  );
}
