import { useEffect, useRef, useState } from "react";
import { useTheme } from "../app/theme";
import { RigScene } from "../three/RigScene";
import { snap, type Pose, type Vector } from "./coordinates";
import { mountAround } from "./placing";
import { drawnReach, useRig, type Rig } from "./useRig";

declare global {
  interface Window {
    /** For tests of the gizmo: where a point of the car is on the canvas. */
    carstage3d?: { project(x: number, y: number, z: number): [number, number]; drawn(): number };
  }
}

const NEAR_M = 0.35;

/** The rig in 3D; loaded when it is first shown, with three.js. */
export default function View3D({ mode }: { mode: "translate" | "rotate" }) {
  const rig = useRig();
  const host = useRef<HTMLDivElement>(null);
  const [scene, setScene] = useState<RigScene | null>(null);
  const [failed, setFailed] = useState(false);
  const [theme] = useTheme();
  const current = useRef<Rig>(rig);
  current.current = rig;

  useEffect(() => {
    if (!host.current) return;
    let made: RigScene;
    try {
      made = new RigScene(host.current, {
        pick: (key) => current.current.select(key === null ? [] : [key]),
        drag: (pose) => dragTo(current.current, pose),
        dropped: () => current.current.endGesture(),
        place: (at, several) => placeOnBody(current.current, at, several),
      });
    } catch (error) {
      console.info("no WebGL", error);
      setFailed(true);
      return;
    }
    setScene(made);
    window.carstage3d = { project: (x, y, z) => made.project(x, y, z), drawn: () => made.drawn };
    return () => {
      delete window.carstage3d;
      made.dispose();
      setScene(null);
    };
  }, []);

  useEffect(() => {
    scene?.recolour();
    scene?.showCar(rig.shape);
  }, [scene, rig.shape, theme]);

  useEffect(() => {
    scene?.showSensors(rig.sensors, rig.selected, (sensor) => {
      const view = rig.view(sensor);
      return { view, distance: view ? drawnReach(view, rig.trueRanges) * (rig.trueRanges ? 1 : 0.55) : 0 };
    });
    scene?.hold(leader(rig)?.pose ?? null);
  }, [scene, rig, theme]);

  useEffect(() => scene?.mode(mode), [scene, mode]);

  if (failed)
    return <p className="empty">This browser shows no 3D (no WebGL). The top and side views do all the same.</p>;
  return <div ref={host} className="scene-host" data-ready={scene !== null} />;
}

/** A sensor of the armed kind where the car was pressed: at a usual place nearby, else a little above the body. */
function placeOnBody(rig: Rig, [x, y, z]: Vector, several: boolean): boolean {
  if (rig.armed === null) return false;
  const mount = mountAround(rig.mounts, [x, y, z], NEAR_M);
  const free = { x: snap(x, 0.05), y: snap(y, 0.05), z: snap(z + 0.1, 0.01), roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
  rig.placeArmed(mount?.pose ?? free, several);
  return true;
}

function leader(rig: Rig) {
  return rig.sensors.find((sensor) => sensor.onEgo && rig.selected.includes(sensor.key));
}

/** The leading sensor takes the gizmo's pose; what is chosen with it moves along and turns as much. */
function dragTo(rig: Rig, goal: Pose): void {
  const lead = leader(rig);
  if (!lead) return;
  const from = lead.pose;
  rig.pose(
    rig.selected,
    (pose, key) =>
      key === lead.key
        ? goal
        : {
            x: pose.x + goal.x - from.x,
            y: pose.y + goal.y - from.y,
            z: pose.z + goal.z - from.z,
            roll_deg: pose.roll_deg + goal.roll_deg - from.roll_deg,
            pitch_deg: pose.pitch_deg + goal.pitch_deg - from.pitch_deg,
            yaw_deg: pose.yaw_deg + goal.yaw_deg - from.yaw_deg,
          },
    "gizmo",
  );
}
