import { readFileSync } from "node:fs";
import { Euler, Matrix4, Vector3 } from "three";
import { describe, expect, test } from "vitest";
import { eulerZYX, fromThree, rotate, rotateBack, rotation, snap, toThree, wrapDegrees, type Pose, type Vector } from "../src/rig/coordinates";

interface Golden {
  pose: Pose;
  vehicle_from_sensor: number[][];
}
// Written by Python out of carstage.geometry; a test there says that it is current.
const golden = JSON.parse(readFileSync(new URL("golden/poses.json", import.meta.url), "utf8")) as Golden[];
const PROBE: Vector = [0.3, -1.2, 2.5];

function place(matrix: number[][], v: Vector): Vector {
  return [0, 1, 2].map((row) => {
    const [a = 0, b = 0, c = 0, d = 0] = matrix[row] ?? [];
    return a * v[0] + b * v[1] + c * v[2] + d;
  }) as unknown as Vector;
}

describe("frames", () => {
  test("the golden poses are there", () => expect(golden.length).toBeGreaterThan(20));

  test.each(golden)("rotation is CARLA's: $pose", ({ pose, vehicle_from_sensor }) => {
    rotation(pose).forEach((row, i) =>
      row.forEach((value, k) => expect(value).toBeCloseTo(vehicle_from_sensor[i]?.[k] ?? NaN, 12)),
    );
    rotateBack(rotation(pose), rotate(rotation(pose), PROBE)).forEach((value, i) =>
      expect(value).toBeCloseTo(PROBE[i] ?? NaN, 12),
    );
  });

  test.each(golden)("three.js puts a point where CARLA does: $pose", ({ pose, vehicle_from_sensor }) => {
    const turned = new Matrix4().makeRotationFromEuler(new Euler(...eulerZYX(pose), "ZYX"));
    turned.setPosition(...toThree([pose.x, pose.y, pose.z]));
    const there = new Vector3(...toThree(PROBE)).applyMatrix4(turned);
    const expected = toThree(place(vehicle_from_sensor, PROBE));
    [there.x, there.y, there.z].forEach((value, i) => expect(value).toBeCloseTo(expected[i] ?? NaN, 9));
  });

  test("a pose comes back from three.js", () => {
    const pose: Pose = { x: 1, y: -0.5, z: 1.6, roll_deg: 3, pitch_deg: -12, yaw_deg: 100 };
    const back = fromThree(toThree([pose.x, pose.y, pose.z]), eulerZYX(pose));
    for (const key of Object.keys(pose) as (keyof Pose)[]) expect(back[key]).toBeCloseTo(pose[key], 12);
  });

  test("angles wrap and lengths snap without noise", () => {
    expect(wrapDegrees(190)).toBe(-170);
    expect(wrapDegrees(-180)).toBe(180);
    expect(snap(0.149, 0.05)).toBe(0.15);
  });
});
