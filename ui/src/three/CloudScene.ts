import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  Color,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Points,
  PointsMaterial,
} from "three";
import type { FrameObject } from "../api/types";
import { disposeShapes } from "./sensorModel";
import { cssColour, SceneView } from "./sceneView";

/** Left-handed to right-handed: y changes its sign on both sides of a transform. */
const FLIP = new Matrix4().makeScale(1, -1, 1);
const LOW_M = -0.5;
const HIGH_M = 4;

/** A sweep of points in the ego's frame, with everybody's boxes. */
export class CloudScene extends SceneView {
  private readonly clouds = new Group();
  private readonly boxes = new Group();

  constructor(host: HTMLElement) {
    super(host, 200);
    this.content.add(this.clouds, this.boxes);
    this.top();
  }

  chase(): void {
    this.look([-17, 0, 10], [10, 0, 0]);
  }

  top(): void {
    this.look([-0.5, 0, 62], [0, 0, 0]);
  }

  /** @param points x, y, z and a value each, in the ego's axes. */
  showPoints(points: Float32Array | null, size: number): void {
    disposeShapes(this.clouds);
    if (points) {
      const count = Math.floor(points.length / 4);
      const positions = new Float32Array(count * 3);
      const colours = new Float32Array(count * 3);
      const [low, middle, high] = [cssColour("--camera"), cssColour("--lidar"), cssColour("--radar")];
      const mixed = new Color();
      for (let i = 0; i < count; i += 1) {
        const z = points[i * 4 + 2] ?? 0;
        positions.set([points[i * 4] ?? 0, -(points[i * 4 + 1] ?? 0), z], i * 3);
        const share = Math.min(1, Math.max(0, (z - LOW_M) / (HIGH_M - LOW_M)));
        if (share < 0.4) mixed.lerpColors(low, middle, share / 0.4);
        else mixed.lerpColors(middle, high, (share - 0.4) / 0.6);
        mixed.toArray(colours, i * 3);
      }
      const geometry = new BufferGeometry();
      geometry.setAttribute("position", new BufferAttribute(positions, 3));
      geometry.setAttribute("color", new BufferAttribute(colours, 3));
      const dots = () => new PointsMaterial({ size, sizeAttenuation: false, vertexColors: true });
      this.clouds.add(new Points(geometry, this.materials.take(`points ${size}`, new Color(), dots)));
    }
    this.invalidate();
  }

  showBoxes(objects: readonly FrameObject[], ego: Record<string, number[]>, chosen: number | null): void {
    disposeShapes(this.boxes);
    for (const object of objects) {
      const [r = 128, g = 128, b = 128] = object.colour;
      const colour = object.track_id === chosen ? cssColour("--text") : new Color(`rgb(${r},${g},${b})`);
      const box = this.wireBox(object.extent, colour);
      box.matrixAutoUpdate = false;
      box.matrix.set(...(object.ego_from_box.flat() as Parameters<Matrix4["set"]>));
      box.matrix.premultiply(FLIP).multiply(FLIP);
      this.boxes.add(box);
    }
    const own = this.wireBox(ego.extent ?? [2.4, 1, 0.75], cssColour("--accent-text"));
    const [x = 0, y = 0, z = 0] = ego.location ?? [];
    own.position.set(x, -y, z);
    this.boxes.add(own);
    this.invalidate();
  }

  override dispose(): void {
    disposeShapes(this.clouds);
    disposeShapes(this.boxes);
    super.dispose();
  }

  private wireBox(extent: readonly number[], color: Color): LineSegments {
    const [x = 1, y = 1, z = 1] = extent;
    const solid = new BoxGeometry(2 * x, 2 * y, 2 * z);
    const edges = new EdgesGeometry(solid);
    solid.dispose();
    return new LineSegments(edges, this.materials.take("box", color, () => new LineBasicMaterial({ color })));
  }
}
