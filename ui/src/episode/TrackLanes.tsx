import { memo, useMemo, useState, type PointerEvent } from "react";
import type { EpisodeHistory } from "../api/types";
import { trackText } from "../ui/tracks";

interface Props {
  history: EpisodeHistory;
  count: number;
  k: number;
  chosen: number | null;
  onSeek(k: number): void;
  onChoose(track: number | null): void;
}

interface Bar {
  first: number;
  last: number;
  title: string;
  colour: string;
}

const USUAL = 12;
const LIGHTS: Record<string, string> = { Red: "var(--bad)", Yellow: "var(--warn)", Green: "var(--good)" };
const WEATHERS = ["var(--camera)", "var(--truth)", "var(--lidar)", "var(--radar)", "var(--inertial)"];

/** What is when: weather, the ego's traffic light, faults of sensors, and each object. */
export function TrackLanes({ history, count, k, chosen, onSeek, onChoose }: Props) {
  const [all, setAll] = useState(false);
  const { tracks } = history;
  return (
    <section className="panel lanes" aria-label="Tracks over time">
      <header className="panel-head">
        <h2>Over time</h2>
        <span className="muted">
          {tracks.length} objects, nearest first; light parts: brake lights or blinkers
        </span>
        <span className="spacer" />
        {tracks.length > USUAL && (
          <button type="button" className="button small" aria-pressed={all} onClick={() => setAll(!all)}>
            All objects
          </button>
        )}
      </header>
      <div className="lanes-body" tabIndex={0} role="region" aria-label="Lanes of the timeline">
        <Lanes history={history} all={all} count={count} chosen={chosen} onSeek={onSeek} onChoose={onChoose} />
        <div className="lane-now" aria-hidden="true">
          <span style={{ left: `${((k + 0.5) / count) * 100}%` }} />
        </div>
      </div>
    </section>
  );
}

/** The lanes without the mark of the frame that is shown: they stay as they are while it moves. */
const Lanes = memo(function Lanes({ history, all, count, chosen, onSeek, onChoose }: Omit<Props, "k"> & { all: boolean }) {
  const { tracks, weather, lights, faults } = history;
  const nearest = useMemo(() => [...tracks].sort((a, b) => (a.nearest_m ?? Infinity) - (b.nearest_m ?? Infinity)), [tracks]);
  const shown = all ? nearest : nearest.filter((track, place) => place < USUAL || track.track_id === chosen);
  const presets = [...new Set(weather.map((span) => span.value))];
  const lane = { count, onSeek };
  return (
    <>
      <Lane
        name="Weather"
        bars={weather.map(({ first, last, value }) => ({ first, last, title: value, colour: WEATHERS[presets.indexOf(value) % WEATHERS.length] ?? "" }))}
        words
        {...lane}
      />
      {lights.some(({ value }) => LIGHTS[value]) && (
        <Lane
          name="Traffic light"
          bars={lights.flatMap(({ first, last, value }) => (LIGHTS[value] ? [{ first, last, title: value, colour: LIGHTS[value] }] : []))}
          words
          {...lane}
        />
      )}
      {Object.entries(faults).map(([sensor, spans]) => (
        <Lane
          key={sensor}
          name={`${sensor} faults`}
          bars={spans.map(({ first, last, value }) => ({ first, last, title: value, colour: "var(--bad)" }))}
          words
          {...lane}
        />
      ))}
      {shown.map((track) => (
        <Lane
          key={track.track_id}
          name={`${track.class_name.replaceAll("_", " ")} ${trackText(track.track_id)}`}
          title={`track ${track.track_id}${track.nearest_m === null || track.nearest_m === undefined ? "" : `, at least ${track.nearest_m.toFixed(1)} m from the ego`}`}
          chosen={track.track_id === chosen}
          onChoose={() => onChoose(track.track_id === chosen ? null : track.track_id)}
          bars={[
            ...track.spans.map(([first = 0, last = 0]) => ({ first, last, title: `frames ${first} to ${last}`, colour: `rgb(${track.colour.join(",")})` })),
            ...track.signals.map(({ first, last, value }) => ({ first, last, title: value, colour: "rgb(255 255 255 / 60%)" })),
          ]}
          {...lane}
        />
      ))}
    </>
  );
});

interface LaneProps {
  name: string;
  title?: string;
  bars: readonly Bar[];
  count: number;
  /** Whether the bars carry their names. */
  words?: boolean;
  chosen?: boolean;
  onChoose?(): void;
  onSeek(k: number): void;
}

function Lane({ name, title, bars, count, words, chosen, onChoose, onSeek }: LaneProps) {
  const seek = (event: PointerEvent<HTMLDivElement>) => {
    if (event.buttons !== 1) return;
    const box = event.currentTarget.getBoundingClientRect();
    onSeek(Math.min(count - 1, Math.max(0, Math.floor(((event.clientX - box.left) / box.width) * count))));
  };
  return (
    <div className={`lane-row${chosen ? " lane-chosen" : ""}`} title={title}>
      {onChoose ? (
        <button type="button" className="link lane-name" aria-pressed={chosen} onClick={onChoose}>
          {name}
        </button>
      ) : (
        <span className="lane-name">{name}</span>
      )}
      <div className="lane-bars" onPointerDown={seek} onPointerMove={seek}>
        {bars.map(({ first, last, title: text, colour }, i) => (
          <span
            key={i}
            className="lane-bar"
            title={text}
            style={{ left: `${(first / count) * 100}%`, width: `${((last - first + 1) / count) * 100}%`, background: colour }}
          >
            {words && <span className="lane-word">{text}</span>}
          </span>
        ))}
      </div>
    </div>
  );
}
