import { useEffect, useRef } from "react";
import { getFloats } from "../api/client";
import { useAnswer } from "../api/useAnswer";
import type { DatasetDetail, EpisodeDetail, EpisodeSensor, RunDetail, RunSummary } from "../api/types";
import { href } from "../app/routes";
import { useTheme } from "../app/theme";
import { colourName, colourOf } from "../rig/kinds";
import { drawFromAbove } from "./fromAbove";

/** After a run: the last frame of the newest episode that it has committed itself. */
export function LastFrame({ run }: { run: RunSummary }) {
  const base = `/datasets/${encodeURIComponent(run.dataset)}`;
  const own = useAnswer<RunDetail>(`/runs/${run.run_id}`, run.state);
  const committed = own.data?.committed ?? [];
  const dataset = useAnswer<DatasetDetail>(committed.length > 0 ? base : null, run.state);
  const there = new Map(dataset.data?.episodes.map((one) => [one.episode_id, one]));
  const episode = [...committed].reverse().flatMap((id) => there.get(id) ?? [])[0];
  const path = episode ? `${base}/episodes/${episode.episode_id}` : null;
  const detail = useAnswer<EpisodeDetail>(path);
  const shown = detail.data?.sensors.filter((sensor) => sensor.data !== "none") ?? [];
  if (!episode || !path || shown.length === 0) {
    const error = own.error ?? dataset.error ?? detail.error;
    const loading = own.loading || dataset.loading || detail.loading;
    return (
      <section className="panel thumbs-empty" aria-label="Pictures">
        <p className="empty">
          {error ?? (loading ? "Loading…" : committed.length === 0 ? "This run has committed no episode." : "Its episodes are not in the dataset any more, or have no pictures.")}
        </p>
      </section>
    );
  }
  const k = episode.frames - 1;
  return (
    <section className="thumbs" aria-label="Last pictures">
      {shown.map((sensor) => (
        <a
          key={sensor.id}
          className="thumb"
          data-sensor={sensor.id}
          href={href({ page: "episode", dataset: run.dataset, episode: episode.episode_id })}
          style={{ "--colour": colourOf(sensor.kind) } as React.CSSProperties}
        >
          {sensor.data === "image" ? (
            <img className="thumb-picture" src={`api${path}/sensors/${sensor.id}/${k}.png?width=480`} alt={`${sensor.id}, last frame`} />
          ) : (
            <LastPoints path={`${path}/points/${sensor.id}/${k}`} sensor={sensor} />
          )}
          <span className="thumb-name">
            <span className="dot" />
            {sensor.id}
          </span>
        </a>
      ))}
    </section>
  );
}

/** The points of the last frame from above, as while the run went on. */
function LastPoints({ path, sensor }: { path: string; sensor: EpisodeSensor }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [theme] = useTheme();
  useEffect(() => {
    const stop = new AbortController();
    getFloats(path, stop.signal).then(
      (points) => {
        if (canvas.current) drawFromAbove(canvas.current, points, sensor.data === "radar" ? "radar" : "points", colourName(sensor.kind));
      },
      (error: unknown) => {
        if (!stop.signal.aborted) console.info("points could not be read", error);
      },
    );
    return () => stop.abort();
  }, [path, sensor, theme]);
  return <canvas ref={canvas} className="thumb-picture" width={320} height={180} role="img" aria-label={`${sensor.id}, last frame`} />;
}
