import { describe, expect, it } from "vitest";
import { aligned, around, distributed, turnedAlike } from "../src/rig/arrange";
import type { Pose } from "../src/rig/coordinates";

const pose = (part: Partial<Pose>): Pose => ({ x: 0, y: 0, z: 0, roll_deg: 0, pitch_deg: 0, yaw_deg: 0, ...part });
const three = new Map([
  ["b", pose({ x: 5, z: 1, yaw_deg: 90 })],
  ["a", pose({ x: 1, z: 2, yaw_deg: 10 })],
  ["c", pose({ x: 2, z: 3, yaw_deg: -100 })],
]);

describe("arranging sensors", () => {
  it("aligns with the first that was chosen", () => {
    expect([...aligned(three, "z").values()].map((one) => one.z)).toEqual([1, 1, 1]);
    expect(aligned(three, "z").get("a")).toMatchObject({ x: 1, yaw_deg: 10 });
    expect([...turnedAlike(three).values()].map((one) => one.yaw_deg)).toEqual([90, 90, 90]);
  });
  it("spreads evenly between the outermost, in order", () => {
    const spread = distributed(three, "x");
    expect(["a", "c", "b"].map((id) => spread.get(id)?.x)).toEqual([1, 3, 5]);
  });
  it("turns all around from the first", () => {
    const turned = around(three);
    expect(["b", "c", "a"].map((id) => turned.get(id)?.yaw_deg)).toEqual([90, 210, 330]);
  });
  it("leaves none where there is none", () => {
    expect(aligned(new Map(), "x").size + distributed(new Map(), "x").size + around(new Map()).size).toBe(0);
  });
});
