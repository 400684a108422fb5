/** One path per lane width: thousands of lanes are a handful of elements. */
export function lanePaths(
  lanes: readonly (readonly (readonly number[])[])[],
  widths: readonly number[],
): { width: number; path: string }[] {
  const byWidth = new Map<number, string[]>();
  lanes.forEach((lane, i) => {
    const width = Math.round((widths[i] ?? 3) * 2) / 2;
    const paths = byWidth.get(width) ?? [];
    byWidth.set(width, paths);
    paths.push(polyline(lane.map(([x = 0, y = 0]) => [x, y])));
  });
  return [...byWidth].map(([width, paths]) => ({ width, path: paths.join("") }));
}

export function polyline(points: readonly (readonly [number, number])[]): string {
  return points.map(([x, y], i) => `${i === 0 ? "M" : "L"}${x.toFixed(2)},${y.toFixed(2)}`).join("");
}
