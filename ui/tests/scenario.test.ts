import { describe, expect, test } from "vitest";
import { changesOf, freeMoment, mapsOf, moved, startOf, stopsOf, withChanges, withStart, withStops } from "../src/scenario/scenario";
import { nearestSpawn, neighbour, placeOnRoad } from "../src/scenario/townMap";

const town = {
  map: "T",
  lanes: [
    [[0, 0], [100, 0]],
    [[100, 4], [0, 4]],
  ],
  lane_heights_m: [
    [0, 10],
    [10, 0],
  ],
  lane_widths_m: [3.5, 3.5],
  spawn_points: [],
  note: "",
};

describe("places on a map", () => {
  test("a press beside a lane is a place on it, at its height, in its direction of travel", () => {
    expect(placeOnRoad(town, 50, 1)).toEqual({ x: 50, y: 0, z: 5.3, yaw_deg: 0 });
    expect(placeOnRoad(town, 25, 3.5)).toEqual({ x: 25, y: 4, z: 2.8, yaw_deg: 180 });
    expect(placeOnRoad(town, 50, -40)).toBeNull();
  });
  test("the nearest spawn point counts within a distance", () => {
    const points = [[0, 0], [10, 0]];
    expect(nearestSpawn(points, 7, 1, 5)).toBe(1);
    expect(nearestSpawn(points, 5, 30, 5)).toBeNull();
  });
  test("arrow keys reach the next point in their direction, and stay at the edge", () => {
    const points = [[0, 0], [10, 1], [30, 0], [0, 10]];
    expect(neighbour(points, 0, [1, 0])).toBe(1);
    expect(neighbour(points, 1, [1, 0])).toBe(2);
    expect(neighbour(points, 0, [0, 1])).toBe(3);
    expect(neighbour(points, 0, [-1, 0])).toBe(0);
  });
});

describe("start, route and weather of a document", () => {
  test("a start is random, a number or a place", () => {
    expect(startOf({})).toBe("random");
    expect(startOf(withStart({}, 3))).toBe(3);
    expect(startOf(withStart({}, { x: 1, y: 2, z: 3, yaw_deg: 4 }))).toEqual({ x: 1, y: 2, z: 3, yaw_deg: 4 });
  });
  test("a route without places is none", () => {
    const made = withStops({}, [4, { x: 1, y: 2 }]);
    expect(made.scenario).toEqual({ kind: "route", through: [4, { x: 1, y: 2 }] });
    expect(stopsOf(made)).toEqual([4, { x: 1, y: 2 }]);
    expect(withStops(made, []).scenario).toEqual({ kind: "autopilot" });
    expect(moved([1, 2, 3], 2, 0)).toEqual([3, 1, 2]);
  });
  test("a change of the weather comes where most time is left", () => {
    const at = (at_s: number) => ({ at_s, choice: "WetNoon", parameters: {} });
    expect(freeMoment([], 5)).toBe(2.5);
    expect(freeMoment([at(1)], 5)).toBe(3);
    const made = withChanges({ weather: "ClearNoon" }, [at(1)]);
    expect(made.weather).toEqual({ choice: "ClearNoon", changes: [{ at_s: 1, choice: "WetNoon" }] });
    expect(changesOf(made)).toEqual([at(1)]);
  });
  test("all maps are those that the server is known to have", () => {
    expect(mapsOf({ map: { random_from: ["all", "X"] } }, ["A", "X"])).toEqual(["A", "X"]);
    expect(mapsOf({ map: { choice: "A" } }, [])).toEqual(["A"]);
  });
});
