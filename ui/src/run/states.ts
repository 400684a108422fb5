import type { RunSummary } from "../api/types";

export interface RunState {
  text: string;
  tone: "live" | "good" | "bad" | "warn" | "plain";
}

/** How a run is, in a word or two. */
export function stateOf(run: RunSummary): RunState {
  if (run.alive === "queued") return { text: `queued, place ${run.position}`, tone: "plain" };
  if (run.alive === "stalled") return { text: "stalled", tone: "warn" };
  if (run.alive === "dead") return { text: "died", tone: "bad" };
  if (run.alive === "running" && (run.stop ?? 0) > 0) return { text: "stopping", tone: "warn" };
  switch (run.state) {
    case "done":
      return (run.episodes.failed ?? 0) > 0 ? { text: "done, with failures", tone: "warn" } : { text: "done", tone: "good" };
    case "failed":
      return { text: "failed", tone: "bad" };
    case "interrupted":
      return { text: "stopped", tone: "warn" };
    default:
      return { text: run.state, tone: "live" };
  }
}

export function isActive(run: RunSummary): boolean {
  return run.alive === "running" || run.alive === "stalled";
}

/** What ended before it had a folder has recorded nothing: there may be no dataset. */
export function mayHaveDataset(run: RunSummary): boolean {
  return Boolean(run.folder) || isActive(run) || run.alive === "queued";
}
