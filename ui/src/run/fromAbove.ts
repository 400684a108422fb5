const RINGS_M = [10, 20, 40];
const HALF_M = { points: 45, radar: 60 };

/**
 * Points from above, the car in the middle, ahead is up. Higher points are brighter; a radar's
 * detections are in another colour when they come nearer.
 */
export function drawFromAbove(canvas: HTMLCanvasElement, points: Float32Array, kind: "points" | "radar", colourName: string): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  const { width, height } = canvas;
  const style = getComputedStyle(document.documentElement);
  const colour = (name: string) => style.getPropertyValue(name).trim();
  const scale = Math.min(width, height) / 2 / HALF_M[kind];
  const [cx, cy] = [width / 2, kind === "radar" ? height * 0.62 : height / 2];
  context.fillStyle = colour("--view");
  context.fillRect(0, 0, width, height);
  context.strokeStyle = colour("--line");
  for (const ring of RINGS_M) {
    context.beginPath();
    context.arc(cx, cy, ring * scale, 0, 2 * Math.PI);
    context.stroke();
  }
  const [r, g, b] = colour(`--${colourName}-rgb`).split(",").map(Number);
  const size = kind === "radar" ? 3 : 1.3;
  for (let i = 0; i + 3 < points.length; i += 4) {
    const [x, y, z, value] = [points[i] ?? 0, points[i + 1] ?? 0, points[i + 2] ?? 0, points[i + 3] ?? 0];
    if (kind === "radar") context.fillStyle = value < -0.5 ? colour("--bad") : `rgb(${r},${g},${b})`;
    else context.fillStyle = `rgb(${r} ${g} ${b} / ${Math.min(1, 0.32 + Math.max(0, z + 2.2) * 0.28)})`;
    context.fillRect(cx + y * scale, cy - x * scale, size, size);
  }
  context.fillStyle = colour("--text");
  context.beginPath();
  context.moveTo(cx, cy - 6);
  context.lineTo(cx + 4, cy + 5);
  context.lineTo(cx - 4, cy + 5);
  context.fill();
}
