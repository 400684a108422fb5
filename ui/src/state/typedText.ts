import { post, sentence } from "../api/client";
import type { ConfigImportResult } from "../api/types";
import { draft, edit } from "./draft";
import type { JsonObject } from "./json";

const SILENCE_MS = 300;

let timer: number | undefined;
let asked = new AbortController();
let shown = false;

/** The text view is there, or it goes: wrong text goes with it, for the form shows what it replaces. */
export function showText(on: boolean): void {
  shown = on;
  if (!on) draft.set((now) => (now.typed?.length ? { ...now, typed: null } : now));
}

/**
 * Somebody types the document. Until the text is read, after a short silence, the draft counts as not
 * saved; it is read also when its view has gone meanwhile.
 */
export function typeText(text: string): void {
  window.clearTimeout(timer);
  asked.abort();
  asked = new AbortController();
  const { signal } = asked;
  draft.set((now) => ({ ...now, typed: [] }));
  timer = window.setTimeout(() => void read(text, signal), SILENCE_MS);
}

async function read(text: string, signal: AbortSignal): Promise<void> {
  try {
    const answer = await post<ConfigImportResult>("/config/import", { text, format: "yaml" }, signal);
    const problems = (answer.errors ?? []).map((one) => ({ ...one, hint: one.hint ?? "" }));
    if (problems.length > 0) return finish(problems);
    edit(() => answer.config as JsonObject, "yaml");
    draft.set((now) => ({ ...now, typed: null })); // after the change: the draft is unsaved all the time
  } catch (failure) {
    if (!signal.aborted) finish([{ path: [], message: sentence(failure), hint: "" }]);
  }
}

function finish(problems: NonNullable<ReturnType<typeof draft.get>["typed"]>): void {
  draft.set((now) => ({ ...now, typed: shown ? problems : null }));
}
