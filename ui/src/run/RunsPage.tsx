import { useState } from "react";
import { live } from "../api/live";
import type { RunSummary } from "../api/types";
import { changeQuery, useQuery } from "../app/query";
import { href } from "../app/routes";
import { useStore } from "../state/store";
import { count, day, duration } from "../ui/format";
import { chosenRuns, MOST_COMPARED, withRun } from "./selection";
import { isActive, stateOf } from "./states";

const KINDS = {
  all: () => true,
  active: (run: RunSummary) => isActive(run) || run.alive === "queued",
  done: (run: RunSummary) => run.alive === "ended" && run.state === "done",
  "not finished": (run: RunSummary) => run.alive === "dead" || (run.alive === "ended" && run.state !== "done"),
};
const NUMBERS = new Set(["Took", "Episodes", "Failed", "Steps/s", "Workers"]);
type Kind = keyof typeof KINDS;

/** All runs in one table: filtered, and some of them chosen to be compared. */
export default function RunsPage() {
  const runs = useStore(live, (now) => now.runs);
  const [kind, setKind] = useState<Kind>("all");
  const [words, setWords] = useState("");
  const chosen = chosenRuns(useQuery());
  const search = chosen.map((run) => `run=${encodeURIComponent(run)}`).join("&");
  const shown = runs.filter(
    (run) => KINDS[kind](run) && `${run.name} ${run.dataset} ${run.run_id}`.toLowerCase().includes(words.trim().toLowerCase()),
  );
  return (
    <main className="page">
      <header className="page-head">
        <h1>Runs</h1>
        <span className="muted" role="status">
          {shown.length === runs.length ? count(runs.length, "run") : `${shown.length} of ${count(runs.length, "run")}`}
        </span>
        <span className="spacer" />
        <input
          type="search"
          className="input compact"
          aria-label="Search the runs"
          placeholder="Name or dataset"
          value={words}
          onChange={(event) => setWords(event.target.value)}
        />
        <div className="segments small" role="group" aria-label="Runs to show">
          {(Object.keys(KINDS) as Kind[]).map((one) => (
            <button key={one} type="button" className="segment" aria-pressed={one === kind} onClick={() => setKind(one)}>
              {one}
            </button>
          ))}
        </div>
        {chosen.length > 1 ? (
          <a className="button primary" href={`${href({ page: "compare" })}?${search}`}>
            Compare {chosen.length} runs
          </a>
        ) : (
          <button type="button" className="button" disabled title="Choose two or more runs in the table">
            Compare
          </button>
        )}
      </header>
      <div className="panel table-scroll" tabIndex={0} role="region" aria-label="Table of runs">
        <table className="runs-table">
          <thead>
            <tr>
              <th scope="col">
                <span className="sr-only">Compare</span>
              </th>
              {["Run", "State", "Dataset", "Begun", "Took", "Episodes", "Failed", "Steps/s", "Workers"].map((name) => (
                <th key={name} scope="col" className={NUMBERS.has(name) ? "number-cell" : undefined}>
                  {name}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {shown.map((run) => (
              <RunRow key={run.run_id} run={run} chosen={chosen} />
            ))}
          </tbody>
        </table>
        {shown.length === 0 && <p className="empty">No run fits.</p>}
      </div>
    </main>
  );
}

function RunRow({ run, chosen }: { run: RunSummary; chosen: readonly string[] }) {
  const { text, tone } = stateOf(run);
  const { total = 0, committed = 0, skipped = 0, failed = 0 } = run.episodes;
  const until = run.ended ?? (isActive(run) ? Date.now() / 1000 : null);
  const rate = run.rate_ticks_s ?? run.mean_ticks_s;
  return (
    <tr>
      <td className="choose-cell">
        <input
          type="checkbox"
          aria-label={`Compare ${run.name || run.run_id}`}
          checked={chosen.includes(run.run_id)}
          disabled={!chosen.includes(run.run_id) && chosen.length >= MOST_COMPARED}
          onChange={(event) => changeQuery({ run: withRun(chosen, run.run_id, event.target.checked) })}
        />
      </td>
      <th scope="row">
        <a href={href({ page: "run", run: run.run_id })}>{run.name || run.run_id}</a>
      </th>
      <td>
        <span className={`badge badge-${tone}`}>{text}</span>
      </td>
      <td>
        <a href={href({ page: "datasets", dataset: run.dataset })}>{run.dataset.replaceAll("~", "/")}</a>
      </td>
      <td>{day(run.started)}</td>
      <td className="number-cell">{run.started && until ? duration(until - run.started) : "–"}</td>
      <td className="number-cell">
        {committed + skipped} of {total}
      </td>
      <td className="number-cell">{failed}</td>
      <td className="number-cell">{rate ? rate.toFixed(1) : "–"}</td>
      <td className="number-cell">{Math.max(1, run.workers?.length ?? 0)}</td>
    </tr>
  );
}
