import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  DynamicDrawUsage,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Points,
  PointsMaterial,
  Raycaster,
  Vector2,
  Vector3,
  Box3,
} from "three";
import type { FrameObject } from "../api/types";
import { cssColour, SceneView } from "./sceneView";
import { isSoftware, SoftwarePoints } from "./softwarePoints";

/** Left-handed to right-handed: y changes its sign on both sides of a transform. */
const FLIP = new Matrix4().makeScale(1, -1, 1);
/** Edges of a box of half size 1; all boxes share them. */
const EDGES = new EdgesGeometry(new BoxGeometry(2, 2, 2));
/** How far from a point one may press, CSS pixels. */
const NEAR_PX = 7;

export interface Picked {
  /** Number of the point; null where only a box was hit. */
  point: number | null;
  track: number | null;
}

/** A sweep of points in the ego's frame, with everybody's boxes. */
export class CloudScene extends SceneView {
  /** Whether points are drawn without WebGL, as that is computed on the processor here. */
  readonly software: boolean;
  private readonly boxes = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly cloud: Points | SoftwarePoints;
  private points: Float32Array = new Float32Array();
  private objects: readonly FrameObject[] = [];
  private mark: LineSegments | null = null;

  constructor(host: HTMLElement) {
    super(host, 200, false); // points have no edges to smooth, and frames follow each other
    this.software = isSoftware(this.renderer.getContext() as WebGL2RenderingContext);
    this.cloud = this.software ? new SoftwarePoints(this.geometry) : new Points(this.geometry, this.dots(1));
    this.cloud.frustumCulled = false; // its bounds would have to be found anew for each sweep
    this.content.add(this.cloud, this.boxes);
    this.top();
  }

  chase(): void {
    this.look([-17, 0, 10], [10, 0, 0]);
  }

  top(): void {
    this.look([-0.5, 0, 62], [0, 0, 0]);
  }

  /**
   * @param points x, y, z and a value each, in the ego's axes.
   * @param paint writes red, green and blue of each point.
   */
  showPoints(points: Float32Array, size: number, paint: (colours: Float32Array) => void): void {
    const count = Math.floor(points.length / 4);
    this.points = points;
    const positions = this.attribute("position", count);
    const places = positions.array as Float32Array;
    for (let i = 0; i < count; i += 1) {
      places[i * 3] = points[i * 4] ?? 0;
      places[i * 3 + 1] = -(points[i * 4 + 1] ?? 0);
      places[i * 3 + 2] = points[i * 4 + 2] ?? 0;
    }
    positions.needsUpdate = true;
    const colours = this.attribute("color", count);
    paint(colours.array as Float32Array);
    colours.needsUpdate = true;
    this.geometry.setDrawRange(0, count);
    if (this.cloud instanceof SoftwarePoints) this.cloud.size = size;
    else this.cloud.material = this.dots(size);
    this.markPoint(null);
    this.invalidate();
  }

  showBoxes(objects: readonly FrameObject[], ego: Record<string, number[]>, chosen: number | null): void {
    this.boxes.clear();
    this.objects = objects;
    for (const object of objects) {
      const [r = 128, g = 128, b = 128] = object.colour;
      const colour = object.track_id === chosen ? cssColour("--text") : new Color(`rgb(${r},${g},${b})`);
      const box = this.wireBox(object.extent, colour);
      box.matrixAutoUpdate = false;
      box.matrix.copy(poseOf(object)).scale(box.scale);
      this.boxes.add(box);
    }
    const own = this.wireBox(ego.extent ?? [2.4, 1, 0.75], cssColour("--accent-text"));
    const [x = 0, y = 0, z = 0] = ego.location ?? [];
    own.position.set(x, -y, z);
    this.boxes.add(own);
    this.invalidate();
  }

  /** Show where a point is; null: none. */
  markPoint(point: number | null): void {
    if (this.mark) {
      this.content.remove(this.mark);
      this.mark = null;
    }
    if (point !== null) {
      this.mark = this.wireBox([0.15, 0.15, 0.15], cssColour("--text"));
      this.mark.position.copy(this.place(point));
      this.content.add(this.mark);
    }
    this.invalidate();
  }

  /** What is at a place of the canvas, in CSS pixels: the nearest box, and the nearest point. */
  pick(x: number, y: number): Picked {
    const { width, height } = this.renderer.domElement.getBoundingClientRect();
    const at = new Vector2((x / width) * 2 - 1, 1 - (y / height) * 2);
    const caster = new Raycaster();
    caster.setFromCamera(at, this.camera);
    let track: number | null = null;
    let nearest = Infinity;
    for (const object of this.objects) {
      const back = poseOf(object).invert();
      const ray = caster.ray.clone().applyMatrix4(back);
      const [ex = 1, ey = 1, ez = 1] = object.extent;
      const hit = ray.intersectBox(new Box3(new Vector3(-ex, -ey, -ez), new Vector3(ex, ey, ez)), new Vector3());
      const distance = hit ? hit.distanceTo(ray.origin) : Infinity;
      if (distance < nearest) [nearest, track] = [distance, object.track_id];
    }
    return { point: this.nearestPoint(at, width, height), track };
  }

  override dispose(): void {
    this.geometry.dispose();
    if (this.cloud instanceof SoftwarePoints) this.cloud.dispose();
    super.dispose();
  }

  private place(point: number): Vector3 {
    const at = point * 4;
    return new Vector3(this.points[at] ?? 0, -(this.points[at + 1] ?? 0), this.points[at + 2] ?? 0);
  }

  private nearestPoint(at: Vector2, width: number, height: number): number | null {
    const matrix = new Matrix4().multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    const seen = new Vector3();
    let best: number | null = null;
    let least = NEAR_PX;
    for (let i = 0; i * 4 < this.points.length; i += 1) {
      seen.copy(this.place(i)).applyMatrix4(matrix);
      if (seen.z > 1) continue; // behind the eye
      const off = Math.hypot(((seen.x - at.x) * width) / 2, ((seen.y - at.y) * height) / 2);
      if (off < least) [least, best] = [off, i];
    }
    return best;
  }

  /** Room for so many points; kept as long as it suffices. */
  private attribute(name: "position" | "color", count: number): BufferAttribute {
    const kept = this.geometry.getAttribute(name) as BufferAttribute | undefined;
    if (kept && kept.count >= count) return kept;
    const made = new BufferAttribute(new Float32Array(Math.ceil(count * 1.2) * 3), 3).setUsage(DynamicDrawUsage);
    this.geometry.setAttribute(name, made);
    return made;
  }

  private dots(size: number): PointsMaterial {
    return this.materials.take(`points ${size}`, new Color(), () => new PointsMaterial({ size, sizeAttenuation: false, vertexColors: true }));
  }

  private wireBox(extent: readonly number[], color: Color): LineSegments {
    const [x = 1, y = 1, z = 1] = extent;
    const box = new LineSegments(EDGES, this.materials.take("box", color, () => new LineBasicMaterial({ color })));
    box.scale.set(x, y, z);
    return box;
  }
}

/** A box's pose in three.js's axes. */
function poseOf(object: FrameObject): Matrix4 {
  const pose = new Matrix4().set(...(object.ego_from_box.flat() as Parameters<Matrix4["set"]>));
  return pose.premultiply(FLIP).multiply(FLIP);
}
