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
  scene: ["Scene", "Where, when and for how long"],
  traffic: ["Traffic", "Who else is on the road"],
  ego: ["Ego vehicle", "What carries the sensors, and what it does"],
  rig: ["Images", "Defaults of all cameras"],
  labels: ["Labels", "What is written as ground truth"],
  server: ["Server", "Where the world is simulated"],
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
