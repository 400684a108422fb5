import { useState } from "react";
import type { EpisodeSummary } from "../api/types";
import { href } from "../app/routes";
import { bytes, count, duration } from "../ui/format";

const FIRST = 60;

/** Episodes as cards, each with a picture of its middle frame. */
export function EpisodeList({ dataset, episodes }: { dataset: string; episodes: readonly EpisodeSummary[] }) {
  const [shown, setShown] = useState(FIRST);
  if (episodes.length === 0) return <p className="empty">No episode has been committed yet.</p>;
  return (
    <>
      <ul className="episode-cards">
        {episodes.slice(0, shown).map((episode) => (
          <li key={episode.episode_id}>
            <EpisodeCard dataset={dataset} episode={episode} />
          </li>
        ))}
      </ul>
      {episodes.length > shown && (
        <p className="button-row">
          <span className="muted">
            {shown} of {count(episodes.length, "episode")}
          </span>
          <button type="button" className="button" onClick={() => setShown(shown + 5 * FIRST)}>
            Show more
          </button>
        </p>
      )}
    </>
  );
}

function EpisodeCard({ dataset, episode }: { dataset: string; episode: EpisodeSummary }) {
  const base = `/datasets/${encodeURIComponent(dataset)}/episodes/${episode.episode_id}`;
  return (
    <a className="panel episode-card" href={href({ page: "episode", dataset, episode: episode.episode_id })}>
      {episode.thumbnail ? (
        <img
          src={`api${base}/sensors/${episode.thumbnail}/${Math.floor(episode.frames / 2)}.png?width=480`}
          alt=""
          loading="lazy"
        />
      ) : (
        <span className="card-blank" />
      )}
      <span className="card-text">
        <b>Episode {episode.number}</b>
        <span className="muted">
          {episode.map.split("/").at(-1)}, {episode.weather}
        </span>
        <span className="muted">
          {count(episode.frames, "frame")}, {duration(episode.duration_s)}, {count(episode.sensors, "sensor")},{" "}
          {bytes(episode.bytes)}
        </span>
        <span className="muted mono">{episode.episode_id}</span>
      </span>
    </a>
  );
}
