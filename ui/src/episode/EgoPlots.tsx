import { useMemo } from "react";
import { useAnswer } from "../api/useAnswer";
import type { EgoSignals } from "../api/types";
import { SignalPlot } from "./SignalPlot";

interface Props {
  base: string;
  times: readonly number[];
  k: number;
  onSeek(k: number): void;
}

const KMH = 3.6;

/** How the ego drove: speed, acceleration, steering. Nothing where its motion was not recorded. */
export function EgoPlots({ base, times, k, onSeek }: Props) {
  const { data } = useAnswer<EgoSignals>(`${base}/ego`);
  const speed = useMemo(() => data?.speed_m_s.map((value) => (value === null ? null : value * KMH)) ?? [], [data]);
  if (!data || speed.length === 0) return null;
  const shared = { times, k, onSeek };
  return (
    <section className="panel signals" aria-label="How the ego drove">
      <h2 className="sr-only">How the ego drove</h2>
      <SignalPlot title="Speed" unit="km/h" digits={1} values={speed} {...shared} />
      <SignalPlot title="Acceleration" unit="m/s²" digits={2} values={data.acceleration_m_s2} {...shared} />
      <SignalPlot title="Steering" unit="" digits={2} values={data.steer} {...shared} />
    </section>
  );
}
