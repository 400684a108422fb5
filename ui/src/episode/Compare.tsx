import { useState } from "react";
import { useAnswer } from "../api/useAnswer";
import type { DatasetDetail, EpisodeDetail, EpisodeSummary } from "../api/types";
import { CameraView, type Overlays } from "./CameraView";
import { useBundle } from "./usePlayer";

const WIDTH_PX = 960;

/** Which episode is shown beside this one: of the same dataset, those of the same map first. */
export function CompareChoice({ dataset, own, other, onChoose }: { dataset: string; own: EpisodeSummary; other: string | null; onChoose(id: string | null): void }) {
  const [asked, setAsked] = useState(other !== null);
  const detail = useAnswer<DatasetDetail>(asked ? `/datasets/${encodeURIComponent(dataset)}` : null);
  const numbered = (detail.data?.episodes ?? []).map((episode, place) => ({ episode, number: place + 1 }));
  const others = numbered
    .filter(({ episode }) => episode.episode_id !== own.episode_id)
    .sort((a, b) => Number(b.episode.map === own.map) - Number(a.episode.map === own.map));
  return (
    <select
      className="input compact"
      aria-label="Compare with"
      value={other ?? ""}
      onPointerDown={() => setAsked(true)}
      onFocus={() => setAsked(true)}
      onChange={(event) => onChoose(event.target.value || null)}
    >
      <option value="">{detail.data && others.length === 0 ? "no other episode" : other ? "no comparison" : "Compare with…"}</option>
      {other !== null && !detail.data && <option value={other}>…</option>}
      {others.map(({ episode, number }) => (
        <option key={episode.episode_id} value={episode.episode_id}>
          Episode {number}: {episode.map.split("/").at(-1)}, {episode.weather}, {episode.frames} frames
        </option>
      ))}
    </select>
  );
}

interface Props {
  base: string;
  /** The camera that is large, by its id: shown of the other episode, too. */
  sensor: string;
  /** The time that is shown of the first episode, s. */
  time: number;
  overlays: Overlays;
}

/** The other episode at the same time, through the same camera. */
export function OtherEpisode({ base, sensor, time, overlays }: Props) {
  const { data, error } = useAnswer<EpisodeDetail>(base);
  const pictures = data?.sensors.filter((one) => one.data === "image") ?? [];
  const camera = pictures.find((one) => one.id === sensor) ?? pictures[0];
  const k = data ? nearest(data.times_s, time) : null;
  const wanted = { pictures: camera ? [{ sensor: camera.id, width: WIDTH_PX, mask: overlays.masks && camera.labelled }] : [], points: null };
  const shown = useBundle(base, camera ? k : null, data?.times_s.length ?? 0, wanted);
  const [chosen, setChosen] = useState<number | null>(null);
  if (error || shown.error) return <p className="field-error">{error ?? shown.error}</p>;
  if (!data || !camera || !shown.bundle) return <p className="empty">{data && !camera ? "It has no camera." : "Loading the other episode…"}</p>;
  return (
    <div className="compared" data-k={shown.bundle.k}>
      <CameraView
        sensor={camera}
        bundle={shown.bundle}
        overlays={overlays}
        chosen={chosen}
        onChoose={setChosen}
        note={`Episode ${data.episode.number}: ${data.episode.weather}, ${(data.times_s[shown.bundle.k] ?? 0).toFixed(2)} s`}
      />
      {Math.abs((data.times_s.at(-1) ?? 0) - time) > 0 && time > (data.times_s.at(-1) ?? 0) && <p className="muted">It ends before this frame.</p>}
    </div>
  );
}

/** The frame whose time is nearest. */
export function nearest(times: readonly number[], time: number): number {
  let best = 0;
  for (let k = 1; k < times.length; k += 1) if (Math.abs((times[k] ?? 0) - time) < Math.abs((times[best] ?? 0) - time)) best = k;
  return best;
}
