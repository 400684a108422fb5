import { describe, expect, test } from "vitest";
import { href, parseRoute } from "../src/app/routes";
import { LOAD, ofWorker, QUEUE, SAVED_FRAMES } from "../src/run/curves";
import { chosenRuns, MOST_COMPARED, valueText, withRun } from "../src/run/selection";
import { readAt, type Point } from "../src/ui/LineChart";
import type { LoadPoint, TickPoint } from "../src/api/types";

const tick = (time: number, worker: number, frames_s: number | null): TickPoint => ({
  time, worker, tick: 0, tick_s: null, frames_s, queued_bytes: 100, waited_s: 0,
});
const load = (time: number, worker: number): LoadPoint => ({
  time, worker, cpu_cores: 1 + worker, memory_bytes: 10, written_bytes_s: null, disk_free_bytes: 1,
});

describe("the runs that an address chooses", () => {
  test("each once, in their order, as many as can be told apart", () => {
    const many = Array.from({ length: MOST_COMPARED + 2 }, (_, i) => ["run", `r${i}`]);
    expect(chosenRuns(new URLSearchParams([["run", "r0"], ...many]))).toEqual(many.slice(0, MOST_COMPARED).map(([, id]) => id));
  });
  test("one more or less", () => {
    expect(withRun(["a", "b"], "c", true)).toEqual(["a", "b", "c"]);
    expect(withRun(["a", "b"], "a", false)).toEqual(["b"]);
  });
  test("the page has an address", () => {
    expect(parseRoute("#/compare?run=a&run=b")).toEqual({ page: "compare" });
    expect(href({ page: "compare" })).toBe("#/compare");
  });
});

test("values are words, sensors their kind, nothing a dash", () => {
  expect([null, true, "", "x", 60, [1, 2], { id: "TOP", kind: "lidar" }].map(valueText)).toEqual(
    ["–", "yes", "(empty)", "x", "60", "[1,2]", "lidar"],
  );
});

describe("curves", () => {
  test("frames of several workers are summed as long as they are not old", () => {
    const ticks = [tick(1, 1, 2), tick(2, 2, 3), tick(3, 1, null), tick(30, 1, 4)];
    expect(SAVED_FRAMES.points(ticks, [], 0)).toEqual([[1, 2], [2, 5], [30, 4]]);
    expect(QUEUE.points(ticks.slice(0, 2), [], 1)).toEqual([[0, 100], [1, 200]]);
  });
  test("the load of a whole run is the one that the run tells of itself", () => {
    const [ticks, loads] = ofWorker([tick(1, 1, 2), tick(2, 2, 3)], [load(1, 0), load(1, 1)], 0);
    expect(ticks).toHaveLength(2);
    expect(LOAD[0]?.points(ticks, loads, 0)).toEqual([[1, 1]]);
    expect(ofWorker(ticks, [load(1, 0), load(1, 2)], 2)).toEqual([[tick(2, 2, 3)], [load(1, 2)]]);
  });
  test("what was not measured is not drawn", () => {
    expect(LOAD[2]?.points([], [load(1, 0)], 0)).toEqual([]);
  });
  test("nothing is read beside what was measured", () => {
    const points: Point[] = [[1, 5], [3, 7]];
    expect(readAt(points, 1.4)).toEqual([1, 5]);
    expect(readAt(points, 3.1)).toBeUndefined();
    expect(readAt([], 1)).toBeUndefined();
  });
});
