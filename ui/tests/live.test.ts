import { describe, expect, test } from "vitest";
import { MOST_POINTS, thinned } from "../src/api/live";

describe("a long series", () => {
  const long = thinned(Array.from({ length: 4 * MOST_POINTS }, (_, index) => index));
  test("keeps its begin, and not too much", () => {
    expect(long[0]).toBe(0);
    expect(long.length).toBeLessThanOrEqual(MOST_POINTS);
    expect(long.at(-1)).toBeGreaterThan(4 * MOST_POINTS - 20);
  });
  test("is thinned evenly", () => {
    const gaps = long.slice(1).map((point, index) => point - (long[index] ?? 0));
    const mean = (long.at(-1) ?? 0) / gaps.length;
    expect(Math.max(...gaps)).toBeLessThanOrEqual(3 * mean);
  });
  test("keeps both of two workers that take turns", () => {
    const even = long.filter((point) => point % 2 === 0).length;
    expect(even / long.length).toBeCloseTo(0.5, 1);
  });
  test("is left alone while it is short", () => expect(thinned([1, 2, 3])).toEqual([1, 2, 3]));
});
