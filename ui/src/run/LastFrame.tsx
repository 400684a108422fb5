import { useEffect, useRef, useState } from "react";
import { getFloats, sentence } from "../api/client";
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
          href={href({ page: "episode", dataset: run.dataset, episode: episode.episode_id }, { k })}
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

/** The last sweep from above, drawn as it was while the run went on. */
function LastPoints({ path, sensor }: { path: string; sensor: EpisodeSensor }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [note, setNote] = useState("");
  const [shown, setShown] = useState<number | null>(null);
  const [theme] = useTheme();
  const { kind, data, ego_from_sensor: pose } = sensor;
  useEffect(() => {
    const stop = new AbortController();
    getFloats(path, stop.signal).then(
      (points) => {
        if (!canvas.current) return;
        // The dataset's points are in the ego's axes, whose origin is on the ground.
        const height = pose?.[2]?.[3] ?? 0;
        for (let i = 2; i < points.length; i += 4) points[i] = (points[i] ?? 0) - height;
        drawFromAbove(canvas.current, points, data === "radar" ? "radar" : "points", colourName(kind));
        setShown(points.length / 4);
      },
      (error: unknown) => {
        if (!stop.signal.aborted) setNote(sentence(error));
      },
    );
    return () => stop.abort();
  }, [path, kind, data, pose, theme]);
  if (note) return <p className="empty">{note}</p>;
  return (
    <canvas
      ref={canvas}
      className="thumb-picture"
      width={320}
      height={320}
      role="img"
      data-points={shown ?? ""}
      aria-label={`${sensor.id} from above, last frame`}
    />
  );
}
