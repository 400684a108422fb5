import { useSyncExternalStore } from "react";

/** What of a page is shown, in the address after `?`: reload, links and the browser's history keep it. */
const CHANGED = "carstage-query";

function subscribe(listener: () => void): () => void {
  window.addEventListener("hashchange", listener);
  window.addEventListener(CHANGED, listener);
  return () => {
    window.removeEventListener("hashchange", listener);
    window.removeEventListener(CHANGED, listener);
  };
}

function text(): string {
  const at = window.location.hash.indexOf("?");
  return at < 0 ? "" : window.location.hash.slice(at + 1);
}

let last = { text: "", query: new URLSearchParams() };
export function currentQuery(): URLSearchParams {
  const now = text();
  if (last.text !== now) last = { text: now, query: new URLSearchParams(now) };
  return last.query;
}

export function useQuery(): URLSearchParams {
  return useSyncExternalStore(subscribe, currentQuery);
}

export type QueryChange = Record<string, string | number | readonly string[] | null>;

/**
 * Change a part of the query; null takes a key out.
 *
 * @param step whether "back" returns to what was shown before.
 */
export function changeQuery(change: QueryChange, step = false): void {
  const next = new URLSearchParams(currentQuery());
  for (const [key, value] of Object.entries(change)) {
    next.delete(key);
    if (value === null) continue;
    for (const one of Array.isArray(value) ? value : [value]) next.append(key, String(one));
  }
  const [path = ""] = window.location.hash.split("?");
  const search = next.toString();
  const hash = `${path || "#/"}${search && `?${search}`}`;
  if (hash === window.location.hash) return;
  window.history[step ? "pushState" : "replaceState"](null, "", hash);
  window.dispatchEvent(new Event(CHANGED));
}

/** A whole number of the query. */
export function numberOf(query: URLSearchParams, key: string): number | null {
  const value = query.get(key);
  return value !== null && /^\d+$/.test(value) ? Number(value) : null;
}
