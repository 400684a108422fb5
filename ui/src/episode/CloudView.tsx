import { memo, useEffect, useRef, useState, type PointerEvent } from "react";
import type { EpisodeDetail, EpisodeSensor } from "../api/types";
import { useTheme } from "../app/theme";
import { CloudScene } from "../three/CloudScene";
import { trackText } from "../ui/tracks";
import type { Bundle } from "./frameLoader";
import { eachInside, paint, scaleOf, type PointColour } from "./pointColours";

declare global {
  interface Window {
    /** For tests: where a place in the ego's axes is on the canvas, how often and by whom it was drawn. */
    carstageCloud?: { project(x: number, y: number, z: number): [number, number]; drawn(): number; software: boolean };
  }
}

const COLOURS: Record<PointColour, string> = {
  height: "height",
  value: "intensity",
  class: "class",
  instance: "object",
  range: "range",
};
const SWEEPS = [1, 3, 5, 10, 20];
/** A press that moves less is no drag, CSS pixels. */
const STILL_PX = 4;

interface Props {
  detail: EpisodeDetail;
  sensors: readonly EpisodeSensor[];
  bundle: Bundle;
  sensor: string;
  sweeps: number;
  onSensor(sensor: string): void;
  onSweeps(sweeps: number): void;
  chosen: number | null;
  onChoose(track: number | null): void;
}

/** Points of one sensor in 3D with everybody's boxes; loaded, with three.js, when it is shown. */
const CloudView = memo(function CloudView(props: Props) {
  const { detail, sensors, bundle, sensor, sweeps, chosen, onChoose } = props;
  const host = useRef<HTMLDivElement>(null);
  const [scene, setScene] = useState<CloudScene | null>(null);
  const [failed, setFailed] = useState("");
  const [by, setBy] = useState<PointColour>("height");
  const [point, setPoint] = useState<number | null>(null);
  const [theme] = useTheme();
  const kind = sensors.find((one) => one.id === sensor)?.kind ?? "";
  const { points, frame } = bundle;

  useEffect(() => {
    if (!host.current) return;
    let made: CloudScene;
    try {
      made = new CloudScene(host.current);
    } catch (error) {
      console.info("no WebGL", error);
      setFailed("This browser shows no 3D (no WebGL).");
      return;
    }
    made.chase();
    setScene(made);
    window.carstageCloud = { project: (x, y, z) => made.project(x, y, z), drawn: () => made.drawn, software: made.software };
    return () => {
      delete window.carstageCloud;
      made.dispose();
      setScene(null);
    };
  }, []);

  useEffect(() => scene?.recolour(), [scene, theme]);
  useEffect(() => {
    if (!scene) return;
    setPoint(null);
    const shown = points ?? new Float32Array();
    scene.showPoints(shown, kind === "radar" ? 5 : 1.6, (colours) =>
      paint(shown, colours, by, { detail, kind, objects: frame.objects }),
    );
  }, [scene, points, frame, kind, by, detail]);
  useEffect(() => scene?.showBoxes(frame.objects, detail.ego_box, chosen), [scene, frame, detail, chosen, theme]);
  useEffect(() => scene?.markPoint(point), [scene, point]);

  const pick = useClick((x, y) => {
    if (!scene) return;
    const picked = scene.pick(x, y);
    setPoint(picked.point);
    // A point that was hit says whose it is; else the box counts.
    const owner = picked.point === null ? picked.track : ownerOf(picked.point, bundle);
    onChoose(owner);
  });
  const note = failed || bundle.pointsNote || (frame.available.includes(sensor) ? "" : `no data of ${sensor} in this frame`);
  return (
    <section className="view cloud-view" aria-label="Points in 3D" data-points={(points?.length ?? 0) / 4} data-k={bundle.k} data-colour={by}>
      <header className="view-head">
        <h2>3D</h2>
        <select className="input compact" aria-label="Points of" value={sensor} onChange={(event) => props.onSensor(event.target.value)}>
          {sensors.map(({ id }) => (
            <option key={id}>{id}</option>
          ))}
        </select>
        <select className="input compact" aria-label="Colour of points" value={by} onChange={(event) => setBy(event.target.value as PointColour)}>
          {(Object.keys(COLOURS) as PointColour[])
            .filter((one) => one !== "value" || kind !== "semantic_lidar")
            .map((one) => (
              <option key={one} value={one}>
                by {one === "value" && kind === "radar" ? "range rate" : COLOURS[one]}
              </option>
            ))}
        </select>
        <select className="input compact" aria-label="Sweeps" value={sweeps} onChange={(event) => props.onSweeps(Number(event.target.value))}>
          {SWEEPS.map((count) => (
            <option key={count} value={count}>
              {count === 1 ? "1 sweep" : `${count} sweeps`}
            </option>
          ))}
        </select>
        <span className="spacer" />
        <button type="button" className="button small" onClick={() => scene?.chase()}>
          Behind
        </button>
        <button type="button" className="button small" onClick={() => scene?.top()}>
          Above
        </button>
      </header>
      <div className="view-body">
        <div ref={host} className="scene-host" {...pick} />
        {note && <p className="empty over">{note}</p>}
        <CloudNotes by={by} kind={kind} count={(points?.length ?? 0) / 4} />
        {point !== null && points && <PointRow point={point} bundle={bundle} kind={kind} sensor={sensor} detail={detail} />}
      </div>
    </section>
  );
});

export default CloudView;

/** Calls with the place of a press that was no drag, CSS pixels of the element. */
function useClick(call: (x: number, y: number) => void) {
  const from = useRef<[number, number] | null>(null);
  return {
    onPointerDown: (event: PointerEvent<HTMLDivElement>) => {
      from.current = [event.clientX, event.clientY];
    },
    onPointerUp: (event: PointerEvent<HTMLDivElement>) => {
      if (!from.current || event.button !== 0) return;
      if (Math.hypot(event.clientX - from.current[0], event.clientY - from.current[1]) > STILL_PX) return;
      const box = event.currentTarget.getBoundingClientRect();
      call(event.clientX - box.left, event.clientY - box.top);
    },
  };
}

/** The track in whose box a point lies. */
function ownerOf(point: number, { points, frame }: Bundle): number | null {
  const one = points?.subarray(point * 4, point * 4 + 4) ?? new Float32Array();
  let owner: number | null = null;
  for (const object of frame.objects) eachInside(one, object, () => (owner = object.track_id));
  return owner;
}

function CloudNotes({ by, kind, count }: { by: PointColour; kind: string; count: number }) {
  const scale = scaleOf(by, kind);
  return (
    <div className="cloud-notes">
      <span>{count.toLocaleString("en")} points</span>
      {scale ? (
        <span className="scale">
          {scale.low}
          <span className="scale-ramp" style={{ background: `linear-gradient(to right, ${scale.stops})` }} />
          {scale.high} {scale.unit}
        </span>
      ) : (
        <span>{by === "instance" ? "one colour for each labelled object" : "colours of the classes; grey: no labelled object"}</span>
      )}
    </div>
  );
}

interface PointRowProps {
  point: number;
  bundle: Bundle;
  kind: string;
  sensor: string;
  detail: EpisodeDetail;
}

/** The row of the point that was picked. */
function PointRow({ point, bundle, kind, sensor, detail }: PointRowProps) {
  const [x = 0, y = 0, z = 0, value = 0] = bundle.points?.subarray(point * 4, point * 4 + 4) ?? [];
  const owner = bundle.frame.objects.find((one) => one.track_id === ownerOf(point, bundle));
  const meaning =
    kind === "radar"
      ? `range rate ${value.toFixed(2)} m/s`
      : kind === "semantic_lidar"
        ? `tag ${detail.tags.find((tag) => tag.value === value)?.name ?? value}`
        : `intensity ${value.toFixed(3)}`;
  return (
    <p className="point-row" role="status" aria-label="Picked point">
      <b>
        {sensor}, point {point}
      </b>
      : x {x.toFixed(2)}, y {y.toFixed(2)}, z {z.toFixed(2)} m; {Math.hypot(x, y, z).toFixed(2)} m from the ego; {meaning}
      {owner ? `; ${owner.class_name.replaceAll("_", " ")} ${trackText(owner.track_id)}` : "; of no labelled object"}
    </p>
  );
}
