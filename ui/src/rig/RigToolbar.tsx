import { useState } from "react";
import type { SchemaMessage, SensorKind } from "../api/types";
import { EditorChoice } from "../scenario/EditorChoice";
import { useStore } from "../state/store";
import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";
import type { CoverageChoice } from "./CoverageLayer";
import { colourOf, commonKinds, kindTable, measuring } from "./kinds";
import { useRig } from "./useRig";

interface Props {
  schema: SchemaMessage;
  coverage: CoverageChoice;
  onCoverage(choice: CoverageChoice): void;
  onPreset(name: string): void;
}

/** Presets, new sensors, changes of what is chosen, and how fields of view are drawn. */
export function RigToolbar({ schema, coverage, onCoverage, onPreset }: Props) {
  const rig = useRig();
  const { kinds, modalities } = useStore(kindTable, (now) => now);
  const common = commonKinds();
  const others = [...(kinds?.values() ?? [])].filter((kind) => !common.includes(kind));
  const [byClick, setByClick] = useState(false);
  const add = ({ name, field_of_view }: SensorKind) => {
    if (byClick) {
      rig.arm(rig.armed === name ? null : name);
      return;
    }
    const roof = rig.mounts[0]?.pose ?? { x: 0, y: 0, z: 1.8, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
    const bumper = rig.mounts.find(({ name }) => name === "Front bumper")?.pose ?? roof;
    const front = rig.mounts.find(({ name }) => name === "Roof, front")?.pose ?? roof;
    const places = { pyramid: front, cone: bumper, sweep: roof, none: { ...roof, x: 0, z: 0 } };
    rig.add(name, places[field_of_view]);
  };
  return (
    <header className="panel-head toolbar">
      <h2>Sensor rig</h2>
      <EditorChoice />
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
        {common.map((kind) => (
          <button
            key={kind.name}
            type="button"
            className="button small add"
            aria-pressed={byClick ? rig.armed === kind.name : undefined}
            style={{ "--colour": colourOf(kind.name) } as React.CSSProperties}
            onClick={() => add(kind)}
          >
            <Icon name="plus" />
            {shortTitle(kind.title)}
          </button>
        ))}
        <Menu label="More" name="other kinds of sensor">
          {others.map((kind) => (
            <button key={kind.name} type="button" role="menuitem" onClick={() => add(kind)}>
              <span className="dot" style={{ "--colour": colourOf(kind.name) } as React.CSSProperties} />
              {kind.title}
            </button>
          ))}
        </Menu>
      </div>
      <button
        type="button"
        className="button small"
        aria-pressed={byClick}
        title="Choose a kind of sensor, then press on the car; Shift places several, Esc ends it"
        onClick={() => {
          setByClick(!byClick);
          rig.arm(null);
        }}
      >
        Place by click
      </button>
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
          {measuring(modalities).map(({ name, title }) => (
            <option key={name} value={name}>
              {title}
            </option>
          ))}
        </select>
      </label>
    </header>
  );
}

/** `Camera (RGB)` on a button is `Camera`. */
function shortTitle(title: string): string {
  return title.replace(/ \(.*\)$/, "");
}

function presetName(name: string): string {
  const known: Record<string, string> = { kitti: "KITTI", nuscenes: "nuScenes", waymo: "Waymo-like", paper: "Paper", demo: "Demo" };
  return known[name] ?? name;
}
