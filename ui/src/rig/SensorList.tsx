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
    <ul className="sensor-list" aria-label="Sensors">
      {rig.sensors.map((sensor) => {
        const chosen = rig.selected.includes(sensor.id);
        const wrong =
          sensor.index !== null &&
          problems.some((problem) => startsWith(problem.path, ["rig", "sensors", sensor.index ?? 0]));
        return (
          <li key={`${sensor.index}-${sensor.id}`}>
            <button
              type="button"
              className="sensor-row"
              aria-pressed={chosen}
              style={{ "--colour": colourOf(sensor.kind) } as React.CSSProperties}
              onClick={(event) => {
                const several = event.shiftKey || event.ctrlKey || event.metaKey;
                if (!several) rig.select([sensor.id]);
                else if (chosen) rig.select(rig.selected.filter((id) => id !== sensor.id));
                else rig.select([...rig.selected, sensor.id]);
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
