import { useAnswer } from "../api/useAnswer";
import type { EpisodeDetail, EpisodeSummary } from "../api/types";
import { kindOf } from "../rig/kinds";
import { href } from "../app/routes";
import { bytes, count, duration } from "../ui/format";

/** Episodes as cards, each with a picture of its middle frame. */
export function EpisodeList({ dataset, episodes }: { dataset: string; episodes: readonly EpisodeSummary[] }) {
  if (episodes.length === 0) return <p className="empty">No episode has been committed yet.</p>;
  return (
    <ul className="episode-cards">
      {episodes.map((episode) => (
        <li key={episode.episode_id}>
          <EpisodeCard dataset={dataset} episode={episode} />
        </li>
      ))}
    </ul>
  );
}

function EpisodeCard({ dataset, episode }: { dataset: string; episode: EpisodeSummary }) {
  const base = `/datasets/${encodeURIComponent(dataset)}/episodes/${episode.episode_id}`;
  const detail = useAnswer<EpisodeDetail>(base);
  const pictures = detail.data?.sensors.filter((sensor) => sensor.data === "image") ?? [];
  const camera = pictures.find((sensor) => kindOf(sensor.kind)?.modality === "camera") ?? pictures[0];
  return (
    <a className="panel episode-card" href={href({ page: "episode", dataset, episode: episode.episode_id })}>
      {camera ? (
        <img
          src={`api${base}/sensors/${camera.id}/${Math.floor(episode.frames / 2)}.png?width=480`}
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
