import { beforeEach, describe, expect, test } from "vitest";
import { colourOf, commonKinds, kindOf, kindTable, looks, measuring, setKinds, titleOf } from "../src/rig/kinds";
import { sensorsOf, viewOf, withSensor } from "../src/rig/sensors";
import type { JsonObject } from "../src/state/json";
import { DEFAULTS, KINDS } from "./sensorKinds";

beforeEach(() => setKinds(KINDS));

function viewOfOnly(sensor: JsonObject) {
  const document: JsonObject = { rig: { sensors: [sensor] } };
  return viewOf(sensorsOf(document, [])[0]!, document, DEFAULTS);
}

describe("kinds of sensors come from the server", () => {
  test("a plug-in's kind has a name, a colour and a place in the menu", () => {
    expect(titleOf("sonar")).toBe("Sonar");
    expect(colourOf("sonar")).toBe("var(--radar)");
    const [made, key] = withSensor({}, "sonar", { x: 0, y: 0, z: 1, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 });
    expect(key).toBe("0");
    expect(sensorsOf(made, [])[0]).toMatchObject({ id: "SONAR", kind: "sonar" });
  });
  test("its field of view has its own shape and default numbers", () => {
    expect(viewOfOnly({ id: "S", kind: "sonar" })).toEqual({ shape: "cone", h: 50, v: 20, range: 5 });
  });
  test("an attribute of the document wins, under CARLA's name too", () => {
    expect(viewOfOnly({ id: "S", kind: "sonar", attributes: { range: 3, horizontal_fov_deg: 70 } })).toMatchObject({ h: 70, range: 3 });
  });
  test("what looks nowhere has no field of view", () => {
    expect(looks("imu")).toBe(false);
    expect(viewOfOnly({ id: "I", kind: "imu" })).toBeNull();
  });
  test("a kind that the server does not know is shown by its name", () => {
    expect(kindOf("quantum")).toBeNull();
    expect(titleOf("quantum")).toBe("quantum");
    expect(colourOf("quantum")).toBe("var(--muted)");
    expect(viewOfOnly({ id: "Q", kind: "quantum" })).toBeNull();
  });
  test("one button for each group that measures; ground truth and readings are in the menu", () => {
    expect(commonKinds().map(({ name }) => name)).toEqual(["rgb", "lidar", "sonar"]);
    expect(measuring(kindTable.get().modalities).map(({ title }) => title)).toEqual(["Cameras", "LiDAR", "Radar"]);
  });
});
