import type { SchemaMessage } from "../api/types";
import { edit } from "../state/draft";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";
import type { CoverageChoice } from "./CoverageLayer";
import { colourOf, KINDS, kindInfo, MODALITIES, type Modality } from "./kinds";
import { withSensor } from "./sensors";
import { useRig } from "./useRig";

interface Props {
  schema: SchemaMessage;
  coverage: CoverageChoice;
  onCoverage(choice: CoverageChoice): void;
  onTrueRanges(): void;
  onPreset(name: string): void;
}

const QUICK = ["rgb", "lidar", "radar"];
const QUICK_NAMES: Record<string, string> = { rgb: "Camera", lidar: "LiDAR", radar: "Radar" };

/** Presets, new sensors, changes of what is chosen, and how fields of view are drawn. */
export function RigToolbar({ schema, coverage, onCoverage, onTrueRanges, onPreset }: Props) {
  const rig = useRig();
  const add = (kind: string) => {
    const roof = rig.mounts[0]?.pose ?? { x: 0, y: 0, z: 1.8, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
    const bumper = rig.mounts.find(({ name }) => name === "Front bumper")?.pose ?? roof;
    const front = rig.mounts.find(({ name }) => name === "Roof, front")?.pose ?? roof;
    const { modality } = kindInfo(kind);
    const pose = modality === "radar" ? bumper : modality === "lidar" ? roof : modality === "inertial" ? { ...roof, x: 0, z: 0 } : front;
    let id = "";
    edit((now) => {
      const [next, made] = withSensor(now, kind, pose);
      id = made;
      return next;
    });
    rig.select([id]);
  };
  return (
    <header className="panel-head toolbar">
      <h2>Sensor rig</h2>
      <label className="inline-label">
        <span className="sr-only">Rig preset</span>
        <select
          className="input compact"
          aria-label="Rig preset"
          value=""
          onChange={(event) => event.target.value && onPreset(event.target.value)}
        >
          <option value="">Preset…</option>
          {schema.rig_presets.map(({ name, title }) => (
            <option key={name} value={name} title={title}>
              {presetName(name)}
            </option>
          ))}
        </select>
      </label>
      <div className="button-row" role="group" aria-label="Add a sensor">
        {QUICK.map((kind) => (
          <button
            key={kind}
            type="button"
            className="button small add"
            style={{ "--colour": colourOf(kind) } as React.CSSProperties}
            onClick={() => add(kind)}
          >
            <Icon name="plus" />
            {QUICK_NAMES[kind]}
          </button>
        ))}
        <Menu label="More" name="other kinds of sensor">
          {Object.entries(KINDS)
            .filter(([kind]) => !QUICK.includes(kind))
            .map(([kind, { label }]) => (
              <button key={kind} type="button" role="menuitem" onClick={() => add(kind)}>
                <span className="dot" style={{ "--colour": colourOf(kind) } as React.CSSProperties} />
                {label}
              </button>
            ))}
        </Menu>
      </div>
      <span className="spacer" />
      <label className="inline-label">
        <span className="sr-only">Coverage of the ground</span>
        <select
          className="input compact"
          aria-label="Coverage of the ground"
          title="How many sensors see each place of the ground"
          value={coverage}
          onChange={(event) => onCoverage(event.target.value as CoverageChoice)}
        >
          <option value="off">Coverage</option>
          <option value="all">All sensors</option>
          {(Object.keys(MODALITIES) as Modality[])
            .filter((one) => one !== "inertial" && one !== "truth")
            .map((one) => (
              <option key={one} value={one}>
                {MODALITIES[one]}
              </option>
            ))}
        </select>
      </label>
      <button
        type="button"
        className="button small"
        aria-pressed={rig.trueRanges}
        title="Draw fields of view as far as they reach"
        onClick={onTrueRanges}
      >
        True ranges
      </button>
    </header>
  );
}

function presetName(name: string): string {
  const known: Record<string, string> = { kitti: "KITTI", nuscenes: "nuScenes", waymo: "Waymo-like", paper: "Paper", demo: "Demo" };
  return known[name] ?? name;
}
