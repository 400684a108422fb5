import { useEffect } from "react";
import { href } from "../app/routes";
import { live, watch } from "../api/live";
import type { RunSummary } from "../api/types";
import { useStore } from "../state/store";
import { DrivePanel } from "./DrivePanel";
import { LogView } from "./LogView";
import { Progress } from "./Progress";
import { RunHead } from "./RunHead";
import { RunList } from "./RunList";
import { isActive } from "./states";
import { Thumbnails } from "./Thumbnails";
import { TickPlots } from "./TickPlots";

/** One run as it goes on, and the list of all. */
export default function RunPage({ run: chosen }: { run: string | null }) {
  const { runs, connection } = useStore(live, (now) => now);
  const run = runs.find((one) => one.run_id === chosen) ?? (chosen === null ? newest(runs) : undefined);
  const id = run?.run_id ?? null;
  useEffect(() => watch(id, true), [id]);
  useEffect(() => () => watch(null, false), []);

  if (!run)
    return (
      <main className="page">
        <h1>Runs</h1>
        <p className="empty">
          {connection === "connecting" ? (
            "Asking the server…"
          ) : (
            <>
              {chosen ? "There is no such run. " : "Nothing has been recorded yet. "}
              <a href={href({ page: "configure" })}>Configure a run</a> and press Start.
            </>
          )}
        </p>
      </main>
    );
  return (
    <main className="page run-page">
      <div className="run-main">
        <RunHead run={run} />
        <Progress run={run} />
        {run.driven && isActive(run) && <DrivePanel key={run.run_id} run={run} driven={run.driven} />}
        <Thumbnails run={run} />
        <div className="run-lower">
          <TickPlots run={run} />
          <LogView run={run} />
        </div>
      </div>
      <RunList runs={runs} chosen={run.run_id} />
    </main>
  );
}

/** What goes on now, else what is newest. */
function newest(runs: readonly RunSummary[]): RunSummary | undefined {
  return runs.find((run) => run.alive === "running" || run.alive === "stalled") ?? runs[0];
}
