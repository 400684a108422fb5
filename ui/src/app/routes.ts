import { useSyncExternalStore } from "react";

/** The pages, in the part of the address after `#`, so that reload and links work without the server. */
export type Route =
  | { page: "configure" }
  | { page: "run"; run: string | null }
  | { page: "runs" }
  | { page: "datasets"; dataset: string | null }
  | { page: "episode"; dataset: string; episode: string };

export function parseRoute(hash: string): Route {
  const parts = hash.replace(/^#\/?/, "").split("/").filter(Boolean).map(decodeURIComponent);
  const [page, first, second] = parts;
  if (page === "runs") return { page: "runs" };
  if (page === "run") return { page: "run", run: first ?? null };
  if (page === "datasets" && first && second) return { page: "episode", dataset: first, episode: second };
  if (page === "datasets") return { page: "datasets", dataset: first ?? null };
  return { page: "configure" };
}

export function href(route: Route): string {
  const parts: string[] =
    route.page === "episode"
      ? ["datasets", route.dataset, route.episode]
      : route.page === "run"
        ? ["run", ...(route.run ? [route.run] : [])]
        : route.page === "runs"
          ? ["runs"]
          : route.page === "datasets"
          ? ["datasets", ...(route.dataset ? [route.dataset] : [])]
          : ["configure"];
  return `#/${parts.map(encodeURIComponent).join("/")}`;
}

export function goTo(route: Route): void {
  window.location.hash = href(route).slice(1);
}

function subscribe(listener: () => void): () => void {
  window.addEventListener("hashchange", listener);
  return () => window.removeEventListener("hashchange", listener);
}

let last: { hash: string; route: Route } | null = null;
function current(): Route {
  const { hash } = window.location;
  if (last?.hash !== hash) last = { hash, route: parseRoute(hash) };
  return last.route;
}

export function useRoute(): Route {
  return useSyncExternalStore(subscribe, current);
}
