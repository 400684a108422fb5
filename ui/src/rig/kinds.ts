import { get, sentence } from "../api/client";
import type { SensorKind, SensorKinds, SensorModality } from "../api/types";
import { createStore } from "../state/store";

export type Modality = SensorModality["name"];

/** The server's table of sensor kinds; `error` says why it is not there yet. */
interface KindTable {
  kinds: ReadonlyMap<string, SensorKind> | null;
  modalities: readonly SensorModality[];
  error: string | null;
}

const RETRY_MS = 1500;

export const kindTable = createStore<KindTable>({ kinds: null, modalities: [], error: null });

/** Ask the server for the table, and again until it answers. */
export async function loadKinds(): Promise<void> {
  try {
    setKinds(await get<SensorKinds>("/sensor-kinds"));
  } catch (error) {
    kindTable.set((now) => ({ ...now, error: sentence(error) }));
    window.setTimeout(() => void loadKinds(), RETRY_MS);
  }
}

export function setKinds({ kinds, modalities }: SensorKinds): void {
  kindTable.set({ kinds: new Map(kinds.map((kind) => [kind.name, kind])), modalities, error: null });
}

/** The row of a kind; null where the server does not know it, as in a dataset with a missing plug-in. */
export function kindOf(name: string): SensorKind | null {
  return kindTable.get().kinds?.get(name) ?? null;
}

export function titleOf(name: string): string {
  return kindOf(name)?.title ?? (name || "Sensor");
}

/** Whether it looks somewhere: has a field of view. */
export function looks(name: string): boolean {
  return (kindOf(name)?.field_of_view ?? "none") !== "none";
}

/** The name of a kind's colour; unknown kinds are grey. */
export function colourName(name: string): string {
  const modality = kindOf(name)?.modality;
  return kindTable.get().modalities.find((one) => one.name === modality)?.colour ?? "muted";
}

/** The colour of a kind as a CSS variable. */
export function colourOf(name: string): string {
  return `var(--${colourName(name)})`;
}

/** The first kind of each group of measuring sensors: those that most rigs have. */
export function commonKinds(): SensorKind[] {
  const { kinds, modalities } = kindTable.get();
  const all = [...(kinds?.values() ?? [])];
  return measuring(modalities).flatMap(({ name }) => all.find((kind) => kind.modality === name && looks(kind.name)) ?? []);
}

/** Groups that look somewhere and measure: ground truth is no sensor of a car. */
export function measuring(modalities: readonly SensorModality[]): SensorModality[] {
  const all = [...(kindTable.get().kinds?.values() ?? [])];
  return modalities.filter(
    ({ name }) => name !== "truth" && all.some((kind) => kind.modality === name && looks(kind.name)),
  );
}
