import { useMemo, useState } from "react";
import { useAnswer } from "../api/useAnswer";
import type { RigPreset, SchemaMessage } from "../api/types";
import { setAt, type JsonObject } from "../state/json";
import { titleOf } from "./kinds";
import { PlanView } from "./PlanView";
import { TOP } from "./plane";
import { sensorsOf, viewOf, type RigSensor } from "./sensors";
import { RigContext, useRig, type Rig } from "./useRig";

const NOTHING = () => undefined;

/** Another rig beside this one: where its sensors are, and how the two differ in numbers. */
export function RigComparison({ presets, schema }: { presets: SchemaMessage["rig_presets"]; schema: SchemaMessage }) {
  const rig = useRig();
  const [name, setName] = useState(presets[0]?.name ?? "");
  const preset = useAnswer<RigPreset>(name ? `/presets/rig/${name}` : null);
  const other: Rig = useMemo(() => {
    const listed = (preset.data?.sensors ?? []) as JsonObject[];
    const document = setAt(setAt(rig.document, ["rig", "preset"], undefined), ["rig", "sensors"], listed);
    return {
      ...rig,
      document,
      sensors: sensorsOf(document, []),
      selected: [],
      armed: null,
      view: (sensor) => viewOf(sensor, document, schema),
      // It is looked at, not changed.
      select: NOTHING,
      pose: NOTHING,
      endGesture: NOTHING,
      add: NOTHING,
      arm: NOTHING,
      placeArmed: NOTHING,
      remove: NOTHING,
      duplicate: NOTHING,
      mirror: NOTHING,
    };
  }, [preset.data, rig, schema]);
  const rows = useMemo(() => differences(rig, other), [rig, other]);
  return (
    <section className="rig-comparison" aria-label="Comparison of rigs">
      <header className="view-head">
        <h3>Beside</h3>
        <select className="input compact" aria-label="Rig to compare with" value={name} onChange={(event) => setName(event.target.value)}>
          {presets.map(({ name: one, title }) => (
            <option key={one} value={one} title={title}>
              {title}
            </option>
          ))}
        </select>
        {preset.error && <span className="field-error">{preset.error}</span>}
      </header>
      <div className="rig-comparison-body">
        <RigContext.Provider value={other}>
          <PlanView plane={{ ...TOP, title: "Other rig, top" }} />
        </RigContext.Provider>
        <div className="table-scroll" tabIndex={0} role="region" aria-label="Differences of the rigs">
          <table>
            <thead>
              <tr>
                <th>What</th>
                <th className="number">This rig</th>
                <th className="number">{name}</th>
              </tr>
            </thead>
            <tbody>
              {rows.map(([what, own, its]) => (
                <tr key={what} className={own === its ? undefined : "differs"}>
                  <td>{what}</td>
                  <td className="number">{own}</td>
                  <td className="number">{its}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      </div>
    </section>
  );
}

function differences(own: Rig, other: Rig): [string, string, string][] {
  const kinds = [...new Set([...own.sensors, ...other.sensors].map((sensor) => sensor.kind))];
  const number = (rig: Rig, kind: string) => String(rig.sensors.filter((sensor) => sensor.kind === kind).length);
  return [
    ["Sensors", String(own.sensors.length), String(other.sensors.length)],
    ...kinds.map((kind): [string, string, string] => [titleOf(kind), number(own, kind), number(other, kind)]),
    ["Seen by cameras, all around", `${around(own, "pyramid")}°`, `${around(other, "pyramid")}°`],
    ["By two cameras at once", `${around(own, "pyramid", 2)}°`, `${around(other, "pyramid", 2)}°`],
    ["Swept by LiDARs, all around", `${around(own, "sweep")}°`, `${around(other, "sweep")}°`],
    ["Highest sensor", `${highest(own).toFixed(2)} m`, `${highest(other).toFixed(2)} m`],
  ];
}

/** How many of the 360 directions from the car at least so many sensors of a shape look into. */
function around(rig: Rig, shape: "pyramid" | "sweep", least = 1): number {
  const views = rig.sensors.filter((sensor) => sensor.onEgo).flatMap((sensor): [RigSensor, number][] => {
    const view = rig.view(sensor);
    return view?.shape === shape ? [[sensor, view.h]] : [];
  });
  // Depth and tags of a camera's own place see nothing more than it does.
  const places = new Map(views.map(([sensor, h]) => [`${sensor.pose.x} ${sensor.pose.y} ${sensor.pose.yaw_deg} ${h}`, [sensor, h] as const]));
  let seen = 0;
  for (let degree = 0; degree < 360; degree += 1) {
    let count = 0;
    for (const [sensor, h] of places.values()) {
      const off = Math.abs(((((degree - sensor.pose.yaw_deg) % 360) + 540) % 360) - 180);
      if (off <= h / 2) count += 1;
    }
    if (count >= least) seen += 1;
  }
  return seen;
}

function highest(rig: Rig): number {
  return Math.max(0, ...rig.sensors.map((sensor) => sensor.pose.z));
}
