import { listKeys } from "../app/Shortcuts";
import { useForm } from "../form/context";
import { startsWith } from "../state/json";
import { colourOf, titleOf } from "./kinds";
import { useRig } from "./useRig";

/** All sensors by name; click to choose, with Shift or Ctrl several. */
export function SensorList() {
  const rig = useRig();
  const { problems } = useForm();
  if (rig.sensors.length === 0)
    return <p className="empty">No sensors yet. Take a preset, or add a sensor above.</p>;
  return (
    <ul className="sensor-list" aria-label="Sensors" onKeyDown={listKeys}>
      {rig.sensors.map((sensor) => {
        const chosen = rig.selected.includes(sensor.key);
        const wrong =
          sensor.index !== null &&
          problems.some((problem) => startsWith(problem.path, ["rig", "sensors", sensor.index ?? 0]));
        return (
          <li key={sensor.key}>
            <button
              type="button"
              className={`sensor-row${wrong ? " wrong" : ""}`}
              aria-pressed={chosen}
              style={{ "--colour": colourOf(sensor.kind) } as React.CSSProperties}
              onClick={(event) => {
                const several = event.shiftKey || event.ctrlKey || event.metaKey;
                if (!several) rig.select([sensor.key]);
                else if (chosen) rig.select(rig.selected.filter((key) => key !== sensor.key));
                else rig.select([...rig.selected, sensor.key]);
              }}
            >
              <span className="dot" />
              <span className="sensor-id">{sensor.id || "unnamed"}</span>
              <span className="muted sensor-kind">
                {titleOf(sensor.kind)}
                {!sensor.onEgo && ", off the car"}
              </span>
              {wrong && <span className="badge badge-bad">!</span>}
            </button>
          </li>
        );
      })}
    </ul>
  );
}
