import type { TableFilter, TableRequest } from "../api/types";
import { currentQuery, type QueryChange } from "../app/query";

export type TableName = NonNullable<TableRequest["table"]>;

/** What of the label tables is shown, as the address has it. */
export interface TableAddress {
  table: TableName;
  episode: string;
  filters: TableFilter[];
  sort: string | null;
  descending: boolean;
  offset: number;
  all: boolean;
}

const NAMES: readonly TableName[] = ["camera_objects", "objects", "ego", "events", "frames"];
const OPS: readonly string[] = ["eq", "ne", "lt", "le", "gt", "ge", "contains"];

export function readTable(query: URLSearchParams): TableAddress {
  const sort = query.get("sort");
  return {
    table: NAMES.find((name) => name === query.get("table")) ?? "camera_objects",
    episode: query.get("episode") ?? "",
    filters: query.getAll("filter").flatMap(readFilter),
    sort: sort?.replace(/^-/, "") || null,
    descending: sort?.startsWith("-") ?? false,
    offset: Number(query.get("offset")) || 0,
    all: query.get("columns") === "all",
  };
}

/** Changes of the address; another selection begins at its first row. */
export function writeTable(change: Partial<TableAddress>): QueryChange {
  const next = { ...readTable(currentQuery()), offset: 0, ...change };
  return {
    table: next.table === "camera_objects" ? null : next.table,
    episode: next.episode || null,
    filter: next.filters.map(({ column, op, value }) => `${column}~${op}~${JSON.stringify(value)}`),
    sort: next.sort && `${next.descending ? "-" : ""}${next.sort}`,
    offset: next.offset || null,
    columns: next.all ? "all" : null,
  };
}

function readFilter(text: string): TableFilter[] {
  const [column = "", op = "", ...rest] = text.split("~");
  if (!column || !OPS.includes(op)) return [];
  try {
    const value: unknown = JSON.parse(rest.join("~"));
    const plain = value === null || ["string", "number", "boolean"].includes(typeof value);
    return plain ? [{ column, op: op as TableFilter["op"], value: value as TableFilter["value"] }] : [];
  } catch (error) {
    console.info("a filter of the address cannot be read", text, error);
    return [];
  }
}
