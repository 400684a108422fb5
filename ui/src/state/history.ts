import { equal, type JsonObject } from "./json";

/** A document with its undo steps. Changes of one gesture (a drag, typing in one field) are one step. */
export interface History {
  readonly present: JsonObject;
  readonly past: readonly JsonObject[];
  readonly future: readonly JsonObject[];
  readonly gesture: string | null;
}

export type HistoryAction =
  | { type: "edit"; document: JsonObject; gesture?: string }
  | { type: "endGesture" }
  | { type: "undo" }
  | { type: "redo" }
  | { type: "adopt"; document: JsonObject };

const MOST_STEPS = 200;

export function emptyHistory(document: JsonObject): History {
  return { present: document, past: [], future: [], gesture: null };
}

export function reduceHistory(state: History, action: HistoryAction): History {
  switch (action.type) {
    case "edit": {
      if (equal(state.present, action.document)) return state;
      const gesture = action.gesture ?? null;
      if (gesture !== null && gesture === state.gesture)
        return { ...state, present: action.document, future: [] };
      const past = [...state.past, state.present].slice(-MOST_STEPS);
      return { present: action.document, past, future: [], gesture };
    }
    case "endGesture":
      return state.gesture === null ? state : { ...state, gesture: null };
    case "undo": {
      const before = state.past.at(-1);
      if (before === undefined) return state;
      const future = [state.present, ...state.future];
      return { present: before, past: state.past.slice(0, -1), future, gesture: null };
    }
    case "redo": {
      const [after, ...future] = state.future;
      if (after === undefined) return state;
      return { present: after, past: [...state.past, state.present], future, gesture: null };
    }
    case "adopt":
      // Somebody else's change: undo must not silently bring back what they replaced.
      return equal(state.present, action.document) ? state : emptyHistory(action.document);
  }
}
