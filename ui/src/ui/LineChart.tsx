import { useState, type KeyboardEvent, type PointerEvent } from "react";
import { duration } from "./format";
import { useSize } from "./useSize";

export type Point = readonly [number, number];

/** Seconds, and what was measured then; of several lines, whose it is. */
export interface Line {
  name?: string;
  points: readonly Point[];
  colour: string;
  /** Dashes tell lines apart without their colours. */
  dash?: string;
}

interface Props {
  title: string;
  note?: string;
  /** Nothing more is measured: the last value is not what is now. */
  over?: boolean;
  lines: readonly Line[];
  format(value: number): string;
}

const HEIGHT = 104;
const [LEFT, RIGHT, TOP, BOTTOM] = [66, 8, 6, 20];
/** Half of the longest time below the axis. */
const HALF_LABEL_PX = 32;
const MOST_DRAWN = 400;
const LEAST_TICK_PX = 90;
const ROUND_S = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 21600, 86400];

/** Lines over seconds on common axes; pointer and arrow keys read single values. */
export function LineChart({ title, note, over, lines, format }: Props) {
  const [host, { width }] = useSize<HTMLDivElement>();
  const [at, setAt] = useState<number | null>(null);
  const shown = lines.map((line) => ({ ...line, points: thinned(line.points) }));
  const times = [...new Set(shown.flatMap(({ points }) => points.map(([x]) => x)))].sort((a, b) => a - b);
  const highest = Math.max(0, ...shown.flatMap(({ points }) => points.map(([, y]) => y)));
  const rows = axisTicks(0, highest, 3);
  const top = Math.max(rows.at(-1) ?? 0, highest, 1e-9);
  const from = times[0] ?? 0;
  const to = Math.max(times.at(-1) ?? 0, from + 1);
  const across = (x: number) => LEFT + ((x - from) / (to - from)) * Math.max(1, width - LEFT - RIGHT);
  const up = (y: number) => HEIGHT - BOTTOM - (y / top) * (HEIGHT - TOP - BOTTOM);
  const time = at === null ? undefined : times[nearest(times, at)];
  const point = (event: PointerEvent<HTMLDivElement>) => {
    const box = event.currentTarget.getBoundingClientRect();
    setAt(from + ((event.clientX - box.left - LEFT) / Math.max(1, width - LEFT - RIGHT)) * (to - from));
  };
  const step = (event: KeyboardEvent<HTMLDivElement>) => {
    const way = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (way === undefined || times.length === 0) return;
    event.preventDefault();
    const here = at === null ? (way > 0 ? -1 : times.length) : nearest(times, at);
    setAt(times[Math.min(times.length - 1, Math.max(0, here + way))] ?? null);
  };
  return (
    <figure className="line-chart">
      <figcaption>
        <h3>{title}</h3>
        <span className="muted" role="status">
          {time === undefined ? overview(shown, highest, format, over, note) : reading(shown, time, format)}
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
        {width > 0 && times.length > 1 && (
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
              <text key={value} className="chart-label" x={Math.min(across(value), width - HALF_LABEL_PX)} y={HEIGHT - 4} textAnchor="middle">
                {duration(value)}
              </text>
            ))}
            {shown.map(({ points, colour, dash }, i) => {
              const path = points.map(([x, y], k) => `${k === 0 ? "M" : "L"}${across(x).toFixed(1)},${up(y).toFixed(1)}`).join("");
              // From the first to the last that was measured: nothing is known beside them.
              const area = shown.length === 1 && `${path}V${up(0)}H${across(points[0]?.[0] ?? from)}Z`;
              return (
                <g key={i}>
                  {area && <path className="chart-area" d={area} fill={colour} fillOpacity={0.12} />}
                  <path className="chart-line" d={path} stroke={colour} strokeDasharray={dash} />
                </g>
              );
            })}
            {time !== undefined && <path className="chart-read" d={`M${across(time)},${TOP}V${up(0)}`} />}
            {time !== undefined &&
              shown.map(({ points, colour }, i) => {
                const read = readAt(points, time);
                return read && <circle key={i} cx={across(read[0])} cy={up(read[1])} r={3.5} fill={colour} />;
              })}
          </svg>
        )}
      </div>
    </figure>
  );
}

/** What is said of a chart that nobody reads a value of. */
function overview(lines: readonly Line[], highest: number, format: (value: number) => string, over?: boolean, note?: string): string {
  const [only] = lines;
  if (lines.every(({ points }) => points.length === 0)) return lines.length > 1 ? "not measured" : "not measured yet";
  const most = `at most ${format(highest)}`;
  const last = lines.length === 1 ? only?.points.at(-1) : undefined;
  return `${last ? `${over ? "at the end" : "now"} ${format(last[1])}, ` : ""}${most}${note ? ` · ${note}` : ""}`;
}

/** The values at a time; of several lines, of those that were measured then. */
function reading(lines: readonly Line[], time: number, format: (value: number) => string): string {
  const read = lines.flatMap(({ name, points }) => {
    const found = readAt(points, time);
    return found ? [`${name === undefined ? "" : `${name} `}${format(found[1])}`] : [];
  });
  return `${read.join(", ")} at ${duration(time)}`;
}

/** The point that is nearest to a time within the measured span; undefined beside it. */
export function readAt(points: readonly Point[], time: number): Point | undefined {
  const [first, last] = [points[0], points.at(-1)];
  if (!first || !last || time < first[0] || time > last[0]) return undefined;
  return points[nearest(points.map(([x]) => x), time)];
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

/** Where in a list of times the nearest one is. */
function nearest(times: readonly number[], x: number): number {
  return times.reduce((best, time, i) => (Math.abs(time - x) < Math.abs((times[best] ?? 0) - x) ? i : best), 0);
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
