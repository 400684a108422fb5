import { memo, useMemo, useState } from "react";
import { useAnswer } from "../api/useAnswer";
import type { EpisodeMap, FrameMessage } from "../api/types";
import { lanePaths, polyline } from "../ui/lanes";
import { trackText } from "../ui/tracks";
import { distance as distanceOf } from "./FrameFacts";

interface Props {
  base: string;
  frame: FrameMessage;
  egoBox: Record<string, number[]>;
  chosen: number | null;
  onChoose(track: number | null): void;
}

const SPANS_M = [40, 80, 160, 400];

/** Everybody on the map from above, north as the map has it: x to the right, y down. */
export const MapView = memo(function MapView({ base, frame, egoBox, chosen, onChoose }: Props) {
  const map = useAnswer<EpisodeMap>(`${base}/map`);
  const [span, setSpan] = useState(1);
  const lanes = useMemo(() => lanePaths(map.data?.lanes ?? [], map.data?.lane_widths_m ?? []), [map.data]);
  const track = useMemo(() => polyline((map.data?.track ?? []).map(([x = 0, y = 0]) => [x, y])), [map.data]);
  const { ego } = frame;
  const metres = SPANS_M[span] ?? 80;
  const [cx, cy] = [ego?.location[0] ?? 0, ego?.location[1] ?? 0];
  const [ex = 2.4, ey = 1] = egoBox.extent ?? [];
  return (
    <section className="view map-view" aria-label="Map">
      <header className="view-head">
        <h2>Map</h2>
        <span className="muted">{map.data?.map.split("/").at(-1)}</span>
        <span className="spacer" />
        <button type="button" className="icon-button" aria-label="Closer, map" disabled={span === 0} onClick={() => setSpan(span - 1)}>
          +
        </button>
        <button
          type="button"
          className="icon-button"
          aria-label="Farther, map"
          disabled={span === SPANS_M.length - 1}
          onClick={() => setSpan(span + 1)}
        >
          −
        </button>
      </header>
      <div className="view-body">
        {map.data && lanes.length === 0 && <p className="view-note">The lanes of this map are not known.</p>}
        {!map.data && <p className="view-note">{map.error ?? "Loading the lanes…"}</p>}
        <svg className="plan" viewBox={`${cx - metres / 2} ${cy - metres / 2} ${metres} ${metres}`} preserveAspectRatio="xMidYMid slice">
          {lanes.map(({ width, path }) => (
            <path key={width} className="lane" d={path} strokeWidth={width} />
          ))}
          <path className="track" d={track} strokeWidth={metres / 200} />
          {frame.objects.map((object) => (
            <g
              key={object.track_id}
              className={`road-user${object.track_id === chosen ? " object-chosen" : ""}`}
              transform={`translate(${object.location[0]} ${object.location[1]}) rotate(${object.yaw_deg})`}
              style={{ fill: `rgb(${object.colour.join(",")})` }}
              onClick={() => onChoose(object.track_id === chosen ? null : object.track_id)}
            >
              <title>{`${object.class_name} ${trackText(object.track_id)}, ${distanceOf(object).toFixed(1)} m from the ego`}</title>
              <rect
                x={-(object.extent[0] ?? 1)}
                y={-(object.extent[1] ?? 1)}
                width={2 * (object.extent[0] ?? 1)}
                height={2 * (object.extent[1] ?? 1)}
              />
            </g>
          ))}
          {ego && (
            <g className="ego-mark" transform={`translate(${cx} ${cy}) rotate(${ego.rotation_deg[1] ?? 0})`}>
              <rect x={-ex} y={-ey} width={2 * ex} height={2 * ey} rx={0.4} />
              <path d={`M${ex * 0.2},${-ey * 0.7}L${ex * 0.85},0L${ex * 0.2},${ey * 0.7}Z`} />
            </g>
          )}
        </svg>
      </div>
    </section>
  );
});
