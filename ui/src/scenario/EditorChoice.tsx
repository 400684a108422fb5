import { changeQuery, useQuery } from "../app/query";

export type Editor = "rig" | "map";

/** Which editor stands beside the parameters; it is in the address, so that a reload keeps it. */
export function useEditor(): Editor {
  return useQuery().get("edit") === "map" ? "map" : "rig";
}

/** To the other editor. */
export function EditorChoice() {
  const other: Editor = useEditor() === "rig" ? "map" : "rig";
  return (
    <button
      type="button"
      className="button small"
      title={other === "map" ? "Start, route and weather on the map" : "Sensors on the car"}
      onClick={() => changeQuery({ edit: other === "rig" ? null : other }, true)}
    >
      {other === "map" ? "Map" : "Rig"}
    </button>
  );
}
