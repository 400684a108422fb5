import { useEffect, useState } from "react";
import type { CameraObject, EpisodeSensor, FrameMessage } from "../api/types";
import { colourOf } from "../rig/kinds";

export interface Overlays {
  boxes2d: boolean;
  boxes3d: boolean;
  masks: boolean;
  hidden: boolean;
}

interface Props {
  base: string;
  sensor: EpisodeSensor;
  frame: FrameMessage;
  overlays: Overlays;
  width: number;
  chosen: number | null;
  onChoose(track: number | null): void;
}

interface Shown {
  url: string;
  mask: string | null;
  frame: FrameMessage;
}

/** A camera's picture with its labels; picture and labels are always of one frame. */
export function CameraView({ base, sensor, frame, overlays, width, chosen, onChoose }: Props) {
  const [shown, setShown] = useState<Shown | null>(null);
  const [missing, setMissing] = useState(false);
  const there = frame.available.includes(sensor.id);
  const wantsMask = overlays.masks && sensor.labelled;

  useEffect(() => {
    if (!there) {
      setMissing(true);
      return;
    }
    let wanted = true;
    const url = `api${base}/sensors/${sensor.id}/${frame.k}.png?width=${width}`;
    const mask = wantsMask ? `api${base}/masks/${sensor.id}/${frame.k}.png` : null;
    Promise.all([decoded(url), mask ? decoded(mask) : null]).then(
      () => {
        if (!wanted) return;
        setShown({ url, mask, frame });
        setMissing(false);
      },
      () => wanted && setMissing(true),
    );
    return () => {
      wanted = false;
    };
  }, [base, sensor.id, frame, there, width, wantsMask]);

  const objects = shown ? (shown.frame.camera_objects[sensor.id] ?? []) : [];
  const drawn = objects.filter((one) => one.visible || overlays.hidden);
  const state = frame.states[sensor.id];
  return (
    <figure
      className="camera"
      data-sensor={sensor.id}
      data-k={shown?.frame.k ?? ""}
      style={{ "--colour": colourOf(sensor.kind) } as React.CSSProperties}
    >
      <div className="camera-picture" style={{ aspectRatio: `${sensor.width} / ${sensor.height}` }}>
        {shown && <img src={shown.url} alt={`${sensor.id}, frame ${shown.frame.k}`} />}
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
        {missing && <p className="empty">no picture in this frame{state && state !== "ok" ? ` (${state})` : ""}</p>}
      </div>
      <figcaption>
        <span className="dot" />
        <b>{sensor.id}</b>
        <span className="muted">{sensor.kind}</span>
        {sensor.labelled && <span className="muted">{drawn.length} objects</span>}
      </figcaption>
    </figure>
  );
}

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
      {overlays.boxes3d &&
        object.lines.map(([x0, y0, x1, y1], i) => <line key={i} x1={x0} y1={y0} x2={x1} y2={y1} />)}
      {box && (overlays.boxes2d || chosen) && <rect {...rectangle(box)} />}
      {box && <rect className="object-hit" {...rectangle(box)} />}
      {box && (overlays.boxes2d || chosen) && (box[2] ?? 0) - (box[0] ?? 0) > sensor.width * 0.035 && (
        <text x={box[0]} y={Math.max((box[1] ?? 0) - 3, size)} fontSize={size} strokeWidth={size / 4} style={{ fill: colour }}>
          {object.class_name}
          {object.distance_m === null ? "" : ` ${object.distance_m?.toFixed(0)} m`}
        </text>
      )}
    </g>
  );
}

function rectangle([x0 = 0, y0 = 0, x1 = 0, y1 = 0]: readonly number[]) {
  return { x: x0, y: y0, width: Math.max(0, x1 - x0), height: Math.max(0, y1 - y0) };
}

async function decoded(url: string): Promise<void> {
  const image = new Image();
  image.src = url;
  await image.decode();
}
