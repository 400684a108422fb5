import { changeQuery, useQuery } from "../app/query";

export type Editor = "rig" | "map";

/** Which editor stands beside the parameters; it is in the address, so that a reload keeps it. */
export function useEditor(): Editor {
  return useQuery().get("edit") === "map" ? "map" : "rig";
}

export function EditorChoice() {
  const now = useEditor();
  return (
    <div className="segments small editor-choice" role="group" aria-label="What to edit">
      {(["rig", "map"] as const).map((one) => (
        <button
          key={one}
          type="button"
          className="segment"
          aria-pressed={one === now}
          onClick={() => changeQuery({ edit: one === "rig" ? null : one }, true)}
        >
          {one === "rig" ? "Rig" : "Map"}
        </button>
      ))}
    </div>
  );
}
