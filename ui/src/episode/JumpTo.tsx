import type { EpisodeHistory, Moment } from "../api/types";
import { trackText } from "../ui/tracks";

interface Props {
  history: EpisodeHistory | null;
  nearM: number;
  onNear(nearM: number): void;
  onJump(moment: Moment): void;
}

const NEAR_M = [5, 10, 20, 30, 50];

/** Frames that are worth a look: near pedestrians, what is hidden most, braking, faults. */
export function JumpTo({ history, nearM, onNear, onJump }: Props) {
  const moments = history?.moments ?? [];
  const kinds = [...new Set(moments.map((moment) => moment.kind))];
  return (
    <div className="jump">
      <select
        className="input compact"
        aria-label="Jump to"
        value=""
        disabled={moments.length === 0}
        onChange={(event) => {
          const moment = moments[Number(event.target.value)];
          if (moment) onJump(moment);
        }}
      >
        <option value="">{history === null ? "Jump to…" : moments.length === 0 ? "nothing to jump to" : `Jump to… (${moments.length})`}</option>
        {kinds.map((kind) => (
          <optgroup key={kind} label={kind}>
            {moments.map((moment, place) =>
              moment.kind === kind ? (
                <option key={place} value={place}>
                  {kind}: {moment.text}
                  {moment.track_id === null || moment.track_id === undefined ? "" : `, track ${trackText(moment.track_id)}`}, frame {moment.k}
                </option>
              ) : null,
            )}
          </optgroup>
        ))}
      </select>
      <select className="input compact" aria-label="A pedestrian is near under" value={nearM} onChange={(event) => onNear(Number(event.target.value))}>
        {NEAR_M.map((metres) => (
          <option key={metres} value={metres}>
            pedestrian under {metres} m
          </option>
        ))}
      </select>
    </div>
  );
}
