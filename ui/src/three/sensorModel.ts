import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  CylinderGeometry,
  DoubleSide,
  Euler,
  Group,
  Line,
  LineBasicMaterial,
  LineDashedMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshLambertMaterial,
  SphereGeometry,
} from "three";
import type { SensorKind } from "../api/types";
import { eulerZYX, toThree, type Pose, type Vector } from "../rig/coordinates";
import { colourName, kindOf } from "../rig/kinds";
import { direction, pinhole } from "../rig/outline";
import type { RigSensor, View } from "../rig/sensors";
import type { Materials } from "./Materials";
import { cssColour } from "./sceneView";

const HIT_RADIUS_M = 0.14;

/** Bodies in metres, by the icon of a kind. */
const BODIES: Record<SensorKind["icon"], () => BufferGeometry> = {
  camera: () => new BoxGeometry(0.12, 0.1, 0.08),
  lidar: () => new CylinderGeometry(0.09, 0.09, 0.12, 20).rotateX(Math.PI / 2),
  radar: () => new BoxGeometry(0.04, 0.16, 0.1),
  box: () => new BoxGeometry(0.08, 0.08, 0.05),
};

/** A sensor with what it sees; `userData.sensor` names it on everything that can be hit. */
export function sensorModel(
  materials: Materials,
  sensor: RigSensor,
  view: View | null,
  distance: number,
  chosen: boolean,
): Group {
  const group = new Group();
  const colour = cssColour(`--${colourName(sensor.kind)}`);
  group.add(body(materials, sensor, colour, chosen), hitArea(materials, sensor.key));
  if (view) group.add(...seen(materials, view, distance, colour, chosen));
  place(group, sensor.pose);
  group.userData.sensor = sensor.key;
  return group;
}

/** Put an object at a pose in CARLA's coordinates. */
export function place(object: { position: Group["position"]; rotation: Euler }, pose: Pose): void {
  object.position.set(...toThree([pose.x, pose.y, pose.z]));
  object.rotation.set(...eulerZYX(pose), "ZYX");
}

function body(materials: Materials, sensor: RigSensor, colour: Color, chosen: boolean): Mesh {
  const shape = BODIES[kindOf(sensor.kind)?.icon ?? "box"]();
  const emissive = colour.clone().multiplyScalar(chosen ? 0.55 : 0.2);
  const surface = () => new MeshLambertMaterial({ color: colour, emissive });
  return new Mesh(shape, materials.take(`body ${chosen}`, colour, surface));
}

function hitArea(materials: Materials, id: string): Mesh {
  const unseen = materials.take("hit", new Color(), () => new MeshBasicMaterial({ visible: false }));
  const mesh = new Mesh(new SphereGeometry(HIT_RADIUS_M, 8, 6), unseen);
  mesh.userData.sensor = id;
  return mesh;
}

function seen(
  materials: Materials,
  view: View,
  distance: number,
  colour: Color,
  chosen: boolean,
): (Line | LineSegments | Mesh)[] {
  if (view.shape === "sweep") return sweep(materials, view, distance, colour, chosen);
  const corner = (right: number, up: number): Vector => {
    if (view.shape === "pyramid") return pinhole(view.h, view.v, right, up);
    return direction((right * view.h) / 2, (up * view.v) / 2);
  };
  const corners = [corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)].map((d) =>
    toThree([d[0] * distance, d[1] * distance, d[2] * distance]),
  );
  const origin: Vector = [0, 0, 0];
  const edges = corners.flatMap((c, i) => [origin, c, c, corners[(i + 1) % 4] ?? c]);
  const sides = corners.flatMap((c, i) => [origin, c, corners[(i + 1) % 4] ?? c]);
  const edge = () => new LineBasicMaterial({ color: colour, transparent: true, opacity: chosen ? 1 : 0.5 });
  const glow = () =>
    new MeshBasicMaterial({
      color: colour,
      transparent: true,
      opacity: chosen ? 0.16 : 0.05,
      side: DoubleSide,
      depthWrite: false,
    });
  return [
    new LineSegments(points(edges), materials.take(`edge ${chosen}`, colour, edge)),
    new Mesh(points(sides), materials.take(`glow ${chosen}`, colour, glow)),
  ];
}

function sweep(
  materials: Materials,
  view: View & { shape: "sweep" },
  distance: number,
  colour: Color,
  chosen: boolean,
): Line[] {
  const elevations = [view.lower, (view.lower + view.upper) / 2, view.upper];
  return elevations.map((elevation, i) => {
    const steps = 72;
    const ring = Array.from({ length: steps + 1 }, (_, k) => {
      const d = direction(-view.h / 2 + (view.h * k) / steps, elevation);
      return toThree([d[0] * distance, d[1] * distance, d[2] * distance]);
    });
    const gapSize = i === 1 ? 0 : 0.1;
    const dashed = () =>
      new LineDashedMaterial({
        color: colour,
        dashSize: 0.12,
        gapSize,
        transparent: true,
        opacity: chosen ? 1 : 0.45,
      });
    const line = new Line(points(ring), materials.take(`ring ${gapSize} ${chosen}`, colour, dashed));
    line.computeLineDistances();
    return line;
  });
}

function points(list: readonly Vector[]): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(list.flat()), 3));
  return geometry;
}

/** Empty a group and give back its shapes; materials stay. */
export function disposeShapes(group: Group): void {
  group.traverse((object) => (object as Partial<Mesh>).geometry?.dispose());
  group.clear();
}
