import { memo } from "react";
import type { CameraObject, EpisodeSensor } from "../api/types";
import { colourOf } from "../rig/kinds";
import type { Bundle } from "./frameLoader";

export interface Overlays {
  boxes2d: boolean;
  boxes3d: boolean;
  masks: boolean;
  hidden: boolean;
}

interface Props {
  sensor: EpisodeSensor;
  bundle: Bundle;
  overlays: Overlays;
  chosen: number | null;
  onChoose(track: number | null): void;
  /** Stands before the sensor's name: which episode, where two are compared. */
  note?: string;
}

/** A camera's picture with its labels; picture and labels are always of one frame. */
export const CameraView = memo(function CameraView({ sensor, bundle, overlays, chosen, onChoose, note }: Props) {
  const { frame } = bundle;
  const shown = bundle.pictures.get(sensor.id);
  const objects = frame.camera_objects[sensor.id] ?? [];
  const drawn = objects.filter((one) => one.visible || overlays.hidden);
  const state = frame.states[sensor.id];
  return (
    <figure
      className="camera"
      data-sensor={sensor.id}
      data-k={shown ? frame.k : ""}
      style={{ "--colour": colourOf(sensor.kind) } as React.CSSProperties}
    >
      <div className="camera-picture" style={{ aspectRatio: `${sensor.width} / ${sensor.height}` }}>
        {shown && <img src={shown.url} alt={`${sensor.id}, frame ${frame.k}`} />}
        {shown?.mask && <img className="mask" src={shown.mask} alt="" />}
        {shown && sensor.labelled && (
          <svg viewBox={`0 0 ${sensor.width} ${sensor.height}`} role="group" aria-label={`Labels of ${sensor.id}`}>
            {drawn.map((object) => (
              <ObjectMark
                key={object.track_id}
                object={object}
                overlays={overlays}
                chosen={object.track_id === chosen}
                onChoose={onChoose}
                sensor={sensor}
              />
            ))}
          </svg>
        )}
        {!shown && <p className="empty">no picture in this frame{state && state !== "ok" ? ` (${state})` : ""}</p>}
      </div>
      <figcaption>
        {note && <span className="badge">{note}</span>}
        <span className="dot" />
        <b>{sensor.id}</b>
        <span className="muted">{sensor.kind}</span>
        {sensor.labelled && <span className="muted">{drawn.length} objects, distances from this camera</span>}
      </figcaption>
    </figure>
  );
});

interface MarkProps {
  object: CameraObject;
  overlays: Overlays;
  chosen: boolean;
  sensor: EpisodeSensor;
  onChoose(track: number | null): void;
}

function ObjectMark({ object, overlays, chosen, sensor, onChoose }: MarkProps) {
  const colour = `rgb(${object.colour.join(",")})`;
  const box = object.bbox_modal ?? object.bbox_amodal;
  const size = sensor.width / 58;
  return (
    <g
      className={`object${chosen ? " object-chosen" : ""}${object.visible ? "" : " object-hidden"}`}
      style={{ stroke: colour }}
      onClick={() => onChoose(chosen ? null : object.track_id)}
    >
      <title>{`${object.class_name} ${object.track_id}${object.distance_m === null ? "" : `, ${object.distance_m?.toFixed(1)} m from ${sensor.id}`}`}</title>
      {overlays.boxes3d &&
        object.lines.map(([x0, y0, x1, y1], i) => <line key={i} x1={x0} y1={y0} x2={x1} y2={y1} />)}
      {box && (overlays.boxes2d || chosen) && <rect {...rectangle(box)} />}
      {box && <rect className="object-hit" {...rectangle(box)} />}
      {box && (overlays.boxes2d || chosen) && (box[2] ?? 0) - (box[0] ?? 0) > sensor.width * 0.035 && (
        <text x={box[0]} y={Math.max((box[1] ?? 0) - 3, size)} fontSize={size} strokeWidth={size / 4} style={{ fill: colour }}>
          {object.class_name}
          {object.distance_m === null ? "" : ` ${object.distance_m?.toFixed(1)} m`}
        </text>
      )}
    </g>
  );
}

function rectangle([x0 = 0, y0 = 0, x1 = 0, y1 = 0]: readonly number[]) {
  return { x: x0, y: y0, width: Math.max(0, x1 - x0), height: Math.max(0, y1 - y0) };
}
