import { Group, Object3D, Raycaster, Vector2, type Mesh } from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { fromThree, type Pose, type Vector } from "../rig/coordinates";
import type { VehicleShape } from "../rig/mounts";
import type { RigSensor, View } from "../rig/sensors";
import { carModel } from "./car";
import { disposeShapes, place, sensorModel } from "./sensorModel";
import { SceneView } from "./sceneView";

export interface RigSceneEvents {
  /** A sensor was clicked; null: nothing. */
  pick(id: string | null): void;
  /** The gizmo gives the leading sensor this pose. */
  drag(pose: Pose): void;
  dropped(): void;
  /** A press on the car's body, in CARLA's axes of the vehicle; whether it has placed a sensor. */
  place(at: Vector, several: boolean): boolean;
}

const SNAP_M = 0.05;
const SNAP_RAD = (5 * Math.PI) / 180;

/** The car with its sensors and a gizmo on the chosen one. */
export class RigScene extends SceneView {
  private readonly car = new Group();
  private readonly models = new Group();
  private readonly gizmo: TransformControls;
  private readonly held = new Object3D();
  private pressed: [number, number] | null = null;

  constructor(
    host: HTMLElement,
    private readonly events: RigSceneEvents,
  ) {
    super(host, 40);
    this.content.add(this.car, this.models);
    this.scene.add(this.held);
    this.gizmo = new TransformControls(this.camera, this.renderer.domElement);
    this.gizmo.setSize(0.75);
    this.gizmo.setSpace("local");
    this.held.rotation.order = "ZYX";
    this.scene.add(this.gizmo.getHelper());
    this.gizmo.addEventListener("change", this.invalidate);
    this.gizmo.addEventListener("objectChange", () => this.events.drag(this.heldPose()));
    this.gizmo.addEventListener("dragging-changed", ({ value }) => {
      this.orbit.enabled = !value;
      if (!value) this.events.dropped();
    });
    const canvas = this.renderer.domElement;
    canvas.addEventListener("pointerdown", (event) => {
      this.snapping(!event.shiftKey);
      this.pressed = [event.clientX, event.clientY];
    });
    canvas.addEventListener("pointerup", (event) => this.released(event));
    this.look([4.6, 4.1, 3.1], [0.1, 0, 0.75]);
    this.snapping(true);
  }

  get dragging(): boolean {
    return this.gizmo.dragging;
  }

  mode(mode: "translate" | "rotate"): void {
    this.gizmo.setMode(mode);
    // Moving along the car's axes, turning about the sensor's own.
    this.gizmo.setSpace(mode === "translate" ? "world" : "local");
    this.invalidate();
  }

  showCar(shape: VehicleShape | null): void {
    disposeShapes(this.car);
    if (shape) this.car.add(carModel(this.materials, shape));
    this.invalidate();
  }

  showSensors(
    sensors: readonly RigSensor[],
    chosen: readonly string[],
    view: (sensor: RigSensor) => { view: View | null; distance: number },
  ): void {
    const before = new Map(this.models.children.map((model) => [model.name, model as Group]));
    for (const [index, sensor] of sensors.entries()) {
      if (!sensor.onEgo) continue;
      const { view: seen, distance } = view(sensor);
      const held = chosen.includes(sensor.key);
      const { theme } = document.documentElement.dataset;
      const name = JSON.stringify([index, sensor.key, sensor.kind, seen, distance, held, theme]);
      const known = before.get(name);
      before.delete(name);
      if (known) place(known, sensor.pose);
      else {
        const model = sensorModel(this.materials, sensor, seen, distance, held);
        model.name = name;
        this.models.add(model);
      }
    }
    for (const model of before.values()) {
      disposeShapes(model);
      this.models.remove(model);
    }
    this.invalidate();
  }

  /** Put the gizmo on a sensor, or away. What is being dragged is not moved under the hand. */
  hold(pose: Pose | null): void {
    if (pose === null) this.gizmo.detach();
    else {
      if (!this.gizmo.dragging) place(this.held, pose);
      this.gizmo.attach(this.held);
    }
    this.invalidate();
  }

  override dispose(): void {
    this.gizmo.detach();
    this.gizmo.dispose();
    disposeShapes(this.car);
    for (const model of this.models.children) disposeShapes(model as Group);
    super.dispose();
  }

  private heldPose(): Pose {
    const { position: p, rotation: r } = this.held;
    const euler: Vector = [r.x, r.y, r.z];
    return fromThree([p.x, p.y, p.z], euler);
  }

  private snapping(on: boolean): void {
    this.gizmo.setTranslationSnap(on ? SNAP_M : null);
    this.gizmo.setRotationSnap(on ? SNAP_RAD : null);
  }

  private released(event: PointerEvent): void {
    const pressed = this.pressed;
    this.pressed = null;
    if (!pressed || Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4) return;
    if (this.gizmo.dragging || this.gizmo.axis !== null) return;
    const box = this.renderer.domElement.getBoundingClientRect();
    const at = new Vector2(
      ((event.clientX - box.left) / box.width) * 2 - 1,
      1 - ((event.clientY - box.top) / box.height) * 2,
    );
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    const body = ray.intersectObject(this.car, true).find(({ object }) => (object as Partial<Mesh>).isMesh);
    if (body && this.events.place([body.point.x, -body.point.y, body.point.z], event.shiftKey)) return;
    const hit = ray
      .intersectObjects(this.models.children, true)
      .find(({ object }) => typeof object.userData.sensor === "string");
    this.events.pick(hit ? String(hit.object.userData.sensor) : null);
  }
}
