import { lazy, Suspense, useCallback, useEffect, useMemo, useState, type KeyboardEvent } from "react";
import { useAnswer } from "../api/useAnswer";
import type { RigPreset, SchemaMessage } from "../api/types";
import { dispatch, edit } from "../state/draft";
import { getAt, setAt, type JsonObject } from "../state/json";
import type { Pose } from "./coordinates";
import type { CoverageChoice } from "./CoverageLayer";
import { Inspector } from "./Inspector";
import { mountsOf, type VehicleShape } from "./mounts";
import { PlanView } from "./PlanView";
import { SIDE, TOP } from "./plane";
import { RigComparison } from "./RigComparison";
import { RigToolbar } from "./RigToolbar";
import { SensorList } from "./SensorList";
import { SensorLists } from "./SensorLists";
import {
  sensorsOf,
  unfolded,
  viewOf,
  without,
  withSensor,
  withCopies,
  withMirrored,
  withPoses,
  type PresetSensors,
} from "./sensors";
import { RigContext, type Rig } from "./useRig";
import { ViewFrame } from "./ViewFrame";

const View3D = lazy(() => import("./View3D"));
const NONE: PresetSensors = [];

/** Sensors on the car: views, list and numbers of one document, always in step. */
export function RigEditor({ document, schema }: { document: JsonObject; schema: SchemaMessage }) {
  const [selected, setSelected] = useState<readonly string[]>([]);
  const [trueRanges, setTrueRanges] = useState(false);
  const [coverage, setCoverage] = useState<CoverageChoice>("off");
  const [mode, setMode] = useState<"translate" | "rotate">("translate");
  const [armed, setArmed] = useState<string | null>(null);
  const [comparing, setComparing] = useState(false);
  const [large, setLarge] = useState<string | null>(null);

  const named = getAt(document, ["rig", "preset"]);
  const preset = useAnswer<RigPreset>(typeof named === "string" ? `/presets/rig/${named}` : null);
  const presetSensors = (preset.data?.sensors as JsonObject[] | undefined) ?? NONE;
  const blueprint = getAt(document, ["ego", "blueprint"]) ?? "vehicle.tesla.model3";
  const shape = useAnswer<VehicleShape>(`/vehicles/${encodeURIComponent(String(blueprint))}`);

  const sensors = useMemo(() => sensorsOf(document, presetSensors), [document, presetSensors]);
  const mounts = useMemo(() => (shape.data ? mountsOf(shape.data) : []), [shape.data]);
  const change = useCallback(
    (make: (now: JsonObject) => JsonObject, gesture?: string) =>
      edit((now) => make(unfolded(now, presetSensors)), gesture),
    [presetSensors],
  );
  const endGesture = useCallback(() => dispatch({ type: "endGesture" }), []);

  const rig: Rig = useMemo(() => {
    const copied = (make: (now: JsonObject) => [JsonObject, string[]]) => {
      let keys: string[] = [];
      change((now) => {
        const [next, made] = make(now);
        keys = made;
        return next;
      });
      setSelected(keys);
    };
    const add = (kind: string, pose: Pose) =>
      copied((now) => {
        const [next, key] = withSensor(now, kind, pose);
        return [next, [key]];
      });
    return {
      document,
      sensors,
      shape: shape.data,
      mounts,
      selected,
      select: setSelected,
      trueRanges,
      view: (sensor) => viewOf(sensor, document, schema),
      pose: (keys, how, gesture) => change((now) => withPoses(now, keys, how), gesture),
      endGesture,
      add,
      armed,
      arm: setArmed,
      placeArmed: (pose, several) => {
        if (armed === null) return;
        add(armed, pose);
        if (!several) setArmed(null);
      },
      remove: (keys) => {
        change((now) => without(now, keys));
        setSelected([]);
      },
      duplicate: (keys) => copied((now) => withCopies(now, keys)),
      mirror: (keys) => copied((now) => withMirrored(now, keys)),
    };
  }, [document, schema, sensors, shape.data, mounts, selected, trueRanges, armed, change, endGesture]);

  useEffect(() => {
    const known = new Set(sensors.map((sensor) => sensor.key));
    setSelected((now) => (now.every((key) => known.has(key)) ? now : now.filter((key) => known.has(key))));
  }, [sensors]);

  const keys = (event: KeyboardEvent<HTMLElement>) => {
    if ((event.target as HTMLElement).closest("input, select, textarea")) return;
    const command = event.ctrlKey || event.metaKey;
    const key = event.key.toLowerCase();
    if ((key === "delete" || key === "backspace") && selected.length > 0) rig.remove(selected);
    else if (command && key === "d" && selected.length > 0) rig.duplicate(selected);
    else if (key === "escape" && armed !== null) setArmed(null);
    else if (key === "escape") setSelected([]);
    else if (!command && key === "w") setMode("translate");
    else if (!command && key === "e") setMode("rotate");
    else return;
    event.preventDefault();
  };

  const enlarge = (name: string) => ({
    large: large === name,
    toggle: () => setLarge(large === name ? null : name),
  });
  return (
    <RigContext.Provider value={rig}>
      <section className="panel rig" aria-label="Sensor rig" onKeyDown={keys}>
        <RigToolbar
          schema={schema}
          coverage={coverage}
          onCoverage={setCoverage}
          onPreset={(name) =>
            edit((now) => setAt(setAt(now, ["rig", "sensors"], []), ["rig", "preset"], name))
          }
        />
        <div className={`views${large ? ` views-large views-${large}` : ""}`}>
          <PlanView plane={TOP} coverage={coverage} actions={<ViewFrame.Enlarge name="Top" {...enlarge("top")} />} />
          <section className="view view-3d" aria-label="3D view">
            <header className="view-head">
              <h3>3D</h3>
              <span className="spacer" />
              <button
                type="button"
                className="button small"
                aria-pressed={trueRanges}
                title="Draw fields of view as far as they reach, in all views"
                onClick={() => setTrueRanges(!trueRanges)}
              >
                True ranges
              </button>
              <div className="segments small" role="group" aria-label="Gizmo">
                {(["translate", "rotate"] as const).map((one) => (
                  <button
                    key={one}
                    type="button"
                    className="segment"
                    aria-pressed={mode === one}
                    title={one === "translate" ? "Move (W)" : "Rotate (E)"}
                    onClick={() => setMode(one)}
                  >
                    {one === "translate" ? "Move" : "Rotate"}
                  </button>
                ))}
              </div>
              <ViewFrame.Enlarge name="3D" {...enlarge("3d")} />
            </header>
            <div className="view-body">
              {!shape.data && <p className="view-note">{shape.error ?? "Loading the car…"}</p>}
              <Suspense fallback={<p className="empty">Loading the 3D view…</p>}>
                <View3D mode={mode} />
              </Suspense>
            </div>
          </section>
          <PlanView plane={SIDE} actions={<ViewFrame.Enlarge name="Side" {...enlarge("side")} />} />
        </div>
        {comparing && <RigComparison presets={schema.rig_presets} schema={schema} />}
      </section>
      <aside className="panel sensors" aria-label="Sensors and their settings" onKeyDown={keys}>
        <header className="panel-head">
          <h2>Sensors</h2>
          <span className="muted">{sensors.length}</span>
          {typeof named === "string" && <span className="badge">preset {named}</span>}
          <span className="spacer" />
          <button type="button" className="button small" aria-pressed={comparing} title="Another rig beside this one" onClick={() => setComparing(!comparing)}>
            Compare
          </button>
          <SensorLists />
        </header>
        <SensorList />
        <Inspector schema={schema.config_schema} />
      </aside>
    </RigContext.Provider>
  );
}
