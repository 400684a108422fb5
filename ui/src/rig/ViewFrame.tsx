import { Icon } from "../ui/Icon";

/** Gives a view the whole space of the editor, and back. */
function Enlarge({ name, large, toggle }: { name: string; large: boolean; toggle(): void }) {
  return (
    <button
      type="button"
      className="icon-button"
      aria-pressed={large}
      aria-label={`${large ? "Shrink" : "Enlarge"}, ${name}`}
      title={large ? "Shrink" : "Enlarge"}
      onClick={toggle}
    >
      <Icon name={large ? "shrink" : "expand"} />
    </button>
  );
}

export const ViewFrame = { Enlarge };
