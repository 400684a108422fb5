import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DataTexture,
  FloatType,
  GLSL3,
  Mesh,
  RedFormat,
  ShaderMaterial,
  Vector2,
  Matrix4,
  type Camera,
  type WebGLRenderer,
} from "three";

/** Whether WebGL is computed on the processor, as on a machine without a graphics card. */
export function isSoftware(gl: WebGL2RenderingContext): boolean {
  const names = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** A picture of points: colours (RGBA) and depths (0 to 1, 1 where there is no point), row 0 lowest. */
export interface Film {
  width: number;
  height: number;
  colours: Uint32Array;
  depths: Float32Array;
}

/**
 * Draw points as squares, the nearest on top.
 *
 * @param clip from the points' axes to clip space, column by column.
 * @param size edge of a square, pixels.
 */
export function splat(film: Film, clip: readonly number[], positions: Float32Array, colours: Float32Array, count: number, size: number): void {
  const { width, height } = film;
  const [a0 = 0, b0 = 0, c0 = 0, d0 = 0, a1 = 0, b1 = 0, c1 = 0, d1 = 0, a2 = 0, b2 = 0, c2 = 0, d2 = 0, a3 = 0, b3 = 0, c3 = 0, d3 = 0] = clip;
  const half = size / 2;
  film.depths.fill(1);
  for (let i = 0; i < count * 3; i += 3) {
    const x = positions[i] as number;
    const y = positions[i + 1] as number;
    const z = positions[i + 2] as number;
    const w = d0 * x + d1 * y + d2 * z + d3;
    if (w <= 0) continue; // behind the eye
    const depth = ((c0 * x + c1 * y + c2 * z + c3) / w) * 0.5 + 0.5;
    if (depth < 0 || depth >= 1) continue;
    const column = ((a0 * x + a1 * y + a2 * z + a3) / w + 1) * 0.5 * width - 0.5;
    const row = ((b0 * x + b1 * y + b2 * z + b3) / w + 1) * 0.5 * height - 0.5;
    const last = Math.min(width - 1, Math.floor(column + half));
    const top = Math.min(height - 1, Math.floor(row + half));
    let colour = 0;
    for (let v = Math.max(0, Math.ceil(row - half)); v <= top; v += 1)
      for (let u = Math.max(0, Math.ceil(column - half)); u <= last; u += 1) {
        const at = v * width + u;
        if ((film.depths[at] as number) <= depth) continue;
        colour ||= encoded(colours[i] as number, colours[i + 1] as number, colours[i + 2] as number);
        film.depths[at] = depth;
        film.colours[at] = colour;
      }
  }
}

const STEPS = 1024;
/** sRGB codes of linear values, as three.js writes the colours of its materials. */
const CODES = Uint8Array.from({ length: STEPS }, (_, i) => new Color(0, 0, i / (STEPS - 1)).getHex());

function encoded(r: number, g: number, b: number): number {
  const code = (value: number) => CODES[Math.round(value * (STEPS - 1))] as number;
  return ((255 << 24) | (code(b) << 16) | (code(g) << 8) | code(r)) >>> 0;
}

/**
 * Points drawn here, not by WebGL: where that is computed on the processor, it takes ten times as
 * long for very many points. WebGL gets their picture with its depths, and draws the rest around it.
 */
export class SoftwarePoints extends Mesh<BufferGeometry, ShaderMaterial> {
  /** Edge of a point, CSS pixels. */
  size = 1;
  private film: Film = { width: 0, height: 0, colours: new Uint32Array(), depths: new Float32Array() };
  private readonly buffer = new Vector2();

  /** @param points positions and colours; what is in its draw range is drawn. */
  constructor(private readonly points: BufferGeometry) {
    const screen = new BufferGeometry();
    screen.setAttribute("position", new BufferAttribute(new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), 3));
    const material = new ShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { colours: { value: null }, depths: { value: null } },
      vertexShader: "void main() { gl_Position = vec4(position, 1.0); }",
      fragmentShader: `
        uniform sampler2D colours;
        uniform sampler2D depths;
        out vec4 colour;
        void main() {
          ivec2 at = ivec2(gl_FragCoord.xy);
          float depth = texelFetch(depths, at, 0).r;
          if (depth >= 1.0) discard;
          gl_FragDepth = depth;
          colour = texelFetch(colours, at, 0);
        }`,
    });
    super(screen, material);
    this.frustumCulled = false;
  }

  override onBeforeRender = (renderer: WebGLRenderer, _scene: unknown, camera: Camera): void => {
    const { x: width, y: height } = renderer.getDrawingBufferSize(this.buffer);
    if (width !== this.film.width || height !== this.film.height) this.resize(width, height);
    const clip = new Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    const { position, color } = this.points.attributes;
    const count = position && color ? this.points.drawRange.count : 0;
    const size = this.size * renderer.getPixelRatio();
    splat(this.film, clip.elements, (position?.array ?? new Float32Array()) as Float32Array, (color?.array ?? new Float32Array()) as Float32Array, count, size);
    for (const { value } of Object.values(this.material.uniforms)) (value as DataTexture).needsUpdate = true;
  };

  override dispose(): void {
    this.letGo();
    this.geometry.dispose();
    this.material.dispose();
  }

  private resize(width: number, height: number): void {
    this.letGo();
    const pixels = width * height;
    const film = { width, height, colours: new Uint32Array(pixels), depths: new Float32Array(pixels) };
    const { uniforms } = this.material;
    uniforms.colours!.value = new DataTexture(new Uint8Array(film.colours.buffer), width, height);
    uniforms.depths!.value = new DataTexture(film.depths, width, height, RedFormat, FloatType);
    this.film = film;
  }

  private letGo(): void {
    for (const { value } of Object.values(this.material.uniforms)) (value as DataTexture | null)?.dispose();
  }
}
