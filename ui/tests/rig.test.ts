import { beforeAll, describe, expect, test } from "vitest";
import { blindShare, crosses, groundCoverage, type Box } from "../src/rig/coverage";
import { heightAt } from "../src/rig/mounts";
import { groundRings, hull, type Point } from "../src/rig/outline";
import { SIDE, TOP, fit, fromScreen, toScreen } from "../src/rig/plane";
import { freeName, mirrorName, sensorsOf, unfolded, viewOf, withCopies, withMirrored, without, withPoses } from "../src/rig/sensors";
import { nextSelection, stacksOf } from "../src/rig/stacks";
import { setKinds } from "../src/rig/kinds";
import { getAt, type JsonObject } from "../src/state/json";
import { DEFAULTS, KINDS } from "./sensorKinds";

beforeAll(() => setKinds(KINDS));

const camera = { id: "CAM_LEFT", kind: "rgb", pose: { x: 1, y: -0.4, z: 1.6, yaw_deg: -60 }, attributes: { fov_deg: 90 } };
const lidar = { id: "LIDAR", kind: "lidar", pose: { z: 1.9 }, attributes: { channels: 3, lower_fov_deg: -45, upper_fov_deg: 5 } };
const document: JsonObject = { image_size: [640, 360], rig: { sensors: [camera, lidar] } };
const car: Box = { location: [0, 0, 0.7], extent: [2.4, 1, 0.7] };

function views(doc: JsonObject) {
  return sensorsOf(doc, []).flatMap((sensor) => {
    const view = viewOf(sensor, doc, DEFAULTS);
    return view ? [{ sensor, view }] : [];
  });
}

describe("sensors of the document", () => {
  test("a preset's sensors stand first and are written out on the first change", () => {
    const doc: JsonObject = { rig: { preset: "kitti", sensors: [lidar] } };
    expect(sensorsOf(doc, [camera]).map(({ id, index }) => [id, index])).toEqual([["CAM_LEFT", null], ["LIDAR", 0]]);
    const open = unfolded(doc, [camera]);
    expect(getAt(open, ["rig", "preset"])).toBeUndefined();
    expect(sensorsOf(open, []).map(({ id }) => id)).toEqual(["CAM_LEFT", "LIDAR"]);
  });
  test("a mirrored copy is on the other side, with the other side's name", () => {
    const [made, keys] = withMirrored(document, ["0"]);
    expect(keys).toEqual(["2"]);
    expect(getAt(made, ["rig", "sensors", 2, "id"])).toEqual("CAM_RIGHT");
    expect(getAt(made, ["rig", "sensors", 2, "pose"])).toEqual({ x: 1, y: 0.4, z: 1.6, yaw_deg: 60 });
  });
  test("names stay unique", () => {
    expect(freeName("CAM", ["CAM", "CAM_2"])).toBe("CAM_3");
    expect(mirrorName("CAM_BACK_RIGHT")).toBe("CAM_BACK_LEFT");
    const [made, keys] = withCopies(document, ["1"]);
    expect(keys).toEqual(["2"]);
    expect(getAt(made, ["rig", "sensors", 2, "id"])).toEqual("LIDAR_2");
  });
  test("deleting and moving touch only what is meant", () => {
    expect(sensorsOf(without(document, ["1"]), []).map(({ id }) => id)).toEqual(["CAM_LEFT"]);
    const moved = withPoses(document, ["1"], (pose) => ({ ...pose, x: 0.123456, yaw_deg: 190 }));
    expect(getAt(moved, ["rig", "sensors", 1, "pose"])).toEqual({ x: 0.1235, z: 1.9, yaw_deg: -170 });
    expect(getAt(moved, ["rig", "sensors", 0])).toEqual(camera);
  });
  test("two sensors of one name are told apart by their places", () => {
    const twins: JsonObject = { rig: { sensors: [camera, { ...lidar, id: "CAM_LEFT" }] } };
    expect(sensorsOf(twins, []).map(({ key, kind }) => [key, kind])).toEqual([["0", "rgb"], ["1", "lidar"]]);
    expect(sensorsOf(without(twins, ["1"]), []).map(({ kind }) => kind)).toEqual(["rgb"]);
    const moved = withPoses(twins, ["1"], (pose) => ({ ...pose, x: 1 }));
    expect(getAt(moved, ["rig", "sensors", 0])).toEqual(camera);
  });
  test("the vertical field of view follows from the picture's shape", () => {
    const view = viewOf(sensorsOf(document, [])[0]!, document, DEFAULTS);
    expect(view).toMatchObject({ shape: "pyramid", h: 90 });
    expect(view?.shape === "pyramid" && view.v).toBeCloseTo(58.716, 3); // 2 atan(360/640)
  });
  test("a lens says what its camera sees; of half the sphere and more nothing is drawn", () => {
    const seen = (lens: JsonObject) => {
      const doc: JsonObject = { image_size: [640, 360], rig: { sensors: [{ ...camera, attributes: {}, lens }] } };
      return viewOf(sensorsOf(doc, [])[0]!, doc, DEFAULTS);
    };
    const pinhole = seen({ model: "brown_conrady", fx: 160, fy: 180, k1: -0.2 });
    expect(pinhole?.h).toBeCloseTo(126.87, 2); // 2 atan(640/320)
    expect(pinhole?.shape === "pyramid" && pinhole.v).toBeCloseTo(90);
    const fisheye = { model: "kannala_brandt", fx: 320, fy: 320 };
    expect(seen(fisheye)?.h).toBeCloseTo(114.59, 2); // 2 · 320/320 rad
    expect(seen({ ...fisheye, max_angle_deg: 40 })?.h).toBe(80);
    expect(seen({ ...fisheye, fx: 150, fy: 150 })).toBeNull();
    expect(seen({ model: "equirectangular" })).toBeNull();
  });
  test("a size may be named by its sides, as CARLA does", () => {
    const lens = { model: "pinhole", fx: 160, fy: 180 };
    const attributes = { image_size_x: 320, image_size_y: 360 };
    const doc: JsonObject = { image_size: [640, 360], rig: { sensors: [{ ...camera, attributes, lens }] } };
    expect(viewOf(sensorsOf(doc, [])[0]!, doc, DEFAULTS)?.h).toBeCloseTo(90); // 2 atan(320/320)
  });
});

describe("planes", () => {
  const screen = { ...fit([-2, -3], [2, 3], 400, 600), width: 400, height: 600 };
  test("the screen is the plane and back", () => {
    const back = fromScreen(screen, toScreen(screen, [0.7, -1.2]));
    expect(back[0]).toBeCloseTo(0.7);
    expect(back[1]).toBeCloseTo(-1.2);
  });
  test("dragging right moves a sensor to the right, dragging up moves it ahead or up", () => {
    const pose = { x: 0, y: 0, z: 1, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
    expect(TOP.moved(pose, [0.5, 0.25])).toMatchObject({ x: 0.25, y: 0.5, z: 1 });
    expect(SIDE.moved(pose, [0.5, 0.25])).toMatchObject({ x: 0.5, y: 0, z: 1.25 });
  });
  test("the handle to the right of a sensor is yaw 90, above it yaw 0", () => {
    const pose = { x: 0, y: 0, z: 1, roll_deg: 0, pitch_deg: 0, yaw_deg: 17 };
    expect(TOP.turned(pose, 0).yaw_deg).toBe(90);
    expect(TOP.turned(pose, 90).yaw_deg).toBe(0);
    expect(TOP.angle(TOP.turned(pose, 33))).toBeCloseTo(33);
  });
  test("the side view turns pitch, of sensors that look back, too", () => {
    const ahead = { x: 0, y: 0, z: 1, roll_deg: 0, pitch_deg: 0, yaw_deg: 0 };
    expect(SIDE.turned(ahead, 20).pitch_deg).toBeCloseTo(20);
    const back = { ...ahead, yaw_deg: 180 };
    expect(SIDE.turned(back, 160).pitch_deg).toBeCloseTo(20);
    expect(SIDE.angle({ ...back, pitch_deg: 20 })).toBeCloseTo(160);
  });
});

describe("what is seen", () => {
  test("a camera to the left front sees the ground there and not at the right", () => {
    const doc: JsonObject = { ...document, rig: { sensors: [camera] } };
    const counts = groundCoverage(views(doc), null, 20, 80);
    const at = (x: number, y: number) => counts[Math.floor((20 - x) / 0.5) * 80 + Math.floor((y + 20) / 0.5)];
    expect(at(6, -10)).toBe(1);
    expect(at(6, 10)).toBe(0);
    expect(at(-10, -5)).toBe(0);
  });
  test("the car hides the ground beside it from a sensor on the roof", () => {
    const low: JsonObject = { rig: { sensors: [{ ...lidar, attributes: { channels: 64, lower_fov_deg: -89, upper_fov_deg: 5 } }] } };
    const open = groundCoverage(views(low), null, 10, 80);
    const hidden = groundCoverage(views(low), car, 10, 80);
    expect(blindShare(hidden, car, 10, 80, 5)).toBeGreaterThan(blindShare(open, car, 10, 80, 5));
  });
  test("a way through a box crosses it", () => {
    expect(crosses([0, 0, 2], [0, 0, -1], [-1, -1, 0], [1, 1, 1])).toBe(true);
    expect(crosses([0, 0, 2], [5, 0, 2], [-1, -1, 0], [1, 1, 1])).toBe(false);
  });
  test("a beam of -45 degrees meets the ground as far away as it is high", () => {
    const [{ sensor, view }] = views({ rig: { sensors: [lidar] } }) as [{ sensor: never; view: never }];
    const [ring] = groundRings(sensor, view, 50);
    for (const [x, y, z] of ring ?? []) {
      expect(Math.hypot(x, y)).toBeCloseTo(1.9);
      expect(z).toBeCloseTo(0);
    }
  });
  test("a hull leaves out what is inside", () => {
    const square: Point[] = [[0, 0], [2, 0], [2, 2], [0, 2], [1, 1], [1, 0]];
    expect(hull(square)).toHaveLength(4);
  });
  test("the height of a roof is read off the side outline", () => {
    const side: Point[][] = [[[-2, 0.2], [2, 0.2], [1, 1.4], [-1, 1.4], [-2, 0.2]]];
    expect(heightAt(side, 0)).toBeCloseTo(1.4);
    expect(heightAt(side, 1.5)).toBeCloseTo(0.8);
  });
});

describe("stacks", () => {
  const twins = { ...document, rig: { sensors: [camera, { ...camera, id: "DEPTH", kind: "depth" }, lidar] } } as JsonObject;
  test("sensors in one place are one mark; clicks go through them", () => {
    const [stack] = stacksOf(sensorsOf(twins, []));
    expect(stack?.sensors.map(({ id }) => id)).toEqual(["CAM_LEFT", "DEPTH"]);
    expect(nextSelection(stack!, [])).toEqual(["0", "1"]);
    expect(nextSelection(stack!, ["0", "1"])).toEqual(["0"]);
    expect(nextSelection(stack!, ["0"])).toEqual(["1"]);
    expect(nextSelection(stack!, ["1"])).toEqual(["0", "1"]);
  });
});
