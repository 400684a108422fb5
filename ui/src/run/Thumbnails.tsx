import { useEffect, useRef, useState } from "react";
import { live, onPicture } from "../api/live";
import type { Channel, RunSummary } from "../api/types";
import { colourName, colourOf } from "../rig/kinds";
import { useStore } from "../state/store";
import { drawFromAbove } from "./fromAbove";
import { LastFrame } from "./LastFrame";

/** The newest picture of every camera; points are drawn from above. */
export function Thumbnails({ run }: { run: RunSummary }) {
  const channels = useStore(live, (now) => now.channels);
  if (run.alive === "ended" || run.alive === "dead") return <LastFrame run={run} />;
  if (channels.length === 0)
    return (
      <section className="panel thumbs-empty" aria-label="Live pictures">
        <p className="empty">Pictures appear with the first recorded frames.</p>
      </section>
    );
  const kinds = new Map((run.sensors ?? []).map((sensor) => [sensor.id, sensor.kind]));
  return (
    <section className="thumbs" aria-label="Live pictures">
      {channels.map((channel) => {
        const kind = kinds.get(channel.sensor_id) ?? "";
        return (
          <figure
            key={channel.sensor_id}
            className="thumb"
            data-sensor={channel.sensor_id}
            style={{ "--colour": colourOf(kind) } as React.CSSProperties}
          >
            {channel.kind === "image" ? <ImageThumb channel={channel} /> : <PointsThumb channel={channel} colour={colourName(kind)} />}
            <figcaption>
              <span className="dot" />
              {channel.sensor_id}
            </figcaption>
          </figure>
        );
      })}
    </section>
  );
}

/** JPEGs are drawn into a canvas: nothing to give back, and no flicker between two of them. */
export function ImageThumb({ channel }: { channel: Channel }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [tick, setTick] = useState<number | null>(null);
  useEffect(() => {
    let newest = 0;
    return onPicture(channel.sensor_id, (picture) => {
      newest += 1;
      const mine = newest;
      createImageBitmap(new Blob([picture.data], { type: "image/jpeg" }))
        .then((bitmap) => {
          const target = canvas.current;
          if (target && mine === newest) {
            if (target.width !== bitmap.width) target.width = bitmap.width;
            if (target.height !== bitmap.height) target.height = bitmap.height;
            target.getContext("2d")?.drawImage(bitmap, 0, 0);
            setTick(picture.tick);
          }
          bitmap.close();
        })
        .catch((error: unknown) => console.info("a picture could not be read", error));
    });
  }, [channel.sensor_id]);
  return (
    <canvas
      ref={canvas}
      className="thumb-picture"
      width={320}
      height={180}
      role="img"
      aria-label={`${channel.sensor_id}, ${tick === null ? "no picture yet" : `step ${tick}`}`}
      data-tick={tick ?? ""}
    />
  );
}

function PointsThumb({ channel, colour }: { channel: Channel; colour: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [tick, setTick] = useState<number | null>(null);
  useEffect(
    () =>
      onPicture(channel.sensor_id, (picture) => {
        if (!canvas.current) return;
        drawFromAbove(canvas.current, new Float32Array(picture.data), channel.kind === "radar" ? "radar" : "points", colour);
        setTick(picture.tick);
      }),
    [channel.sensor_id, channel.kind, colour],
  );
  return (
    <canvas
      ref={canvas}
      className="thumb-picture"
      width={320}
      height={320}
      role="img"
      aria-label={`${channel.sensor_id} from above, ${tick === null ? "no points yet" : `step ${tick}`}`}
      data-tick={tick ?? ""}
    />
  );
}
