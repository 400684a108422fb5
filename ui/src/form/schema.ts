import { isObject, type Json } from "../state/json";

/** A node of the configuration's JSON schema, as far as the form reads it. */
export interface SchemaNode {
  $ref?: string;
  $defs?: Record<string, SchemaNode>;
  type?: string;
  title?: string;
  description?: string;
  unit?: string;
  group?: string;
  basic?: boolean;
  default?: Json;
  const?: Json;
  enum?: Json[];
  minimum?: number;
  maximum?: number;
  exclusiveMinimum?: number;
  exclusiveMaximum?: number;
  minItems?: number;
  maxItems?: number;
  minLength?: number;
  properties?: Record<string, SchemaNode>;
  required?: string[];
  items?: SchemaNode;
  prefixItems?: SchemaNode[];
  anyOf?: SchemaNode[];
  oneOf?: SchemaNode[];
  discriminator?: { propertyName: string; mapping: Record<string, string> };
  additionalProperties?: boolean | SchemaNode;
}

/** What kind of control a value needs. */
export type Kind =
  | "toggle"
  | "number"
  | "text"
  | "enum"
  | "const"
  | "pair"
  | "list"
  | "rows"
  | "section"
  | "variants"
  | "choices"
  | "mapping";

/** A schema node with its references followed and its kind decided. */
export interface Field {
  kind: Kind;
  node: SchemaNode;
  /** `null` or left out is a value like others. */
  optional: boolean;
  title: string;
  description: string;
  unit?: string;
  whole?: boolean;
  minimum?: number;
  maximum?: number;
  options?: Json[];
  /** Of `pair`: one per place. Of `choices`: one per alternative. */
  alternatives?: Field[];
  /** Of `list` and `rows`: the element. */
  item?: Field;
  /** Of `variants`: the value of the discriminator to its section. */
  variants?: Record<string, Field>;
  discriminator?: string;
  /** Of `section`: its own settings. */
  properties?: Record<string, Field>;
}

/** Follow references and find the control that a node needs. */
export function fieldOf(root: SchemaNode, node: SchemaNode): Field {
  const here = follow(root, node);
  const base = {
    node: here,
    optional: false,
    title: stripUnit(here.title ?? "", here.unit),
    description: here.description ?? "",
    unit: here.unit,
  };
  if (here.oneOf && here.discriminator) return { ...base, ...variantsOf(root, here) };
  if (here.anyOf) return { ...base, ...choicesOf(root, here, base) };
  if (here.const !== undefined) return { ...base, kind: "const" };
  if (here.enum) return { ...base, kind: "enum", options: here.enum };
  if (here.prefixItems)
    return { ...base, kind: "pair", alternatives: here.prefixItems.map((item) => fieldOf(root, item)) };
  if (here.type === "array" && here.items) {
    const item = fieldOf(root, here.items);
    return { ...base, kind: isSimple(item) ? "list" : "rows", item };
  }
  if (here.type === "boolean") return { ...base, kind: "toggle" };
  if (here.type === "number" || here.type === "integer") return { ...base, ...numberOf(here) };
  if (here.properties) {
    const entries = Object.entries(here.properties).map(([key, child]): [string, Field] => [key, fieldOf(root, child)]);
    return { ...base, kind: "section", properties: Object.fromEntries(entries) };
  }
  if (here.type === "object") return { ...base, kind: "mapping" };
  return { ...base, kind: "text" };
}

function follow(root: SchemaNode, node: SchemaNode): SchemaNode {
  if (!node.$ref) return node;
  const name = node.$ref.split("/").at(-1) ?? "";
  const target = root.$defs?.[name];
  if (!target) throw new Error(`the schema has no definition ${name}`);
  const { $ref: _, ...own } = node;
  // A text at the place of use wins over the section's own.
  return { ...follow(root, target), title: "", ...own };
}

function numberOf(node: SchemaNode): Partial<Field> & { kind: Kind } {
  return {
    kind: "number",
    whole: node.type === "integer",
    minimum: node.minimum ?? node.exclusiveMinimum,
    maximum: node.maximum ?? node.exclusiveMaximum,
  };
}

function variantsOf(root: SchemaNode, node: SchemaNode): Partial<Field> & { kind: Kind } {
  const mapping = node.discriminator?.mapping ?? {};
  const variants = Object.fromEntries(
    Object.entries(mapping).map(([name, ref]) => [name, fieldOf(root, { $ref: ref })]),
  );
  return { kind: "variants", variants, discriminator: node.discriminator?.propertyName };
}

function choicesOf(
  root: SchemaNode,
  node: SchemaNode,
  base: { title: string; unit?: string },
): Partial<Field> & { kind: Kind } {
  const alternatives = (node.anyOf ?? []).filter((one) => one.type !== "null");
  const optional = alternatives.length < (node.anyOf ?? []).length;
  const fields = alternatives.map((one) => ({ ...fieldOf(root, one), ...pick(base, fieldOf(root, one)) }));
  const [only] = fields;
  if (only && fields.length === 1) {
    const { node: _node, title: _title, description: _description, unit: _unit, ...rest } = only;
    return { ...rest, optional };
  }
  return { kind: "choices", alternatives: fields, optional };
}

function pick(base: { title: string; unit?: string }, own: Field): Partial<Field> {
  return { title: own.title || base.title, unit: own.unit ?? base.unit };
}

function isSimple(item: Field): boolean {
  return item.kind === "text" || item.kind === "enum" || item.kind === "number";
}

function stripUnit(title: string, unit: string | undefined): string {
  return unit && title.endsWith(` (${unit})`) ? title.slice(0, -unit.length - 3) : title;
}

/** Whether a value has the shape of a field; chooses among alternatives. */
export function fits(field: Field, value: Json | undefined): boolean {
  switch (field.kind) {
    case "const":
      return value === field.node.const;
    case "enum":
      return (field.options ?? []).includes(value as Json);
    case "number":
      return typeof value === "number";
    case "toggle":
      return typeof value === "boolean";
    case "text":
      return typeof value === "string";
    case "pair":
    case "list":
    case "rows":
      return Array.isArray(value);
    default:
      return isObject(value);
  }
}

/**
 * Which alternative a value is of; -1: none. What is being typed, as `-` or nothing yet, is a text that
 * none takes: it stays with the one that it is typed into.
 */
export function alternativeOf(alternatives: readonly Field[], value: Json | undefined, before: number): number {
  const index = alternatives.findIndex((one) => fits(one, value));
  return index < 0 && typeof value === "string" ? before : index;
}

/** The value that a field begins with. */
export function initial(field: Field): Json {
  const { node } = field;
  if (node.default !== undefined && node.default !== null) return node.default;
  switch (field.kind) {
    case "const":
      return node.const ?? null;
    case "enum":
      return field.options?.[0] ?? null;
    case "toggle":
      return false;
    case "number":
      return Math.max(field.minimum ?? 0, node.exclusiveMinimum !== undefined ? 1 : 0);
    case "text":
      return "";
    case "pair":
      return (field.alternatives ?? []).map(initial);
    case "list":
    case "rows":
      return [];
    case "choices":
      return field.alternatives?.[0] ? initial(field.alternatives[0]) : null;
    case "variants": {
      const [name, first] = Object.entries(field.variants ?? {})[0] ?? [];
      return name && first ? { ...requiredOf(first), [field.discriminator ?? "kind"]: name } : {};
    }
    default:
      return requiredOf(field);
  }
}

function requiredOf(field: Field): Record<string, Json> {
  const needed = field.node.required ?? [];
  return Object.fromEntries(
    needed.flatMap((key) => {
      const own = field.properties?.[key];
      return own ? [[key, initial(own)]] : [];
    }),
  );
}
