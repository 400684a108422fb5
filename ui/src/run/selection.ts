/** As many runs as can be told apart in a chart; the server takes no more. */
export const MOST_COMPARED = 6;

/** Lines of compared runs, by their place: colours and dashes. */
export const RUN_COLOURS = ["var(--camera)", "var(--radar)", "var(--lidar)", "var(--inertial)", "var(--truth)", "var(--muted)"];
export const RUN_DASHES = [undefined, "7 4", "2 3", "10 3 2 3", "4 2", "1 4"];

/** The runs that an address chooses, each once. */
export function chosenRuns(query: URLSearchParams): string[] {
  return [...new Set(query.getAll("run"))].slice(0, MOST_COMPARED);
}

/** With a run more, or without it. */
export function withRun(chosen: readonly string[], run: string, wanted: boolean): string[] {
  const others = chosen.filter((one) => one !== run);
  return wanted ? [...others, run].slice(0, MOST_COMPARED) : others;
}

/** A setting's value in a cell: words as they are, whole sensors by their kind. */
export function valueText(value: unknown): string {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "string") return value || "(empty)";
  if (typeof value === "object" && "kind" in value && "id" in value) return String(value.kind);
  return JSON.stringify(value);
}
