import { ApiError, post, put, sentence } from "../api/client";
import type { ConfigCheck, ConfigConflict, ConfigSaved, ConfigState, Estimate } from "../api/types";
import type { Problem } from "../form/context";
import { emptyHistory, reduceHistory, type History, type HistoryAction } from "./history";
import { equal, type JsonObject } from "./json";
import { createStore } from "./store";

/**
 * The configuration as this page edits it. The server's is `{rev, config}`; changes here go there
 * after a short silence, wrong ones stay here with what is wrong about them.
 */
export interface Draft {
  history: History;
  rev: number;
  loaded: boolean;
  saved: "saved" | "saving" | "wrong" | "offline" | "conflict";
  problems: readonly Problem[];
  /** Text is typed and not yet read (nothing in it), or wrong; null: the document is all there is. */
  typed: readonly Problem[] | null;
  warnings: readonly string[];
  estimate: Estimate | null;
  /** Theirs, when somebody else has changed it meanwhile. */
  theirs: ConfigState | null;
}

const SILENCE_MS = 150;
const RETRY_MS = 1500;

/** This page among all that edit the configuration. */
export const author = `page-${crypto.getRandomValues(new Uint32Array(2)).join("-")}`;

export const draft = createStore<Draft>({
  history: emptyHistory({}),
  rev: 0,
  loaded: false,
  saved: "saved",
  problems: [],
  typed: null,
  warnings: [],
  estimate: null,
  theirs: null,
});

let timer: number | undefined;
let inFlight = false;

export function dispatch(action: HistoryAction): void {
  const before = draft.get().history;
  const history = reduceHistory(before, action);
  if (history === before) return;
  draft.set((now) => ({ ...now, history }));
  if (history.present !== before.present && action.type !== "adopt") schedule();
}

/** Change the document; changes of one gesture are one undo step. */
export function edit(change: (document: JsonObject) => JsonObject, gesture?: string): void {
  dispatch({ type: "edit", document: change(draft.get().history.present), gesture });
}

function schedule(wait = SILENCE_MS): void {
  window.clearTimeout(timer);
  draft.set((now) => ({ ...now, saved: now.saved === "conflict" ? "conflict" : "saving" }));
  timer = window.setTimeout(() => void save(), wait);
}

async function save(): Promise<void> {
  if (inFlight) return schedule();
  const { history, rev, saved } = draft.get();
  if (saved === "conflict") return;
  const config = history.present;
  inFlight = true;
  try {
    const answer = await put<ConfigSaved>("/config", { rev, config, author });
    const estimate = answer.estimate ?? null;
    const warnings = answer.warnings ?? [];
    draft.set((now) => ({ ...now, rev: answer.rev, saved: "saved", problems: [], warnings, estimate }));
  } catch (error) {
    refused(error);
  } finally {
    inFlight = false;
  }
  if (!equal(draft.get().history.present, config)) schedule();
}

function refused(error: unknown): void {
  if (error instanceof ApiError && error.status === 409) {
    const { current } = error.answer as ConfigConflict;
    draft.set((now) => ({ ...now, saved: "conflict", theirs: current }));
  } else if (error instanceof ApiError) {
    const errors = error.answer.errors ?? [];
    const problems = errors.map((one) => ({ path: one.path, message: one.message, hint: one.hint ?? "" }));
    const whole = { path: [], message: error.answer.message, hint: error.answer.hint ?? "" };
    draft.set((now) => ({ ...now, saved: "wrong", problems: problems.length ? problems : [whole], estimate: null }));
  } else {
    console.info(sentence(error));
    draft.set((now) => ({ ...now, saved: "offline" }));
    timer = window.setTimeout(() => void save(), RETRY_MS);
  }
}

/** Take over the server's configuration: at first, or when another page has changed it. */
export function receiveConfig(state: ConfigState, first: boolean): void {
  const now = draft.get();
  if (state.author === author && !first) return;
  if (now.loaded && state.rev === now.rev) return;
  const dirty = now.loaded && (now.saved !== "saved" || now.typed !== null);
  if (dirty && !equal(now.history.present, state.config as JsonObject)) {
    draft.set({ ...now, saved: "conflict", theirs: state });
    return;
  }
  adopt(state);
}

function adopt(state: ConfigState): void {
  const document = state.config as JsonObject;
  draft.set((now) => ({
    ...now,
    history: now.loaded
      ? reduceHistory(now.history, { type: "adopt", document })
      : emptyHistory(document),
    rev: state.rev,
    loaded: true,
    saved: "saved",
    problems: [],
    typed: null,
    theirs: null,
  }));
  void check();
}

/** Ask what the document would record, without saving it. */
async function check(): Promise<void> {
  const config = draft.get().history.present;
  try {
    const answer = await post<ConfigCheck>("/config/check", { config });
    if (draft.get().history.present !== config) return;
    const problems = (answer.errors ?? []).map((one) => ({ ...one, hint: one.hint ?? "" }));
    const estimate = answer.estimate ?? null;
    draft.set((now) => ({ ...now, problems, warnings: answer.warnings ?? [], estimate }));
  } catch (error) {
    console.info(sentence(error)); // asked again with the next change
  }
}

/** End a conflict: take theirs, or put mine over it. */
export function resolve(keep: "mine" | "theirs"): void {
  const { theirs } = draft.get();
  if (!theirs) return;
  if (keep === "theirs") return adopt(theirs);
  draft.set((now) => ({ ...now, rev: theirs.rev, saved: "saving", theirs: null }));
  schedule(0);
}

/** How the draft stands, text that is being typed included. */
export function standing({ saved, typed }: Draft): Draft["saved"] {
  if (typed === null || saved === "conflict") return saved;
  return typed.length > 0 ? "wrong" : "saving";
}

/** What is wrong with the draft or with the text that is typed. */
export function problemsOf({ problems, typed }: Draft): readonly Problem[] {
  return typed?.length ? typed : problems;
}

/** Resolves when the draft is saved, or rejects with why it cannot be. */
export async function settled(): Promise<number> {
  for (;;) {
    const now = draft.get();
    const state = standing(now);
    const [problem] = problemsOf(now);
    if (state === "saved") return now.rev;
    if (state === "wrong")
      throw new Error(problem ? `${problem.message} ${problem.hint}` : "The configuration is not right.");
    if (state === "conflict") throw new Error("Somebody else has changed the configuration.");
    await new Promise<void>((done) => {
      const stop = draft.subscribe(() => {
        stop();
        done();
      });
    });
  }
}
