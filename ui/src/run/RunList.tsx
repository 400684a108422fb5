import { href } from "../app/routes";
import { listKeys } from "../app/Shortcuts";
import type { RunSummary } from "../api/types";
import { day, percent } from "../ui/format";
import { isActive, stateOf } from "./states";

/** The queue and what has been, newest first. */
export function RunList({ runs, chosen }: { runs: readonly RunSummary[]; chosen: string }) {
  return (
    <aside className="panel run-list" aria-label="All runs">
      <header className="panel-head">
        <h2>Runs</h2>
        <span className="muted">{runs.length}</span>
        <span className="spacer" />
        <a href={href({ page: "runs" })}>Table of all runs</a>
      </header>
      <ul onKeyDown={listKeys}>
        {runs.map((run) => {
          const { text, tone } = stateOf(run);
          return (
            <li key={run.run_id}>
              <a
                className="run-row"
                href={href({ page: "run", run: run.run_id })}
                aria-current={run.run_id === chosen ? "true" : undefined}
              >
                <span className="run-name">{run.name}</span>
                <span className={`badge badge-${tone}`}>{isActive(run) ? percent(run.progress ?? 0) : text}</span>
                <span className="muted run-when">
                  {run.dataset.replaceAll("~", "/")} · {day(run.started)}
                </span>
              </a>
            </li>
          );
        })}
      </ul>
    </aside>
  );
}
