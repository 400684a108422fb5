import { useEffect, useRef, useState } from "react";
import { getFloats, sentence } from "../api/client";
import type { EpisodeSensor, FrameMessage } from "../api/types";
import { useTheme } from "../app/theme";
import { CloudScene } from "../three/CloudScene";

interface Props {
  base: string;
  sensors: readonly EpisodeSensor[];
  frame: FrameMessage;
  egoBox: Record<string, number[]>;
  chosen: number | null;
}

/** Points of one sensor in 3D with everybody's boxes; loaded, with three.js, when it is shown. */
export default function CloudView({ base, sensors, frame, egoBox, chosen }: Props) {
  const host = useRef<HTMLDivElement>(null);
  const [scene, setScene] = useState<CloudScene | null>(null);
  const [sensor, setSensor] = useState(sensors[0]?.id ?? "");
  const [note, setNote] = useState("");
  const [shown, setShown] = useState(0);
  const [theme] = useTheme();
  const kind = sensors.find((one) => one.id === sensor)?.data;

  useEffect(() => {
    if (!host.current) return;
    let made: CloudScene;
    try {
      made = new CloudScene(host.current);
    } catch (error) {
      console.info("no WebGL", error);
      setNote("This browser shows no 3D (no WebGL).");
      return;
    }
    made.chase();
    setScene(made);
    return () => {
      made.dispose();
      setScene(null);
    };
  }, []);

  useEffect(() => scene?.recolour(), [scene, theme]);

  useEffect(() => {
    if (!scene || !sensor || !frame.available.includes(sensor)) return;
    const stop = new AbortController();
    getFloats(`${base}/points/${sensor}/${frame.k}`, stop.signal).then(
      (points) => {
        scene.showPoints(points, kind === "radar" ? 5 : 1.6);
        scene.showBoxes(frame.objects, egoBox, chosen);
        setShown(points.length / 4);
        setNote("");
      },
      (error: unknown) => {
        if (!stop.signal.aborted) setNote(sentence(error));
      },
    );
    return () => stop.abort();
  }, [scene, base, sensor, kind, frame, egoBox, chosen, theme]);

  return (
    <section className="view cloud-view" aria-label="Points in 3D" data-points={shown}>
      <header className="view-head">
        <h3>3D</h3>
        <select
          className="input compact"
          aria-label="Points of"
          value={sensor}
          onChange={(event) => setSensor(event.target.value)}
        >
          {sensors.map(({ id }) => (
            <option key={id}>{id}</option>
          ))}
        </select>
        <span className="muted">{shown.toLocaleString("en")} points</span>
        <span className="spacer" />
        <button type="button" className="button small" onClick={() => scene?.chase()}>
          Behind
        </button>
        <button type="button" className="button small" onClick={() => scene?.top()}>
          Above
        </button>
      </header>
      <div className="view-body">
        <div ref={host} className="scene-host" />
        {note && <p className="empty over">{note}</p>}
      </div>
    </section>
  );
}
