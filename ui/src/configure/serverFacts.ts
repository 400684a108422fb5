import type { ServerCheck } from "../api/types";
import { getAt, type JsonObject } from "../state/json";
import { createStore } from "../state/store";

/** What the connection test has found, and of which server: names of maps and vehicles to choose from. */
export const serverFacts = createStore<{ server: string; check: ServerCheck } | null>(null);

export function keyOf(document: JsonObject): string {
  return JSON.stringify(document.server ?? { kind: "embedded" });
}

export function isEmbedded(document: JsonObject): boolean {
  return (getAt(document, ["server", "kind"]) ?? "embedded") === "embedded";
}

/** What is known of the server that the document names; null: nobody has asked it, or it was another one. */
export function factsOf(document: JsonObject, known: { server: string; check: ServerCheck } | null): ServerCheck | null {
  return known?.server === keyOf(document) && known.check.ok ? known.check : null;
}
