import { Icon } from "../ui/Icon";
import { Menu } from "../ui/Menu";
import { aligned, around, distributed, turnedAlike } from "./arrange";
import type { Pose } from "./coordinates";
import { useRig } from "./useRig";

/** Copies, mirrors, deletes what is chosen. */
export function ChosenTools() {
  const rig = useRig();
  return (
    <div className="button-row" role="group" aria-label="Change what is chosen">
      {rig.selected.length > 1 && <Arrange />}
      <Tool icon="copy" name="Duplicate" hint="Ctrl-D" onClick={() => rig.duplicate(rig.selected)} />
      <Tool icon="mirror" name="Mirror left-right" onClick={() => rig.mirror(rig.selected)} />
      <Tool icon="trash" name="Delete" hint="Del" onClick={() => rig.remove(rig.selected)} />
    </div>
  );
}

type Change = (poses: ReadonlyMap<string, Pose>) => Map<string, Pose>;
const ARRANGEMENTS: { name: string; least: number; change: Change }[] = [
  { name: "Align along x (same distance ahead)", least: 2, change: (poses) => aligned(poses, "x") },
  { name: "Align along y (same distance right)", least: 2, change: (poses) => aligned(poses, "y") },
  { name: "Align heights", least: 2, change: (poses) => aligned(poses, "z") },
  { name: "Align directions", least: 2, change: turnedAlike },
  { name: "Distribute along x", least: 3, change: (poses) => distributed(poses, "x") },
  { name: "Distribute along y", least: 3, change: (poses) => distributed(poses, "y") },
  { name: "Distribute heights", least: 3, change: (poses) => distributed(poses, "z") },
  { name: "Turn all around evenly", least: 2, change: around },
];

/** Aligns and distributes what is chosen; the first that was chosen leads. */
function Arrange() {
  const rig = useRig();
  const arrange = (change: Change) => {
    const poses = rig.selected.flatMap((key): [string, Pose][] => {
      const found = rig.sensors.find((sensor) => sensor.key === key);
      return found ? [[key, found.pose]] : [];
    });
    const next = change(new Map(poses));
    rig.pose(rig.selected, (pose, key) => next.get(key) ?? pose);
  };
  return (
    <Menu label="Arrange" name="what is chosen">
      {ARRANGEMENTS.map(({ name, least, change }) => (
        <button key={name} type="button" role="menuitem" disabled={rig.selected.length < least} onClick={() => arrange(change)}>
          {name}
        </button>
      ))}
    </Menu>
  );
}

function Tool({ icon, name, hint, onClick }: { icon: string; name: string; hint?: string; onClick(): void }) {
  return (
    <button
      type="button"
      className="icon-button"
      aria-label={name}
      title={hint ? `${name} (${hint})` : name}
      onClick={onClick}
    >
      <Icon name={icon} />
    </button>
  );
}
