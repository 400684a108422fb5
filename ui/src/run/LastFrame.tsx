import { useAnswer } from "../api/useAnswer";
import type { DatasetDetail, EpisodeDetail, RunSummary } from "../api/types";
import { href } from "../app/routes";
import { colourOf } from "../rig/kinds";

/** After a run: the last pictures of its newest episode, out of the dataset. */
export function LastFrame({ run }: { run: RunSummary }) {
  const base = `/datasets/${encodeURIComponent(run.dataset)}`;
  const dataset = useAnswer<DatasetDetail>(base, run.state);
  const episode = dataset.data?.episodes.at(-1);
  const path = episode ? `${base}/episodes/${episode.episode_id}` : null;
  const detail = useAnswer<EpisodeDetail>(path);
  const cameras = detail.data?.sensors.filter((sensor) => sensor.data === "image") ?? [];
  if (!episode || cameras.length === 0)
    return (
      <section className="panel thumbs-empty" aria-label="Pictures">
        <p className="empty">
          {dataset.loading || detail.loading
            ? "Loading…"
            : "Live pictures are there while a run goes on; this one has committed no episode."}
        </p>
      </section>
    );
  return (
    <section className="thumbs" aria-label="Last pictures">
      {cameras.map(({ id, kind }) => (
        <a
          key={id}
          className="thumb"
          href={href({ page: "episode", dataset: run.dataset, episode: episode.episode_id })}
          style={{ "--colour": colourOf(kind) } as React.CSSProperties}
        >
          <img
            className="thumb-picture"
            src={`api${path}/sensors/${id}/${episode.frames - 1}.png?width=480`}
            alt={`${id}, last frame`}
          />
          <span className="thumb-name">
            <span className="dot" />
            {id}
          </span>
        </a>
      ))}
    </section>
  );
}
