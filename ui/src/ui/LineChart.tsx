import { duration } from "./format";

interface Props {
  title: string;
  note?: string;
  points: readonly (readonly [number, number])[];
  format(value: number): string;
  colour: string;
}

const [WIDTH, HEIGHT] = [420, 96];
const MOST_DRAWN = 400;

/** A small line over seconds, with its newest and highest value in words. */
export function LineChart({ title, note, points, format, colour }: Props) {
  const last = points.at(-1);
  const shown = thinned(points);
  const top = Math.max(...shown.map(([, y]) => y), 1e-9);
  const end = Math.max(last?.[0] ?? 0, 1);
  const across = (x: number) => ((x / end) * WIDTH).toFixed(1);
  const path = shown
    .map(([x, y], i) => `${i === 0 ? "M" : "L"}${across(x)},${(HEIGHT - 4 - (y / top) * (HEIGHT - 10)).toFixed(1)}`)
    .join("");
  // From the first to the last that was measured: nothing is known beside them.
  const ground = HEIGHT - 4;
  const area = `${path}L${across(shown.at(-1)?.[0] ?? 0)},${ground}L${across(shown[0]?.[0] ?? 0)},${ground}Z`;
  return (
    <figure className="line-chart">
      <figcaption>
        <h3>{title}</h3>
        <span className="muted">
          {last ? `now ${format(last[1])}, at most ${format(top)}` : "not measured yet"}
          {note && last ? ` · ${note}` : ""}
        </span>
      </figcaption>
      <svg viewBox={`0 0 ${WIDTH} ${HEIGHT}`} preserveAspectRatio="none" role="img" aria-label={title}>
        <path className="chart-grid" d={`M0,${HEIGHT - 4}H${WIDTH}M0,${HEIGHT / 2}H${WIDTH}M0,6H${WIDTH}`} />
        {shown.length > 1 && (
          <>
            <path className="chart-area" d={area} fill={colour} fillOpacity={0.12} />
            <path className="chart-line" d={path} stroke={colour} />
          </>
        )}
      </svg>
      <div className="chart-axis">
        <span>0 s</span>
        <span>{duration(end)}</span>
      </div>
    </figure>
  );
}

/** At most so many points, each the highest of its share: peaks stay. */
export function thinned(points: readonly (readonly [number, number])[]): (readonly [number, number])[] {
  if (points.length <= MOST_DRAWN) return [...points];
  const share = points.length / MOST_DRAWN;
  return Array.from({ length: MOST_DRAWN }, (_, i) => {
    const part = points.slice(Math.floor(i * share), Math.floor((i + 1) * share));
    return part.reduce((best, one) => (one[1] > best[1] ? one : best), part[0] ?? [0, 0]);
  });
}
