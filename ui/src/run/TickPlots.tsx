import { useMemo } from "react";
import { live } from "../api/live";
import type { TickPoint } from "../api/types";
import { useStore } from "../state/store";
import { LineChart } from "../ui/LineChart";
import { bytes } from "../ui/format";

/** Wall time per step, and sensor data that wait for the disk: whether it holds the simulator up. */
export function TickPlots() {
  const ticks = useStore(live, (now) => now.ticks);
  const times = useMemo(() => series(ticks, (tick) => (tick.tick_s === null ? null : tick.tick_s * 1000)), [ticks]);
  const queue = useMemo(() => series(ticks, (tick) => tick.queued_bytes), [ticks]);
  const waited = ticks.at(-1)?.waited_s ?? 0;
  return (
    <section className="panel plots" aria-label="Speed">
      <h2 className="sr-only">Speed</h2>
      <LineChart title="Wall time per step" points={times} format={(value) => `${value.toFixed(0)} ms`} colour="var(--accent-text)" />
      <LineChart
        title="Waiting for the disk"
        note={waited > 0.05 ? `steps have waited ${waited.toFixed(1)} s in all` : "no step has waited"}
        points={queue}
        format={bytes}
        colour="var(--warn)"
      />
    </section>
  );
}

function series(ticks: readonly TickPoint[], value: (tick: TickPoint) => number | null): [number, number][] {
  const first = ticks[0]?.time ?? 0;
  return ticks.flatMap((tick): [number, number][] => {
    const y = value(tick);
    return y === null ? [] : [[tick.time - first, y]];
  });
}
