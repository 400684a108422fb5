import { useState, type PointerEvent } from "react";
import type { Point } from "./outline";
import { toScreen, type Plane, type Screen } from "./plane";
import { colourOf } from "./kinds";
import { placedAt, type Placed } from "./placing";
import { useRig } from "./useRig";

/** While a kind is armed: shows where a press would put it, and puts it there. */
export function Ghost({ plane, screen, kind }: { plane: Plane; screen: Screen; kind: string }) {
  const rig = useRig();
  const [placed, setPlaced] = useState<Placed | null>(null);
  const at = (event: PointerEvent<SVGElement>): Placed => {
    const box = event.currentTarget.getBoundingClientRect();
    const place: Point = [event.clientX - box.left, event.clientY - box.top];
    return placedAt(rig.shape, rig.mounts, plane, screen, place, event.altKey);
  };
  const [x, y] = placed ? toScreen(screen, plane.flat([placed.pose.x, placed.pose.y, placed.pose.z])) : [0, 0];
  return (
    <g className="placing" style={{ "--colour": colourOf(kind) } as React.CSSProperties}>
      {rig.mounts.map(({ name, pose }) => {
        const [mx, my] = toScreen(screen, plane.flat([pose.x, pose.y, pose.z]));
        return <circle key={name} className="mount-place" cx={mx} cy={my} r={4} />;
      })}
      {placed && (
        <g className="ghost" data-mount={placed.mount ?? ""}>
          <circle cx={x} cy={y} r={8} />
          <text x={x + 12} y={y - 8}>
            {placed.mount ?? `x ${placed.pose.x.toFixed(2)}, y ${placed.pose.y.toFixed(2)}, z ${placed.pose.z.toFixed(2)} m`}
          </text>
        </g>
      )}
      <rect
        className="placing-ground"
        width="100%"
        height="100%"
        onPointerMove={(event) => setPlaced(at(event))}
        onPointerLeave={() => setPlaced(null)}
        onPointerUp={(event) => {
          if (event.button === 0) rig.placeArmed(at(event).pose, event.shiftKey);
        }}
      />
    </g>
  );
}
