import type { LoadPoint, TickPoint } from "../api/types";
import type { Point } from "../ui/LineChart";
import { bytes } from "../ui/format";

/** Points of a run as a whole; else of one of its workers. */
export const ALL = 0;
const OLD_S = 10;

/** What is drawn of a run over time. */
export interface Quantity {
  title: string;
  colour: string;
  format(value: number): string;
  points(ticks: readonly TickPoint[], loads: readonly LoadPoint[], begin: number): Point[];
}

export const SAVED_FRAMES: Quantity = {
  title: "Saved frames",
  colour: "var(--accent-text)",
  format: (value) => `${value.toPrecision(3)}/s`,
  points: (ticks, _loads, begin) => summed(ticks, begin, (tick) => tick.frames_s),
};
/** Of one worker alone: several have no common step. */
export const STEP_TIME: Quantity = {
  title: "Wall time per step",
  colour: "var(--accent-text)",
  format: (value) => `${value.toFixed(0)} ms`,
  points: (ticks, _loads, begin) => series(ticks, begin, (tick) => (tick.tick_s === null ? null : tick.tick_s * 1000)),
};
export const LOAD: readonly Quantity[] = [
  {
    title: "CPU",
    colour: "var(--good)",
    format: (value) => `${value.toFixed(value < 10 ? 1 : 0)} cores`,
    points: (_ticks, loads, begin) => series(loads, begin, (load) => load.cpu_cores),
  },
  {
    title: "Memory",
    colour: "var(--good)",
    format: bytes,
    points: (_ticks, loads, begin) => series(loads, begin, (load) => load.memory_bytes),
  },
  {
    title: "Written to disks",
    colour: "var(--warn)",
    format: (value) => `${bytes(value)}/s`,
    points: (_ticks, loads, begin) => series(loads, begin, (load) => load.written_bytes_s),
  },
];
export const QUEUE: Quantity = {
  title: "Queue for the disk",
  colour: "var(--warn)",
  format: bytes,
  points: (ticks, _loads, begin) => summed(ticks, begin, (tick) => tick.queued_bytes),
};

/** What of the points belongs to a worker; the load of all together is told by the run itself. */
export function ofWorker(ticks: readonly TickPoint[], loads: readonly LoadPoint[], worker: number): [TickPoint[], LoadPoint[]] {
  return [
    worker === ALL ? [...ticks] : ticks.filter((tick) => tick.worker === worker),
    loads.filter((load) => (load.worker ?? ALL) === worker),
  ];
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
