import { useMemo, type PointerEvent } from "react";

interface Props {
  title: string;
  unit: string;
  times: readonly number[];
  values: readonly (number | null)[];
  /** The frame that is shown. */
  k: number;
  digits: number;
  onSeek(k: number): void;
}

const [WIDTH, HEIGHT, MARGIN] = [400, 64, 4];
/** What is smaller is drawn as standing still, not blown up to the whole height. */
const LEAST_SPAN = 0.2;

/** One signal over an episode, with the frame that is shown; a press or drag goes to another. */
export function SignalPlot({ title, unit, times, values, k, digits, onSeek }: Props) {
  const end = times.at(-1) || 1;
  const { known, x, y, path } = useMemo(() => {
    const known = values.filter((value) => value !== null);
    const [low, high] = range(known);
    const x = (i: number) => ((times[i] ?? 0) / end) * WIDTH;
    const y = (value: number) => HEIGHT - MARGIN - ((value - low) / (high - low)) * (HEIGHT - 2 * MARGIN);
    return { known, x, y, path: line(values, x, y) };
  }, [times, values, end]);
  const now = values[k];
  const seek = (event: PointerEvent<SVGSVGElement>) => {
    if (event.buttons !== 1) return;
    const box = event.currentTarget.getBoundingClientRect();
    const goal = ((event.clientX - box.left) / box.width) * end;
    const next = times.findIndex((time) => time >= goal);
    onSeek(next < 0 ? times.length - 1 : next);
  };
  return (
    <figure className="signal">
      <figcaption>
        <h3>{title}</h3>
        <b>{now == null ? "–" : `${fixed(now, digits)} ${unit}`}</b>
        {known.length > 0 && (
          <span className="muted">
            {fixed(Math.min(...known), digits)} to {fixed(Math.max(...known), digits)}
          </span>
        )}
      </figcaption>
      <svg
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        preserveAspectRatio="none"
        role="img"
        aria-label={`${title} over the episode`}
        onPointerDown={seek}
        onPointerMove={seek}
      >
        <path className="chart-grid" d={`M0,${y(0)}H${WIDTH}`} />
        <path className="chart-line" d={path} stroke="var(--accent-text)" />
        <path className="signal-now" d={`M${x(k)},0V${HEIGHT}`} />
      </svg>
    </figure>
  );
}

/** So many digits; what rounds to zero has no sign. */
function fixed(value: number, digits: number): string {
  return (Number(value.toFixed(digits)) + 0).toFixed(digits);
}

/** Low and high end of the axis; zero is always on it. */
function range(values: readonly number[]): [number, number] {
  const low = Math.min(0, ...values);
  const high = Math.max(0, ...values);
  if (high - low >= LEAST_SPAN) return [low, high];
  return [low - LEAST_SPAN / 2, high + LEAST_SPAN / 2];
}

/** Interrupted where nothing is known. */
function line(values: readonly (number | null)[], x: (i: number) => number, y: (value: number) => number): string {
  let down = false;
  return values
    .map((value, i) => {
      if (value === null) {
        down = false;
        return "";
      }
      const part = `${down ? "L" : "M"}${x(i).toFixed(1)},${y(value).toFixed(1)}`;
      down = true;
      return part;
    })
    .join("");
}
