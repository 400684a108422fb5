import { lazy, Suspense, useCallback, useEffect, useMemo, useState, type MouseEvent } from "react";
import { href } from "../app/routes";
import { changeQuery, numberOf, useQuery } from "../app/query";
import { useAnswer } from "../api/useAnswer";
import type { EpisodeDetail, EpisodeHistory, EpisodeSensor, Moment } from "../api/types";
import { Split } from "../ui/Split";
import { CameraView, type Overlays } from "./CameraView";
import { CompareChoice, OtherEpisode } from "./Compare";
import { EgoPlots } from "./EgoPlots";
import { FrameFacts } from "./FrameFacts";
import type { Wanted } from "./frameLoader";
import { HandOver } from "./HandOver";
import { JumpTo } from "./JumpTo";
import { MapView } from "./MapView";
import { Timeline } from "./Timeline";
import { TrackLanes } from "./TrackLanes";
import { usePlayer, type Player } from "./usePlayer";

const CloudView = lazy(() => import("./CloudView"));
const LARGE_PX = 960;
const SMALL_PX = 480;
const NEAR_M = 20;
const REMEMBER_MS = 250;

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

/** What the address says is shown: frame, object, camera, layout, the other episode. */
function useShown(pictures: readonly EpisodeSensor[]) {
  const query = useQuery();
  const asked = query.get("sensor");
  return {
    k: numberOf(query, "k"),
    chosen: numberOf(query, "track"),
    large: pictures.find((sensor) => sensor.id === asked) ?? pictures[0],
    grid: query.get("cameras") === "all",
    other: query.get("with"),
  };
}

const choose = (track: number | null) => changeQuery({ track });

function PlayerOf({ base, detail, dataset }: { base: string; detail: EpisodeDetail; dataset: string }) {
  const pictures = detail.sensors.filter((sensor) => sensor.data === "image");
  const clouds = useMemo(() => detail.sensors.filter((sensor) => sensor.data === "points" || sensor.data === "radar"), [detail]);
  const shown = useShown(pictures);
  const { chosen, large, grid, other } = shown;
  const [overlays, setOverlays] = useState<Overlays>({ boxes2d: true, boxes3d: false, masks: false, hidden: false });
  const [cloud, setCloud] = useState({ sensor: clouds[0]?.id ?? "", sweeps: 1 });
  const showPointsOf = useCallback((sensor: string) => setCloud((now) => ({ ...now, sensor })), []);
  const showSweeps = useCallback((sweeps: number) => setCloud((now) => ({ ...now, sweeps })), []);
  const [nearM, setNearM] = useState(NEAR_M);
  const history = useAnswer<EpisodeHistory>(`${base}/history?near_m=${nearM}`);
  const wanted: Wanted = {
    pictures: pictures.map(({ id, labelled }) => ({ sensor: id, width: id === large?.id && !grid ? LARGE_PX : SMALL_PX, mask: overlays.masks && labelled })),
    points: cloud.sensor ? cloud : null,
  };
  const player = usePlayer(base, detail.times_s.length, detail.episode.saved_fps, shown.k ?? 0, wanted);
  useFrameOfAddress(player, shown.k);
  useKeys(player);
  const { bundle } = player;
  const jump = ({ k, track_id, sensor_id }: Moment) => {
    player.seek(k);
    changeQuery({ track: track_id ?? null, ...(sensor_id && pictures.some(({ id }) => id === sensor_id) ? { sensor: sensor_id } : {}) });
  };
  const show = { overlays, chosen, onChoose: choose };
  return (
    <main className="page episode" onClick={letGo}>
      <EpisodeHead detail={detail} dataset={dataset}>
        <OverlayButtons overlays={overlays} onChange={setOverlays} />
        <div className="segments" role="group" aria-label="Cameras">
          <button type="button" className="segment" aria-pressed={!grid} onClick={() => changeQuery({ cameras: null })}>
            One large
          </button>
          <button type="button" className="segment" aria-pressed={grid} onClick={() => changeQuery({ cameras: "all" })}>
            All cameras
          </button>
        </div>
      </EpisodeHead>
      <div className="player-tools">
        <JumpTo history={history.data} nearM={nearM} onNear={setNearM} onJump={jump} />
        <CompareChoice dataset={dataset} own={detail.episode} other={other} onChoose={(id) => changeQuery({ with: id })} />
        <span className="spacer" />
        <HandOver dataset={dataset} episode={detail.episode.episode_id} />
      </div>
      {(player.error ?? history.error) && (
        <p className="field-error" role="alert">
          {player.error ?? history.error}
        </p>
      )}
      {!bundle && !player.error && detail.times_s.length > 0 && <p className="empty">Loading the frame…</p>}
      {bundle && (
        <div className="scene-grid">
          <Split name="player" label="Width of the cameras" direction="row" initial={0.6}>
            <div className={grid ? "camera-grid" : "scene-cameras"}>
              {pictures.filter((sensor) => grid || sensor === large).map((sensor) => (
                <CameraView key={sensor.id} sensor={sensor} bundle={bundle} {...show} note={other ? `Episode ${detail.episode.number}: ${detail.episode.weather}, ${bundle.frame.timestamp_s.toFixed(2)} s` : undefined} />
              ))}
              {other && large && (
                <OtherEpisode
                  key={other}
                  base={`/datasets/${encodeURIComponent(dataset)}/episodes/${encodeURIComponent(other)}`}
                  sensor={large.id}
                  time={detail.times_s[bundle.k] ?? 0}
                  overlays={overlays}
                />
              )}
            </div>
            <Side>
              <MapView base={base} frame={bundle.frame} egoBox={detail.ego_box} chosen={chosen} onChoose={choose} />
              {clouds.length > 0 && (
                <Suspense fallback={<p className="empty">Loading the 3D view…</p>}>
                  <CloudView
                    detail={detail}
                    sensors={clouds}
                    bundle={bundle}
                    {...cloud}
                    onSensor={showPointsOf}
                    onSweeps={showSweeps}
                    chosen={chosen}
                    onChoose={choose}
                  />
                </Suspense>
              )}
            </Side>
          </Split>
        </div>
      )}
      <Timeline player={player} detail={detail} />
      {history.data && (
        <TrackLanes history={history.data} count={detail.times_s.length} k={player.k} chosen={chosen} onSeek={player.seek} onChoose={choose} />
      )}
      <EgoPlots base={base} times={detail.times_s} k={player.k} onSeek={player.seek} />
      {bundle && !grid && (
        <div className="strip" role="group" aria-label="Other cameras">
          {pictures.filter((sensor) => sensor !== large).map((sensor) => (
            <div key={sensor.id} className="strip-item">
              <CameraView sensor={sensor} bundle={bundle} {...show} />
              <button type="button" className="strip-enlarge" aria-label={`Show ${sensor.id} large`} onClick={() => changeQuery({ sensor: sensor.id })} />
            </div>
          ))}
        </div>
      )}
      {bundle && <FrameFacts detail={detail} camera={large} frame={bundle.frame} chosen={chosen} onChoose={choose} />}
    </main>
  );
}

/** Map and points, one below the other; the map alone where there are no points. */
function Side({ children }: { children: readonly [React.ReactNode, React.ReactNode] }) {
  const [map, points] = children;
  if (!points) return <div className="scene-side">{map}</div>;
  return (
    <div className="scene-side">
      <Split name="player-side" label="Height of the map" direction="column" initial={0.42}>
        {map}
        {points}
      </Split>
    </div>
  );
}

function EpisodeHead({ detail, dataset, children }: { detail: EpisodeDetail; dataset: string; children: React.ReactNode }) {
  const { episode } = detail;
  return (
    <header className="page-head">
      <h1>
        <a href={href({ page: "datasets", dataset })}>{dataset.replaceAll("~", "/")}</a> / episode {detail.episode.number}
      </h1>
      <span className="badge">{episode.map.split("/").at(-1)}</span>
      <span className="badge">{episode.weather}</span>
      <span className="muted">
        {episode.frames} frames, {episode.saved_fps} Hz, {detail.sensors.length} sensors
      </span>
      {detail.incomplete > 0 && <span className="badge badge-warn">{detail.incomplete} incomplete steps</span>}
      <span className="spacer" />
      {children}
    </header>
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

/** The frame stands in the address when it stands still, and a frame of the address is gone to. */
function useFrameOfAddress(player: Player, asked: number | null): void {
  const { k, playing, seek } = player;
  useEffect(() => {
    if (playing) return;
    const timer = window.setTimeout(() => changeQuery({ k: k === 0 ? null : k }), REMEMBER_MS);
    return () => window.clearTimeout(timer);
  }, [k, playing]);
  useEffect(() => {
    const go = () => seek(numberOf(new URLSearchParams(window.location.hash.split("?")[1] ?? ""), "k") ?? 0);
    window.addEventListener("hashchange", go); // a link, or the browser's "back"
    return () => window.removeEventListener("hashchange", go);
  }, [seek, asked]);
}

/** After a click the keys belong to the player again; who walks with Tab keeps the button. */
function letGo(event: MouseEvent): void {
  if (event.detail > 0) (event.target as HTMLElement).closest("button")?.blur();
}

/** Space plays; the arrow keys step; Home and End go to the ends. */
function useKeys(player: Player) {
  const { k, seek, toggle } = player;
  useEffect(() => {
    const keys = (event: KeyboardEvent) => {
      const target = event.target as HTMLElement;
      const writes = target.closest("select, textarea, [role=separator], [role=tab], [role=region], summary, canvas");
      const scrubs = target.closest("input[type=range]");
      if (writes || (target.closest("input") && !scrubs) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === " " && !target.closest("button, a")) toggle();
      else if (scrubs) return; // it has keys of its own
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
