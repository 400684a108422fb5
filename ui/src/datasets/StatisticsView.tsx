import { useAnswer } from "../api/useAnswer";
import type { Statistics } from "../api/types";
import { words } from "../form/simple";

/** What the dataset holds, counted over its labels. */
export function StatisticsView({ base, version }: { base: string; version: number }) {
  const { data, error } = useAnswer<Statistics>(`${base}/statistics`, version);
  if (!data) return <p className="empty">{error ?? "Counting…"}</p>;
  const colours = Object.fromEntries(
    Object.entries(data.class_colours).map(([name, rgb]) => [name, `rgb(${rgb.join(",")})`]),
  );
  return (
    <div className="statistics">
      <h2 className="sr-only">Statistics</h2>
      <dl className="tiles">
        {(
          [
            ["Object labels", data.records],
            ["Different objects", data.tracks],
            ["Visible in a camera", data.visible],
          ] as const
        ).map(([name, value]) => (
          <div className="tile" key={name}>
            <dt>{name}</dt>
            <dd>{value.toLocaleString("en")}</dd>
          </div>
        ))}
      </dl>
      <div className="charts">
        <Bars title="Objects by class" counts={data.classes} colours={colours} />
        <Bars title="Frames by map" counts={shortened(data.frames_by_map)} />
        <Bars title="Frames by weather" counts={data.frames_by_weather} />
        {data.histograms.map((histogram) => (
          <Columns key={histogram.title} {...histogram} />
        ))}
      </div>
    </div>
  );
}

function shortened(counts: Record<string, number>): Record<string, number> {
  return Object.fromEntries(Object.entries(counts).map(([name, value]) => [name.split("/").at(-1) ?? name, value]));
}

function Bars({ title, counts, colours = {} }: { title: string; counts: Record<string, number>; colours?: Record<string, string> }) {
  const rows = Object.entries(counts).sort((a, b) => b[1] - a[1]);
  const most = Math.max(...rows.map(([, value]) => value), 1);
  return (
    <figure className="panel chart">
      <figcaption>
        <h2>{title}</h2>
      </figcaption>
      <dl className="bar-chart">
        {rows.map(([name, value]) => (
          <div key={name}>
            <dt>{words(name)}</dt>
            <dd>
              <span className="bar">
                <span style={{ width: `${(100 * value) / most}%`, background: colours[name] }} />
              </span>
              <b>{value.toLocaleString("en")}</b>
            </dd>
          </div>
        ))}
        {rows.length === 0 && <p className="muted">none</p>}
      </dl>
    </figure>
  );
}

function Columns({ title, bins, counts }: { title: string; bins: string[]; counts: number[] }) {
  const most = Math.max(...counts, 1);
  return (
    <figure className="panel chart">
      <figcaption>
        <h2>{title}</h2>
      </figcaption>
      <ol className="columns">
        {bins.map((bin, i) => (
          <li key={bin} title={`${bin}: ${(counts[i] ?? 0).toLocaleString("en")}`}>
            <span className="column">
              <span style={{ height: `${(100 * (counts[i] ?? 0)) / most}%` }} />
            </span>
            <span className="column-count">{(counts[i] ?? 0).toLocaleString("en", { notation: "compact" })}</span>
            <span className="column-name">{bin}</span>
          </li>
        ))}
      </ol>
    </figure>
  );
}
