import type { EpisodeDetail } from "../api/types";
import { Icon } from "../ui/Icon";
import type { Player } from "./usePlayer";

const SPEEDS = [0.25, 0.5, 1, 2];

/** Scrub, play, step. */
export function Timeline({ player, detail }: { player: Player; detail: EpisodeDetail }) {
  const last = detail.times_s.length - 1;
  const time = detail.times_s[player.k] ?? 0;
  return (
    <section className="panel timeline" aria-label="Timeline">
      <div className="button-row">
        <Step icon="first" name="First frame" to={() => player.seek(0)} off={player.k === 0} />
        <Step icon="back" name="Frame back" to={() => player.seek(player.k - 1)} off={player.k === 0} />
        <button type="button" className="button primary play" onClick={player.toggle} title="Space">
          <Icon name={player.playing ? "pause" : "play"} />
          {player.playing ? "Pause" : "Play"}
        </button>
        <Step icon="step" name="Frame forward" to={() => player.seek(player.k + 1)} off={player.k >= last} />
      </div>
      <input
        className="scrub"
        type="range"
        min={0}
        max={Math.max(last, 0)}
        value={player.k}
        aria-label="Frame"
        aria-valuetext={`frame ${player.k}, ${time.toFixed(2)} s`}
        onChange={(event) => player.seek(Number(event.target.value))}
      />
      <output className="time">
        <b>{player.k}</b> / {last} <span className="muted">{time.toFixed(2)} s</span>
      </output>
      <label className="inline-label">
        <span className="sr-only">Speed</span>
        <select
          className="input compact"
          aria-label="Speed"
          value={player.speed}
          onChange={(event) => player.setSpeed(Number(event.target.value))}
        >
          {SPEEDS.map((speed) => (
            <option key={speed} value={speed}>
              {speed}×
            </option>
          ))}
        </select>
      </label>
    </section>
  );
}

function Step({ icon, name, to, off }: { icon: string; name: string; to(): void; off: boolean }) {
  return (
    <button type="button" className="icon-button" aria-label={name} title={name} disabled={off} onClick={to}>
      <Icon name={icon} />
    </button>
  );
}
