import { useState, type KeyboardEvent, type PointerEvent } from "react";
import { duration } from "./format";
import { useSize } from "./useSize";

export type Point = readonly [number, number];

interface Props {
  title: string;
  note?: string;
  /** Seconds, and what was measured then. */
  points: readonly Point[];
  format(value: number): string;
  colour: string;
}

const HEIGHT = 104;
const [LEFT, RIGHT, TOP, BOTTOM] = [58, 8, 6, 20];
const MOST_DRAWN = 400;
const LEAST_TICK_PX = 90;
const ROUND_S = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21600, 86400];

/** A line over seconds with axes; pointer and arrow keys read single values. */
export function LineChart({ title, note, points, format, colour }: Props) {
  const [host, { width }] = useSize<HTMLDivElement>();
  const [at, setAt] = useState<number | null>(null);
  const last = points.at(-1);
  const shown = thinned(points);
  const highest = Math.max(...shown.map(([, y]) => y), 0);
  const rows = axisTicks(0, highest, 3);
  const top = Math.max(rows.at(-1) ?? 0, highest, 1e-9);
  const [from, to] = [shown[0]?.[0] ?? 0, Math.max(last?.[0] ?? 0, (shown[0]?.[0] ?? 0) + 1)];
  const across = (x: number) => LEFT + ((x - from) / (to - from)) * Math.max(1, width - LEFT - RIGHT);
  const up = (y: number) => HEIGHT - BOTTOM - (y / top) * (HEIGHT - TOP - BOTTOM);
  const path = shown.map(([x, y], i) => `${i === 0 ? "M" : "L"}${across(x).toFixed(1)},${up(y).toFixed(1)}`).join("");
  const read = at === null ? undefined : shown[Math.min(at, shown.length - 1)];
  const point = (event: PointerEvent<HTMLDivElement>) => {
    const box = event.currentTarget.getBoundingClientRect();
    const x = from + ((event.clientX - box.left - LEFT) / Math.max(1, width - LEFT - RIGHT)) * (to - from);
    setAt(shown.length > 0 ? nearest(shown, x) : null);
  };
  const step = (event: KeyboardEvent<HTMLDivElement>) => {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way === undefined || shown.length === 0) return;
    event.preventDefault();
    setAt(Math.min(shown.length - 1, Math.max(0, (at ?? (way > 0 ? -1 : shown.length)) + way)));
  };
  return (
    <figure className="line-chart">
      <figcaption>
        <h3>{title}</h3>
        <span className="muted" role="status">
          {read
            ? `${format(read[1])} at ${duration(read[0])}`
            : last
              ? `now ${format(last[1])}, at most ${format(highest)}${note ? ` · ${note}` : ""}`
              : "not measured yet"}
        </span>
      </figcaption>
      <div
        ref={host}
        className="chart-body"
        tabIndex={0}
        role="group"
        aria-label={`${title}: arrow keys read values`}
        onPointerMove={point}
        onPointerLeave={() => setAt(null)}
        onBlur={() => setAt(null)}
        onKeyDown={step}
      >
        {width > 0 && shown.length > 1 && (
          <svg width={width} height={HEIGHT} role="img" aria-label={title}>
            {rows.map((value) => (
              <g key={value}>
                <path className="chart-grid" d={`M${LEFT},${up(value)}H${width - RIGHT}`} />
                <text className="chart-label" x={LEFT - 6} y={up(value) + 4} textAnchor="end">
                  {format(value)}
                </text>
              </g>
            ))}
            {axisTicks(from, to, Math.max(1, Math.floor((width - LEFT) / LEAST_TICK_PX)), true).map((value) => (
              <text key={value} className="chart-label" x={Math.min(across(value), width - 20)} y={HEIGHT - 4} textAnchor="middle">
                {duration(value)}
              </text>
            ))}
            {/* From the first to the last that was measured: nothing is known beside them. */}
            <path className="chart-area" d={`${path}V${up(0)}H${across(from)}Z`} fill={colour} fillOpacity={0.12} />
            <path className="chart-line" d={path} stroke={colour} />
            {read && (
              <>
                <path className="chart-read" d={`M${across(read[0])},${TOP}V${up(0)}`} />
                <circle cx={across(read[0])} cy={up(read[1])} r={3.5} fill={colour} />
              </>
            )}
          </svg>
        )}
      </div>
    </figure>
  );
}

/** Round values of an axis between two ends, about so many; of seconds, minutes and hours are round. */
export function axisTicks(low: number, high: number, about: number, seconds = false): number[] {
  if (!(high > low)) return [];
  const rough = (high - low) / about;
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = seconds ? ROUND_S : [1, 2, 5, 10].map((n) => n * power);
  const step = steps.find((one) => one >= rough) ?? Math.ceil(rough / 86400) * 86400;
  const first = Math.ceil(low / step);
  return Array.from({ length: Math.floor(high / step) - first + 1 }, (_, i) => (first + i) * step);
}

function nearest(points: readonly Point[], x: number): number {
  return points.reduce((best, [at], i) => (Math.abs(at - x) < Math.abs((points[best]?.[0] ?? 0) - x) ? i : best), 0);
}

/** At most so many points, each the highest of its share: peaks stay. */
export function thinned(points: readonly Point[]): Point[] {
  if (points.length <= MOST_DRAWN) return [...points];
  const share = points.length / MOST_DRAWN;
  return Array.from({ length: MOST_DRAWN }, (_, i) => {
    const part = points.slice(Math.floor(i * share), Math.floor((i + 1) * share));
    return part.reduce((best, one) => (one[1] > best[1] ? one : best), part[0] ?? [0, 0]);
  });
}
