import { Icon } from "../ui/Icon";
import { useRig } from "./useRig";

/** Copies, mirrors, deletes what is chosen. */
export function ChosenTools() {
  const rig = useRig();
  return (
    <div className="button-row" role="group" aria-label="Change what is chosen">
      <Tool icon="copy" name="Duplicate" hint="Ctrl-D" onClick={() => rig.duplicate(rig.selected)} />
      <Tool icon="mirror" name="Mirror left-right" onClick={() => rig.mirror(rig.selected)} />
      <Tool icon="trash" name="Delete" hint="Del" onClick={() => rig.remove(rig.selected)} />
    </div>
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
