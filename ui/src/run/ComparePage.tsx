import { useEffect, useState } from "react";
import { live } from "../api/live";
import type { ComparedRun, RunComparison, RunSummary } from "../api/types";
import { useAnswer } from "../api/useAnswer";
import { useQuery } from "../app/query";
import { href } from "../app/routes";
import { useStore } from "../state/store";
import { CommandButton } from "../ui/CommandDialog";
import { bytes, count, day, duration } from "../ui/format";
import { LineChart } from "../ui/LineChart";
import { ALL, LOAD, ofWorker, QUEUE, SAVED_FRAMES } from "./curves";
import { chosenRuns, RUN_COLOURS, RUN_DASHES, valueText } from "./selection";
import { isActive, stateOf } from "./states";

const AGAIN_MS = 5000;
type Figures = NonNullable<ComparedRun["figures"]>;

const FIGURES: readonly (readonly [string, (run: RunSummary, figures: Figures | null) => string])[] = [
  ["Dataset", (run) => run.dataset.replaceAll("~", "/")],
  ["Begun", (run) => day(run.started)],
  ["Took", (_run, figures) => duration(figures?.took_s)],
  ["Episodes", (_run, figures) => (figures ? `${figures.episodes} of ${figures.planned}` : "–")],
  ["Failed", (_run, figures) => (figures ? String(figures.failed) : "–")],
  ["Saved frames", (_run, figures) => figures?.frames.toLocaleString("en") ?? "–"],
  ["Saved frames per second", (_run, figures) => figures?.frames_s?.toFixed(2) ?? "–"],
  ["CPU, mean", (_run, figures) => (figures?.cpu_cores ? `${figures.cpu_cores.toFixed(2)} cores` : "–")],
  ["Memory, at most", (_run, figures) => bytes(figures?.memory_bytes)],
  ["Written to disks", (_run, figures) => bytes(figures?.written_bytes)],
];

/** Several runs beside each other: figures, settings that differ, curves on common axes. */
export default function ComparePage() {
  const ids = chosenRuns(useQuery());
  const runs = useStore(live, (now) => now.runs);
  const known = ids.flatMap((id) => runs.find((run) => run.run_id === id) ?? []);
  const version = useVersion(known);
  const search = ids.map((id) => `run=${encodeURIComponent(id)}`).join("&");
  const { data, error } = useAnswer<RunComparison>(ids.length > 1 ? `/comparison?${search}` : null, version);
  return (
    <main className="page">
      <header className="page-head">
        <h1>Runs compared</h1>
        <span className="muted">{count(ids.length, "run")}</span>
        <span className="spacer" />
        <a className="button small" href={`${href({ page: "runs" })}${search && `?${search}`}`}>
          Choose runs
        </a>
        {data && <CommandButton command={{ do: "compare-runs", run_ids: ids }} />}
      </header>
      {data ? (
        <Comparison data={data} live={known} />
      ) : (
        <p className={error ? "empty page-error" : "empty"}>
          {error ?? (ids.length < 2 ? "Choose two or more runs in the table of all runs." : "Loading…")}
        </p>
      )}
    </main>
  );
}

function Comparison({ data, live: known }: { data: RunComparison; live: readonly RunSummary[] }) {
  const runs = data.runs.map((one) => ({ ...one, run: known.find((now) => now.run_id === one.run.run_id) ?? one.run }));
  const measured = runs.some((one) => (one.ticks ?? []).length > 0 || (one.loads ?? []).length > 0);
  return (
    <>
      <div className="panel table-scroll compare-scroll" tabIndex={0} role="region" aria-label="Figures and settings">
        <table className="runs-table compare-table">
          <thead>
            <tr>
              <th scope="col">Run</th>
              {runs.map(({ run }, i) => (
                <th key={run.run_id} scope="col">
                  <svg className="line-sample" viewBox="0 0 24 8" aria-hidden="true">
                    <path d="M0,4H24" stroke={RUN_COLOURS[i]} strokeDasharray={RUN_DASHES[i]} />
                  </svg>
                  <a href={href({ page: "run", run: run.run_id })}>{run.name || run.run_id}</a>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            <tr>
              <th scope="row">State</th>
              {runs.map(({ run }) => (
                <td key={run.run_id}>
                  <span className={`badge badge-${stateOf(run).tone}`}>{stateOf(run).text}</span>
                </td>
              ))}
            </tr>
            {FIGURES.map(([title, text]) => (
              <tr key={title}>
                <th scope="row">{title}</th>
                {runs.map(({ run, figures }) => (
                  <td key={run.run_id}>{text(run, figures ?? null)}</td>
                ))}
              </tr>
            ))}
          </tbody>
          <tbody aria-label="Settings that differ">
            <tr className="compare-part">
              <th scope="rowgroup" colSpan={runs.length + 1}>
                {data.note || (data.settings.length > 0 ? "Settings that differ" : "No setting differs")}
              </th>
            </tr>
            {data.settings.map(({ path, title, values }) => (
              <tr key={path}>
                <th scope="row" title={path}>
                  {title || path}
                  {title && path.includes(".") && <code className="muted">{path}</code>}
                </th>
                {values.map((value, i) => (
                  <td key={runs[i]?.run.run_id ?? i} className="setting-cell">
                    {valueText(value)}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <section className="panel plots" aria-label="Speed and load">
        <h2 className="sr-only">Speed and load</h2>
        {!measured && <p className="empty">No measurements</p>}
        {measured && (
          <div className="plot-grid">
            {[SAVED_FRAMES, ...LOAD, QUEUE].map((quantity) => (
              <LineChart
                key={quantity.title}
                title={quantity.title}
                format={quantity.format}
                lines={runs.map((one, i) => ({
                  name: one.run.name || one.run.run_id,
                  points: quantity.points(...ofWorker(one.ticks ?? [], one.loads ?? [], ALL), one.run.started ?? one.loads?.[0]?.time ?? 0),
                  colour: RUN_COLOURS[i] ?? "var(--muted)",
                  dash: RUN_DASHES[i],
                }))}
              />
            ))}
          </div>
        )}
      </section>
    </>
  );
}

/** Changes when the runs are to be asked about anew: one has ended, or goes on and some seconds have passed. */
function useVersion(runs: readonly RunSummary[]): string {
  const [turn, setTurn] = useState(0);
  const going = runs.some(isActive);
  useEffect(() => {
    if (!going) return;
    const timer = window.setInterval(() => setTurn((now) => now + 1), AGAIN_MS);
    return () => window.clearInterval(timer);
  }, [going]);
  return `${turn} ${runs.map((run) => `${run.alive} ${run.state} ${run.name}`).join(",")}`;
}
