import {
  Color,
  GridHelper,
  Group,
  HemisphereLight,
  DirectionalLight,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { Materials } from "./Materials";

/** A 3D view that draws only when something has changed: no loop runs while nothing moves. */
export class SceneView {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(45, 1, 0.05, 1000);
  readonly orbit: OrbitControls;
  readonly renderer: WebGLRenderer;
  readonly content = new Group();
  protected readonly materials = new Materials();
  /** Pictures drawn so far; a test looks whether it stands still. */
  drawn = 0;
  private asked = 0;
  private readonly observer: ResizeObserver;
  private grid: GridHelper | null = null;

  /**
   * @param antialias smooth edges; without a graphics card that doubles the time of a picture.
   * @throws Error where there is no WebGL.
   */
  constructor(
    private readonly host: HTMLElement,
    private readonly gridSize: number,
    antialias = true,
  ) {
    const canvas = document.createElement("canvas");
    // Asked for here: three.js would write an error to the console before it throws.
    const context = canvas.getContext("webgl2", { antialias, alpha: false, stencil: false });
    if (!context) throw new Error("no WebGL");
    this.renderer = new WebGLRenderer({ canvas, context, antialias, alpha: false });
    // To look for a shader's errors is to wait for the compiler.
    this.renderer.debug.checkShaderErrors = false;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.domElement.className = "scene";
    host.append(this.renderer.domElement);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new HemisphereLight(0xffffff, 0x777788, 2.2), this.content);
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(6, 8, 14);
    this.scene.add(sun);
    this.orbit = new OrbitControls(this.camera, this.renderer.domElement);
    this.orbit.enableDamping = false; // damping needs a loop
    this.orbit.maxPolarAngle = Math.PI * 0.497;
    this.orbit.addEventListener("change", this.invalidate);
    this.observer = new ResizeObserver(() => this.resize());
    this.observer.observe(host);
    this.resize();
    this.recolour();
  }

  /** Draw once, soon. */
  readonly invalidate = (): void => {
    if (this.asked !== 0) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.drawn += 1;
      this.renderer.render(this.scene, this.camera);
    });
  };

  look(from: [number, number, number], at: [number, number, number]): void {
    this.camera.position.set(...from);
    this.orbit.target.set(...at);
    this.orbit.update();
    this.invalidate();
  }

  /** Take colours of background and grid from the page's style anew. */
  recolour(): void {
    this.scene.background = cssColour("--view");
    if (this.grid) {
      this.scene.remove(this.grid);
      this.grid.dispose();
    }
    this.grid = new GridHelper(this.gridSize, this.gridSize, cssColour("--grid-strong"), cssColour("--grid"));
    this.grid.rotation.x = Math.PI / 2;
    this.scene.add(this.grid);
    this.invalidate();
  }

  /** Where a point of CARLA's axes is on the canvas, CSS pixels. */
  project(x: number, y: number, z: number): [number, number] {
    const place = new Vector3(x, -y, z).project(this.camera);
    const { width, height } = this.renderer.domElement.getBoundingClientRect();
    return [((place.x + 1) / 2) * width, ((1 - place.y) / 2) * height];
  }

  private resize(): void {
    const { width, height } = this.host.getBoundingClientRect();
    if (width < 2 || height < 2) return;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.setSize(width, height, false);
    this.invalidate();
  }

  dispose(): void {
    cancelAnimationFrame(this.asked);
    this.asked = -1; // nothing is drawn any more
    this.observer.disconnect();
    this.orbit.dispose();
    this.materials.dispose();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.renderer.domElement.remove();
  }
}

/** A colour that the page's style names; three.js reads neither `color-mix` nor variables. */
export function cssColour(variable: string): Color {
  return new Color(getComputedStyle(document.documentElement).getPropertyValue(variable).trim() || "#888");
}
