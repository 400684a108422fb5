import { useSyncExternalStore } from "react";

/** The pages, in the part of the address after `#`, so that reload and links work without the server. */
export type Route =
  | { page: "configure" }
  | { page: "run"; run: string | null }
  | { page: "runs" }
  | { page: "compare" }
  | { page: "datasets"; dataset: string | null }
  | { page: "episode"; dataset: string; episode: string };

export function parseRoute(hash: string): Route {
  const [path = ""] = hash.replace(/^#\/?/, "").split("?");
  const parts = path.split("/").filter(Boolean).map(decodeURIComponent);
  const [page, first, second] = parts;
  if (page === "runs" || page === "compare") return { page };
  if (page === "run") return { page: "run", run: first ?? null };
  if (page === "datasets" && first && second) return { page: "episode", dataset: first, episode: second };
  if (page === "datasets") return { page: "datasets", dataset: first ?? null };
  return { page: "configure" };
}

/** @param query what of a page is shown: a tab, a frame, filters; see `query.ts`. */
export function href(route: Route, query: Record<string, string | number> = {}): string {
  const parts: string[] =
    route.page === "episode"
      ? ["datasets", route.dataset, route.episode]
      : route.page === "run"
        ? ["run", ...(route.run ? [route.run] : [])]
        : route.page === "datasets"
          ? ["datasets", ...(route.dataset ? [route.dataset] : [])]
          : [route.page];
  const search = new URLSearchParams(Object.entries(query).map(([key, value]) => [key, String(value)])).toString();
  return `#/${parts.map(encodeURIComponent).join("/")}${search && `?${search}`}`;
}

export function goTo(route: Route, query: Record<string, string | number> = {}): void {
  window.location.hash = href(route, query).slice(1);
}

function subscribe(listener: () => void): () => void {
  window.addEventListener("hashchange", listener);
  return () => window.removeEventListener("hashchange", listener);
}

let last: { path: string | undefined; route: Route } | null = null;
function current(): Route {
  const { hash } = window.location;
  const [path] = hash.split("?");
  if (last === null || last.path !== path) last = { path, route: parseRoute(hash) };
  return last.route;
}

export function useRoute(): Route {
  return useSyncExternalStore(subscribe, current);
}
