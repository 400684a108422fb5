import { lazy, Suspense, useEffect, useState } from "react";
import { href } from "../app/routes";
import { useAnswer } from "../api/useAnswer";
import type { EpisodeDetail } from "../api/types";
import { CameraView, type Overlays } from "./CameraView";
import { EgoPlots } from "./EgoPlots";
import { FrameFacts } from "./FrameFacts";
import { MapView } from "./MapView";
import { Timeline } from "./Timeline";
import { usePlayer } from "./usePlayer";

const CloudView = lazy(() => import("./CloudView"));
const LARGE_PX = 960;
const SMALL_PX = 480;

/** An episode to look through, frame by frame. */
export default function EpisodePage({ dataset, episode }: { dataset: string; episode: string }) {
  const base = `/datasets/${encodeURIComponent(dataset)}/episodes/${encodeURIComponent(episode)}`;
  const answer = useAnswer<EpisodeDetail>(base);
  const back = { page: "datasets", dataset } as const;
  if (!answer.data)
    return (
      <main className="page">
        <h1>Episode</h1>
        <p className="empty">
          {answer.error ?? "Loading…"} <a href={href(back)}>Back to the dataset</a>
        </p>
      </main>
    );
  return <PlayerOf base={base} detail={answer.data} dataset={dataset} />;
}

function PlayerOf({ base, detail, dataset }: { base: string; detail: EpisodeDetail; dataset: string }) {
  const player = usePlayer(base, detail.times_s.length, detail.episode.saved_fps);
  const pictures = detail.sensors.filter((sensor) => sensor.data === "image");
  const clouds = detail.sensors.filter((sensor) => sensor.data === "points" || sensor.data === "radar");
  const [large, setLarge] = useState(pictures[0]?.id ?? "");
  const [chosen, setChosen] = useState<number | null>(null);
  const [overlays, setOverlays] = useState<Overlays>({ boxes2d: true, boxes3d: false, masks: false, hidden: false });
  useKeys(player);
  const { frame } = player;
  const main = pictures.find((sensor) => sensor.id === large);
  const others = pictures.filter((sensor) => sensor.id !== large);
  const { episode } = detail;
  return (
    <main className="page episode">
      <header className="page-head">
        <h1>
          <a href={href({ page: "datasets", dataset })}>{dataset.replaceAll("~", "/")}</a> / episode {episode.number}
        </h1>
        <span className="badge">{episode.map}</span>
        <span className="badge">{episode.weather}</span>
        <span className="muted">
          {episode.frames} frames, {episode.saved_fps} Hz, {detail.sensors.length} sensors
        </span>
        {detail.incomplete > 0 && <span className="badge badge-warn">{detail.incomplete} incomplete steps</span>}
        <span className="spacer" />
        <OverlayButtons overlays={overlays} onChange={setOverlays} />
      </header>
      {player.error && (
        <p className="field-error" role="alert">
          {player.error}
        </p>
      )}
      {frame && (
        <div className="scene-grid">
          <div className="scene-cameras">
            {main && (
              <CameraView base={base} sensor={main} frame={frame} overlays={overlays} width={LARGE_PX} chosen={chosen} onChoose={setChosen} />
            )}
          </div>
          <div className="scene-side">
            <MapView base={base} frame={frame} egoBox={detail.ego_box} chosen={chosen} onChoose={setChosen} />
            {clouds.length > 0 && (
              <Suspense fallback={<p className="empty">Loading the 3D view…</p>}>
                <CloudView base={base} sensors={clouds} frame={frame} egoBox={detail.ego_box} chosen={chosen} />
              </Suspense>
            )}
          </div>
        </div>
      )}
      <Timeline player={player} detail={detail} />
      <EgoPlots base={base} times={detail.times_s} k={player.k} onSeek={player.seek} />
      {frame && (
        <>
          <div className="strip" role="group" aria-label="Other cameras">
            {others.map((sensor) => (
              <div key={sensor.id} className="strip-item">
                <CameraView base={base} sensor={sensor} frame={frame} overlays={overlays} width={SMALL_PX} chosen={chosen} onChoose={setChosen} />
                <button type="button" className="strip-enlarge" aria-label={`Show ${sensor.id} large`} onClick={() => setLarge(sensor.id)} />
              </div>
            ))}
          </div>
          <FrameFacts detail={detail} frame={frame} chosen={chosen} onChoose={setChosen} />
        </>
      )}
    </main>
  );
}

function OverlayButtons({ overlays, onChange }: { overlays: Overlays; onChange(next: Overlays): void }) {
  const names: [keyof Overlays, string][] = [
    ["boxes2d", "2D boxes"],
    ["boxes3d", "3D boxes"],
    ["masks", "Masks"],
    ["hidden", "Hidden objects"],
  ];
  return (
    <div className="segments" role="group" aria-label="Labels to draw">
      {names.map(([key, name]) => (
        <button
          key={key}
          type="button"
          className="segment"
          aria-pressed={overlays[key]}
          onClick={() => onChange({ ...overlays, [key]: !overlays[key] })}
        >
          {name}
        </button>
      ))}
    </div>
  );
}

/** Space plays; the arrow keys step; Home and End go to the ends. */
function useKeys(player: ReturnType<typeof usePlayer>) {
  const { k, seek, toggle } = player;
  useEffect(() => {
    const keys = (event: KeyboardEvent) => {
      if ((event.target as HTMLElement).closest("input, select, textarea, button, a, [tabindex]:not(.content)")) return;
      if (event.key === " ") toggle();
      else if (event.key === "ArrowRight") seek(k + 1);
      else if (event.key === "ArrowLeft") seek(k - 1);
      else if (event.key === "Home") seek(0);
      else if (event.key === "End") seek(Number.MAX_SAFE_INTEGER);
      else return;
      event.preventDefault();
    };
    window.addEventListener("keydown", keys);
    return () => window.removeEventListener("keydown", keys);
  }, [k, seek, toggle]);
}
