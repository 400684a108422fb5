import type { Path } from "../state/json";
import { fieldOf, type Field, type SchemaNode } from "./schema";

/** One control of the form with the place of its value in the document. */
export interface Placed {
  path: Path;
  field: Field;
  basic: boolean;
}

export interface Group {
  name: string;
  title: string;
  hint: string;
  basic: Placed[];
  more: Placed[];
}

const TITLES: Record<string, [string, string]> = {
  server: ["Server", "Where the world is simulated"],
  scene: ["Scene", "Where, when and for how long"],
  traffic: ["Traffic", "Who else is on the road"],
  ego: ["Ego vehicle", "What carries the sensors, and what it does"],
  rig: ["Images", "Defaults of all cameras"],
  labels: ["Labels", "What is written as ground truth"],
  timing: ["Timing", "Steps, physics and synchronisation"],
  conversion: ["Conversion", "From raw recordings to files"],
  output: ["Output", "What stays on disk"],
};

/** The form's groups, out of the schema: most-used settings first, the others below "more". */
export function groupsOf(schema: SchemaNode): Group[] {
  const groups = new Map<string, Group>();
  for (const [key, node] of Object.entries(schema.properties ?? {})) {
    if (key === "rig") continue; // has an editor of its own
    const name = node.group ?? "scene";
    const [title, hint] = TITLES[name] ?? [name, ""];
    const group = groups.get(name) ?? { name, title, hint, basic: [], more: [] };
    groups.set(name, group);
    for (const placed of place(schema, key, node)) (placed.basic ? group.basic : group.more).push(placed);
  }
  const order = Object.keys(TITLES);
  return [...groups.values()].sort((a, b) => order.indexOf(a.name) - order.indexOf(b.name));
}

/** The settings of the paper: scene, amount, sensors' defaults, ground truth, synchronisation, place. */
const PAPER = [
  "server", "map", "weather", "episodes", "duration_s", "fps", "save_every", "image_size", "max_distance_m",
  "min_lidar_points", "ground_truth", "labels.method", "labels.boxes", "ego.blueprint", "vehicles.count",
  "pedestrians.count", "scenario", "timing", "seed",
];

export type Filter = "all" | "paper" | "changed";

/** Whether a setting fits what is looked for. */
export function fitsFilter(placed: Placed, filter: Filter, words: string, changed: (path: Path) => boolean): boolean {
  const path = placed.path.join(".");
  if (filter === "paper" && !PAPER.some((one) => path === one || path.startsWith(`${one}.`))) return false;
  if (filter === "changed" && !changed(placed.path)) return false;
  const text = `${path} ${textOf(placed.field)}`.toLowerCase();
  return words.toLowerCase().split(/\s+/).every((word) => text.includes(word));
}

/** Titles, units and descriptions of a field and of what is inside. */
function textOf(field: Field): string {
  const inside = [...Object.values(field.properties ?? {}), ...(field.alternatives ?? []), ...Object.values(field.variants ?? {})];
  return [field.title, field.unit ?? "", field.description, ...inside.map(textOf)].join(" ");
}

/** What a part of a group is headed by, where a group has several: vehicles, pedestrians. */
export function headingOf(placed: readonly Placed[], at: number): string | null {
  const part = (one: Placed | undefined) => (one && one.path.length > 1 ? String(one.path[0]) : "");
  const mine = part(placed[at]);
  if (mine === "" || mine === part(placed[at - 1])) return null;
  const parts = new Set(placed.map(part).filter(Boolean));
  return parts.size > 1 ? mine.charAt(0).toUpperCase() + mine.slice(1).replaceAll("_", " ") : null;
}

function place(schema: SchemaNode, key: string, node: SchemaNode): Placed[] {
  const field = fieldOf(schema, node);
  if (field.kind !== "section" || choiceSection(field)) {
    const rest = field.kind === "section" ? restOf(field, [key]) : [];
    return [{ path: [key], field, basic: Boolean(node.basic) }, ...rest];
  }
  const small = Object.keys(field.properties ?? {}).length > 0;
  return small ? childrenOf(field, [key]) : [{ path: [key], field, basic: Boolean(node.basic) }];
}

/** A section with `choice` and `random_from` is one control: one name, or some to draw from. */
export function choiceSection(field: Field): boolean {
  return Boolean(field.properties?.choice && field.properties.random_from);
}

function restOf(field: Field, path: Path): Placed[] {
  return childrenOf(field, path).filter(
    ({ path: own }) => !["choice", "random_from"].includes(String(own.at(-1))),
  );
}

function childrenOf(field: Field, path: Path): Placed[] {
  return Object.entries(field.properties ?? {}).map(([key, own]) => ({
    path: [...path, key],
    field: own,
    basic: Boolean(own.node.basic),
  }));
}
