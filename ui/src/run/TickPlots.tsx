import { useMemo, useState } from "react";
import { live } from "../api/live";
import type { LoadPoint, RunSummary, TickPoint } from "../api/types";
import { useStore } from "../state/store";
import { LineChart, type Point } from "../ui/LineChart";
import { bytes } from "../ui/format";

const ALL = 0;
const OLD_S = 10;

/** How fast a run is and what it takes of the machine, over time; of several workers, each or all. */
export function TickPlots({ run }: { run: RunSummary }) {
  const { ticks, loads } = useStore(live, (now) => now);
  const [worker, setWorker] = useState(ALL);
  const workers = useMemo(() => [...new Set(ticks.map((tick) => tick.worker ?? ALL))].filter((one) => one !== ALL).sort((a, b) => a - b), [ticks]);
  const chosen = workers.includes(worker) ? worker : ALL;
  const begin = run.started ?? ticks[0]?.time ?? loads[0]?.time ?? 0;
  const own = useMemo(() => (chosen === ALL ? ticks : ticks.filter((tick) => tick.worker === chosen)), [ticks, chosen]);
  const taken = useMemo(() => loads.filter((load) => (load.worker ?? ALL) === chosen), [loads, chosen]);
  const waited = (chosen === ALL ? workers : []).reduce((sum, one) => sum + (own.findLast((tick) => tick.worker === one)?.waited_s ?? 0), 0) || (own.at(-1)?.waited_s ?? 0);
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
      <div className="plot-grid">
        <LineChart title="Saved frames" points={summed(own, begin, (tick) => tick.frames_s)} format={perSecond} colour="var(--accent-text)" />
        {(chosen !== ALL || workers.length === 0) && (
          <LineChart title="Wall time per step" points={series(own, begin, (tick) => scaled(tick.tick_s, 1000))} format={milliseconds} colour="var(--accent-text)" />
        )}
        <LineChart title="CPU" points={series(taken, begin, (load) => load.cpu_cores)} format={cores} colour="var(--good)" />
        <LineChart title="Memory" points={series(taken, begin, (load) => load.memory_bytes)} format={bytes} colour="var(--good)" />
        <LineChart title="Written to disks" points={series(taken, begin, (load) => load.written_bytes_s)} format={bytesPerSecond} colour="var(--warn)" />
        <LineChart
          title="Queue for the disk"
          note={waited > 0.05 ? `steps have waited ${waited.toFixed(1)} s in all` : "no step has waited"}
          points={summed(own, begin, (tick) => tick.queued_bytes)}
          format={bytes}
          colour="var(--warn)"
        />
      </div>
    </section>
  );
}

const perSecond = (value: number) => `${value.toPrecision(3)}/s`;
const milliseconds = (value: number) => `${value.toFixed(0)} ms`;
const cores = (value: number) => `${value.toFixed(value < 10 ? 1 : 0)} cores`;
const bytesPerSecond = (value: number) => `${bytes(value)}/s`;

function scaled(value: number | null, factor: number): number | null {
  return value === null ? null : value * factor;
}

/** What was measured, over seconds since the run's begin. */
function series<P extends TickPoint | LoadPoint>(points: readonly P[], begin: number, value: (point: P) => number | null | undefined): Point[] {
  return points.flatMap((point): Point[] => {
    const y = value(point);
    return y === null || y === undefined ? [] : [[Math.max(0, point.time - begin), y]];
  });
}

/** The same of all workers together: the newest of each, as long as it is not old. */
function summed(ticks: readonly TickPoint[], begin: number, value: (tick: TickPoint) => number | null | undefined): Point[] {
  const newest = new Map<number, [time: number, value: number]>();
  return ticks.flatMap((tick): Point[] => {
    const y = value(tick);
    if (y === null || y === undefined) return [];
    newest.set(tick.worker ?? ALL, [tick.time, y]);
    let sum = 0;
    for (const [time, one] of newest.values()) if (tick.time - time < OLD_S) sum += one;
    return [[Math.max(0, tick.time - begin), sum]];
  });
}
