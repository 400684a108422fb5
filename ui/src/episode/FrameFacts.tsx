import { memo } from "react";
import type { EpisodeDetail, EpisodeSensor, FrameMessage, FrameObject } from "../api/types";
import { trackText } from "../ui/tracks";

interface Props {
  detail: EpisodeDetail;
  /** The camera that is large: distances are given from it, too. */
  camera: EpisodeSensor | undefined;
  frame: FrameMessage;
  chosen: number | null;
  onChoose(track: number | null): void;
}

/** What is true in this frame: the ego, its small sensors, everybody around. */
export const FrameFacts = memo(function FrameFacts({ detail, camera, frame, chosen, onChoose }: Props) {
  const { ego } = frame;
  const near = [...frame.objects].sort((a, b) => distance(a) - distance(b));
  const row = chosenRow(frame, chosen, camera?.id);
  const fromCamera = new Map((frame.camera_objects[camera?.id ?? ""] ?? []).map((one) => [one.track_id, one.distance_m]));
  return (
    <div className="facts">
      <section className="panel" aria-label="Ego">
        <header className="panel-head">
          <h2>Ego</h2>
        </header>
        <dl className="fact-list">
          <Fact name="Speed" value={ego?.speed_m_s == null ? "–" : `${(ego.speed_m_s * 3.6).toFixed(1)} km/h`} />
          <Fact name="Throttle, brake" value={`${number(ego?.throttle)}, ${number(ego?.brake)}`} />
          <Fact name="Steering" value={number(ego?.steer)} />
          <Fact name="Position" value={ego ? `${ego.location.map((v) => v.toFixed(1)).join(", ")} m` : "–"} />
          {Object.entries(frame.readings).flatMap(([sensor, columns]) =>
            Object.entries(columns)
              .filter(([column]) => column !== "k" && column !== "timestamp_s")
              .map(([column, value]) => <Fact key={sensor + column} name={`${sensor} ${readingName(column)}`} value={readingText(column, value)} />),
          )}
          <Fact name="Road users" value={`${String(detail.spawned.vehicles ?? "–")} vehicles, ${String(detail.spawned.pedestrians ?? "–")} pedestrians`} />
        </dl>
      </section>
      <section className="panel" aria-label="Objects in this frame">
        <header className="panel-head">
          <h2>Objects</h2>
          <span className="muted">{near.length} in this frame, nearest first</span>
        </header>
        <div className="table-scroll" tabIndex={0} role="region" aria-label="Objects, nearest first">
          <table>
            <thead>
              <tr>
                <th>Class</th>
                <th className="number">Track</th>
                <th className="number">
                  From the ego <span className="unit">m</span>
                </th>
                {camera?.labelled && (
                  <th className="number">
                    From {camera.id} <span className="unit">m</span>
                  </th>
                )}
                <th className="number">
                  Speed <span className="unit">m/s</span>
                </th>
                <th className="number">LiDAR points</th>
              </tr>
            </thead>
            <tbody>
              {near.map((object) => (
                <tr key={object.track_id} data-track={object.track_id} aria-selected={object.track_id === chosen}>
                  <td>
                    <button
                      type="button"
                      className="link"
                      aria-pressed={object.track_id === chosen}
                      onClick={() => onChoose(object.track_id === chosen ? null : object.track_id)}
                    >
                      <span className="dot" style={{ "--colour": `rgb(${object.colour.join(",")})` } as React.CSSProperties} />
                      {object.class_name}
                    </button>
                  </td>
                  <td className="number" title={`track ${object.track_id}, ${object.type_id}`}>
                    {trackText(object.track_id)}
                  </td>
                  <td className="number">{distance(object).toFixed(1)}</td>
                  {camera?.labelled && <td className="number">{fromCamera.get(object.track_id)?.toFixed(1) ?? "–"}</td>}
                  <td className="number">{object.speed_m_s.toFixed(1)}</td>
                  <td className="number">{object.num_lidar_points ?? "–"}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      </section>
      {row && (
        <section className="panel" aria-label="Label of the chosen object">
          <header className="panel-head">
            <h2>Label</h2>
            <span className="muted">
              {row.sensor}, <span title={`track ${chosen}`}>track {trackText(chosen ?? 0)}</span>; distance is from the camera
            </span>
          </header>
          <dl className="fact-list">
            {Object.entries(row.values).map(([column, value]) => (
              <Fact key={column} name={column} value={reading(value)} />
            ))}
          </dl>
        </section>
      )}
    </div>
  );
});

/** The label of the chosen object: that of the large camera, where it is seen there. */
function chosenRow(frame: FrameMessage, chosen: number | null, camera: string | undefined) {
  if (chosen === null) return null;
  const cameras = Object.entries(frame.camera_objects).sort(([a], [b]) => Number(b === camera) - Number(a === camera));
  for (const [sensor, objects] of cameras) {
    const found = objects.find((object) => object.track_id === chosen);
    if (found) return { sensor, values: found.row };
  }
  return null;
}

function Fact({ name, value }: { name: string; value: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}

/** From the ego's pivot to the middle of an object's box, m. */
export function distance({ ego_from_box: m }: FrameObject): number {
  return Math.hypot(m[0]?.[3] ?? 0, m[1]?.[3] ?? 0, m[2]?.[3] ?? 0);
}

/** Units of what IMU and GNSS read, where the column's name does not end in one, and digits that tell something. */
const READ_UNITS: Record<string, string> = { accelerometer: "m/s²", gyroscope: "rad/s" };
const READ_DIGITS: Record<string, number> = { "m/s²": 2, "rad/s": 4, rad: 4, "°": 7, m: 2 };

/** What a small sensor reads, without its unit. */
export function readingName(column: string): string {
  return column.replace(/_(rad|deg|m)$/, "");
}

/** The reading with its unit. */
export function readingText(column: string, value: unknown): string {
  const ending = /_(rad|deg|m)$/.exec(column)?.[1];
  const unit = ending === "deg" ? "°" : (ending ?? READ_UNITS[column] ?? "");
  const digits = READ_DIGITS[unit];
  const values = Array.isArray(value) ? value : [value];
  if (digits === undefined || !values.every((one) => typeof one === "number")) return reading(value);
  // No zero with a minus.
  const texts = values.map((one: number) => one.toFixed(digits).replace(/^-(0\.0*)$/, "$1"));
  return `${texts.join(", ")}${unit === "°" ? unit : ` ${unit}`}`;
}

function number(value: number | null | undefined): string {
  return value === null || value === undefined ? "–" : value.toFixed(2);
}

function reading(value: unknown): string {
  if (typeof value === "number") return Number.isInteger(value) ? String(value) : value.toPrecision(5);
  if (Array.isArray(value)) return value.map(reading).join(", ");
  if (value === null || value === undefined) return "–";
  return typeof value === "object" ? JSON.stringify(value) : String(value);
}
