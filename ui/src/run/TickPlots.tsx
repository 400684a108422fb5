import { useMemo, useState } from "react";
import { live } from "../api/live";
import type { RunSummary } from "../api/types";
import { useStore } from "../state/store";
import { LineChart } from "../ui/LineChart";
import { ALL, LOAD, ofWorker, QUEUE, SAVED_FRAMES, STEP_TIME } from "./curves";
import { isActive } from "./states";

/** How fast a run is and what it takes of the machine, over time; of several workers, each or all. */
export function TickPlots({ run }: { run: RunSummary }) {
  const { ticks, loads } = useStore(live, (now) => now);
  const [worker, setWorker] = useState(ALL);
  const workers = useMemo(() => [...new Set(ticks.map((tick) => tick.worker ?? ALL))].filter((one) => one !== ALL).sort((a, b) => a - b), [ticks]);
  const chosen = workers.includes(worker) ? worker : ALL;
  const begin = run.started ?? ticks[0]?.time ?? loads[0]?.time ?? 0;
  const [own, taken] = useMemo(() => ofWorker(ticks, loads, chosen), [ticks, loads, chosen]);
  const waited = (chosen === ALL ? workers : []).reduce((sum, one) => sum + (own.findLast((tick) => tick.worker === one)?.waited_s ?? 0), 0) || (own.at(-1)?.waited_s ?? 0);
  const shown = [SAVED_FRAMES, ...(chosen !== ALL || workers.length === 0 ? [STEP_TIME] : []), ...LOAD, QUEUE];
  const measured = ticks.length > 0 || loads.length > 0;
  return (
    <section className="panel plots" aria-label="Speed and load">
      <h2 className="sr-only">Speed and load</h2>
      {workers.length > 0 && (
        <div className="segments small" role="group" aria-label="Workers">
          {[ALL, ...workers].map((one) => (
            <button key={one} type="button" className="segment" aria-pressed={one === chosen} onClick={() => setWorker(one)}>
              {one === ALL ? "all" : `worker ${one}`}
            </button>
          ))}
        </div>
      )}
      {!measured && <p className="empty">{isActive(run) || run.alive === "queued" ? "No measurements yet" : "No measurements"}</p>}
      {measured && (
        <div className="plot-grid">
          {shown.map((one) => (
            <LineChart
              key={one.title}
              title={one.title}
              over={!isActive(run)}
              lines={[{ points: one.points(own, taken, begin), colour: one.colour }]}
              note={one === QUEUE ? (waited > 0.05 ? `steps have waited ${waited.toFixed(1)} s in all` : "no step has waited") : undefined}
              format={one.format}
            />
          ))}
        </div>
      )}
    </section>
  );
}
