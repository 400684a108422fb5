import { useMemo } from "react";
import { useField, useForm } from "../form/context";
import { Control } from "../form/Control";
import { FieldFrame } from "../form/FieldFrame";
import { NumberInput } from "../form/NumberInput";
import { fieldOf, type Field, type SchemaNode } from "../form/schema";
import { ChosenTools } from "./ChosenTools";
import { colourOf, looks, titleOf } from "./kinds";
import { pathText, type Path } from "../state/json";
import type { Pose } from "./coordinates";
import { SensorPreview } from "./SensorPreview";
import type { RigSensor } from "./sensors";
import { useRig } from "./useRig";

const AXES: { key: keyof Pose; title: string; unit: string; step: number; help: string }[] = [
  { key: "x", title: "x", unit: "m", step: 0.05, help: "Forward from the vehicle's origin." },
  { key: "y", title: "y", unit: "m", step: 0.05, help: "To the right of the vehicle's origin." },
  { key: "z", title: "z", unit: "m", step: 0.05, help: "Above the ground." },
  { key: "roll_deg", title: "Roll", unit: "°", step: 1, help: "Positive: right side down." },
  { key: "pitch_deg", title: "Pitch", unit: "°", step: 1, help: "Positive: up." },
  { key: "yaw_deg", title: "Yaw", unit: "°", step: 1, help: "Positive: to the right." },
];
const USUAL = [
  "image_size", "fov_deg", "channels", "range_m", "points_per_second", "upper_fov_deg", "lower_fov_deg",
  "horizontal_fov_deg", "vertical_fov_deg",
];

/** Numbers and attributes of what is chosen. */
export function Inspector({ schema }: { schema: SchemaNode }) {
  const rig = useRig();
  const chosen = rig.sensors.filter((sensor) => rig.selected.includes(sensor.key));
  const [lead] = chosen;
  if (!lead)
    return (
      <p className="empty">
        Choose a sensor in the list or in a view. Drag to move it; arrow keys nudge by 5 cm, with Shift by 1 cm; [ and ]
        turn it.
      </p>
    );
  return (
    <div className="inspector" key={chosen.length > 1 ? "several" : lead.index}>
      <header className="inspector-head" style={{ "--colour": colourOf(lead.kind) } as React.CSSProperties}>
        <span className="dot" />
        <strong>{chosen.length > 1 ? `${chosen.length} sensors` : lead.id}</strong>
        <span className="muted">{chosen.length > 1 ? chosen.map((one) => one.id).join(", ") : titleOf(lead.kind)}</span>
        <span className="spacer" />
        <ChosenTools />
      </header>
      {chosen.length === 1 && looks(lead.kind) && <SensorPreview sensor={lead} />}
      <PoseFields chosen={chosen} lead={lead} />
      {chosen.length === 1 && lead.index !== null && (
        <OwnFields schema={schema} sensor={lead} index={lead.index} />
      )}
    </div>
  );
}

function PoseFields({ chosen, lead }: { chosen: readonly RigSensor[]; lead: RigSensor }) {
  const rig = useRig();
  const { problems, change } = useForm();
  return (
    <div className="pose-grid">
      <p className="axes-note">x forward, y right, z up; from the vehicle's centre on the ground</p>
      {AXES.map(({ key, title, unit, step, help }) => {
        const path = ["rig", "sensors", lead.index ?? -1, "pose", key];
        const wrong = problems.filter((problem) => pathText(problem.path) === pathText(path));
        return (
          <FieldFrame key={key} id={`pose-${key}`} title={title} unit={unit} description={help} problems={wrong}>
            <NumberInput
              id={`pose-${key}`}
              value={Math.round(lead.pose[key] * 1e4) / 1e4}
              step={step}
              wrong={wrong.length > 0}
              onChange={(next) => {
                if (typeof next === "string" && lead.index !== null) return change(path, next, `pose-${key}`);
                const by = (typeof next === "number" ? next : 0) - lead.pose[key];
                rig.pose(chosen.map((one) => one.key), (pose) => ({ ...pose, [key]: pose[key] + by }), `pose-${key}`);
              }}
              onDone={rig.endGesture}
            />
          </FieldFrame>
        );
      })}
      <MountMenu chosen={chosen} />
    </div>
  );
}

/** Usual places: bumper, roof, mirrors; out of this vehicle's outline. */
function MountMenu({ chosen }: { chosen: readonly RigSensor[] }) {
  const rig = useRig();
  if (rig.mounts.length === 0) return null;
  return (
    <div className="mount-menu">
      <label className="field-title" htmlFor="mount-point">
        Mount point
      </label>
      <select
        id="mount-point"
        className="input"
        value=""
        onChange={(event) => {
          const mount = rig.mounts.find(({ name }) => name === event.target.value);
          if (mount) rig.pose(chosen.map((one) => one.key), () => ({ ...mount.pose }));
        }}
      >
        <option value="">move to…</option>
        {rig.mounts.map(({ name }) => (
          <option key={name}>{name}</option>
        ))}
      </select>
    </div>
  );
}

function OwnFields({ schema, sensor, index }: { schema: SchemaNode; sensor: RigSensor; index: number }) {
  const field = useMemo(() => sensorField(schema, sensor.kind), [schema, sensor.kind]);
  if (!field?.properties) return null;
  const path = ["rig", "sensors", index];
  const { id, attributes, kind: _kind, pose: _pose, ...others } = field.properties;
  const own = Object.entries(attributes?.properties ?? {});
  const usual = own.filter(([key]) => USUAL.includes(key));
  const rare = own.filter(([key]) => !USUAL.includes(key));
  return (
    <div className="fields">
      {id && <SensorName sensor={sensor} path={[...path, "id"]} field={{ ...id, title: "Name" }} />}
      {usual.map(([key, one]) => (
        <Control key={key} path={[...path, "attributes", key]} field={one} />
      ))}
      <details className="subsection">
        <summary>More</summary>
        <div className="fields">
          {Object.entries(others).map(([key, one]) => (
            <Control key={key} path={[...path, key]} field={one} />
          ))}
          {rare.map(([key, one]) => (
            <Control key={key} path={[...path, "attributes", key]} field={one} />
          ))}
        </div>
      </details>
    </div>
  );
}

/** The name; one that another sensor has is refused here, not only where the whole list is checked. */
function SensorName({ sensor, path, field }: { sensor: RigSensor; path: Path; field: Field }) {
  const rig = useRig();
  const { endGesture } = useForm();
  const { value, problems, id, set } = useField(path);
  const other = rig.sensors.find((one) => one.key !== sensor.key && one.id.toLowerCase() === sensor.id.toLowerCase());
  const used = { path, message: `This name is used by ${other?.id} (${titleOf(other?.kind ?? "")}).`, hint: "Choose another one." };
  const shown = other ? [used] : problems;
  return (
    <FieldFrame id={id} {...field} problems={shown}>
      <input
        id={id}
        className="input"
        value={typeof value === "string" ? value : ""}
        spellCheck={false}
        autoComplete="off"
        aria-invalid={shown.length > 0 || undefined}
        onChange={({ target }) => set(target.value, "sensor-name")}
        onBlur={endGesture}
      />
    </FieldFrame>
  );
}

/** The schema of one kind of sensor. */
export function sensorField(schema: SchemaNode, kind: string): Field | null {
  const rig = schema.$defs?.Rig?.properties?.sensors?.items;
  const ref = rig?.discriminator?.mapping[kind];
  return ref ? fieldOf(schema, { $ref: ref }) : null;
}
