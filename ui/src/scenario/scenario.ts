import { getAt, isObject, setAt, type Json, type JsonObject } from "../state/json";
import type { Place } from "./townMap";

/** Where the ego begins: drawn, the number of a spawn point, or a place. */
export type Start = "random" | number | Place;
/** Where its way leads through. */
export type Stop = number | { x: number; y: number };

export interface WeatherChange {
  at_s: number;
  choice: string | null;
  /** Single values on top of the preset; they are edited in the form. */
  parameters: JsonObject;
}

export function startOf(document: JsonObject): Start {
  const given = getAt(document, ["ego", "spawn"]);
  if (typeof given === "number") return given;
  if (!isObject(given)) return "random";
  return { x: numberAt(given, "x"), y: numberAt(given, "y"), z: numberAt(given, "z", 0.3), yaw_deg: numberAt(given, "yaw_deg") };
}

export function withStart(document: JsonObject, start: Start): JsonObject {
  return setAt(document, ["ego", "spawn"], typeof start === "object" ? { ...start } : start);
}

export function kindOfScenario(document: JsonObject): string {
  return String(getAt(document, ["scenario", "kind"]) ?? "autopilot");
}

/** The places that a route leads through; none for another scenario. */
export function stopsOf(document: JsonObject): Stop[] {
  const given = getAt(document, ["scenario", "through"]);
  if (kindOfScenario(document) !== "route" || !Array.isArray(given)) return [];
  return given.flatMap((one): Stop[] =>
    typeof one === "number" ? [one] : isObject(one) ? [{ x: numberAt(one, "x"), y: numberAt(one, "y") }] : [],
  );
}

/** A route leads through one place at least: without any the ego drives where it likes. */
export function withStops(document: JsonObject, stops: readonly Stop[]): JsonObject {
  const scenario: JsonObject =
    stops.length === 0
      ? { kind: "autopilot" }
      : { kind: "route", through: stops.map((one): Json => (typeof one === "number" ? one : { ...one })) };
  return setAt(document, ["scenario"], scenario);
}

export function moved<T>(list: readonly T[], from: number, to: number): T[] {
  const next = [...list];
  next.splice(to, 0, ...next.splice(from, 1));
  return next;
}

export function changesOf(document: JsonObject): WeatherChange[] {
  const given = getAt(document, ["weather", "changes"]);
  return (Array.isArray(given) ? given : []).filter(isObject).map((one) => ({
    at_s: numberAt(one, "at_s"),
    choice: typeof one.choice === "string" ? one.choice : null,
    parameters: isObject(one.parameters) ? one.parameters : {},
  }));
}

/** The changes in the order of time. */
export function withChanges(document: JsonObject, changes: readonly WeatherChange[]): JsonObject {
  const base = isObject(document.weather) ? document : setAt(document, ["weather"], weatherOf(document));
  const list = changes.map(({ at_s, choice, parameters }): Json => ({
    at_s,
    ...(choice === null ? {} : { choice }),
    ...(Object.keys(parameters).length > 0 ? { parameters } : {}),
  }));
  return setAt(base, ["weather", "changes"], list);
}

export function sorted(changes: readonly WeatherChange[]): WeatherChange[] {
  return [...changes].sort((a, b) => a.at_s - b.at_s);
}

/** A moment for a further change: the middle of the longest stretch, to a tenth of a second. */
export function freeMoment(changes: readonly WeatherChange[], duration: number): number {
  const moments = [0, ...sorted(changes).map(({ at_s }) => at_s).filter((at) => at < duration), duration];
  let [from, to] = [0, 0];
  moments.forEach((moment, i) => {
    const next = moments[i + 1];
    if (next !== undefined && next - moment > to - from) [from, to] = [moment, next];
  });
  return tenth((from + to) / 2);
}

export function tenth(value: number): number {
  return Math.round(value * 10) / 10;
}

/** `weather: ClearNoon` as the section that it stands for. */
function weatherOf(document: JsonObject): JsonObject {
  return typeof document.weather === "string" ? { choice: document.weather } : {};
}

/** The maps that episodes play on; `all`: every one that the server is known to have. */
export function mapsOf(document: JsonObject, known: readonly string[]): string[] {
  if (typeof document.map === "string") return [document.map];
  const choice = getAt(document, ["map", "choice"]);
  if (typeof choice === "string" && choice !== "") return [choice];
  const drawn = getAt(document, ["map", "random_from"]);
  if (!Array.isArray(drawn)) return choice === undefined ? ["Stage01"] : [];
  return [...new Set(drawn.flatMap((name) => (name === "all" ? known : [String(name)])))];
}

/** A sky's colour for a preset's name: time of day, greyer with clouds and rain. */
export function skyOf(preset: string | null): string {
  if (preset === null) return "var(--raised)";
  if (preset.startsWith("DustStorm")) return "#c9a36a";
  const base = preset.endsWith("Night") ? "#26345c" : preset.endsWith("Sunset") ? "#e2965a" : "#8cc4f0";
  const grey = /Hard/.test(preset) ? 70 : /Mid/.test(preset) ? 55 : /Soft/.test(preset) ? 45 : /Cloudy/.test(preset) ? 30 : 0;
  return `color-mix(in srgb, #5d6670 ${grey}%, ${base})`;
}

function numberAt(object: JsonObject, key: string, fallback = 0): number {
  const value = object[key];
  return typeof value === "number" ? value : fallback;
}
