import { describe, expect, test } from "vitest";
import { axesOf, bars, chosenPad, keyName, Presses, readPad } from "../src/run/device";

const button = (value: number) => ({ value, pressed: value > 0.5, touched: value > 0 });
const pad = (change: Partial<Gamepad> = {}): Gamepad =>
  ({
    id: "a pad", index: 0, connected: true, timestamp: 1, mapping: "standard", vibrationActuator: null,
    axes: [-0.5, 0.1, 0.2, 0.3], buttons: Array.from({ length: 17 }, () => button(0)), ...change,
  }) as unknown as Gamepad;

describe("axes of a pad", () => {
  test("of the standard layout have SDL's numbers, its triggers among them", () => {
    const buttons = pad().buttons.map((_, number) => button(number === 7 ? 0.75 : 0));
    expect(axesOf(pad({ buttons }))).toEqual([-0.5, 0.1, -1, 0.2, 0.3, 0.5]);
  });
  test("of another layout are the browser's, within their range", () => {
    expect(axesOf(pad({ mapping: "", axes: [0.25, 7, Number.NaN] }))).toEqual([0.25, 1, 0]);
  });
});

test("a short press is counted though it is over", () => {
  const presses = new Presses();
  presses.set("q", true);
  presses.set("q", true);
  presses.set("q", false);
  expect(presses.held).toEqual([]);
  expect(presses.presses).toEqual({ q: 1 });
  presses.set("q", true);
  expect(presses.presses).toEqual({ q: 2 });
  presses.release();
  expect(presses.held).toEqual([]);
});

test("buttons of a pad go by their numbers", () => {
  const presses = new Presses();
  const buttons = pad().buttons.map((_, number) => button(number === 1 ? 1 : 0));
  expect(readPad(pad({ buttons }), presses)).toMatchObject({ held: ["button1"], presses: { button1: 1 } });
  expect(readPad(pad(), presses).held).toEqual([]);
});

test("the pad that was moved last drives, and one that is gone does not", () => {
  const used = pad({ id: "used", timestamp: 9 });
  expect(chosenPad([null, pad(), used, pad({ id: "gone", connected: false, timestamp: 20 })])).toBe(used);
  expect(chosenPad([null])).toBeNull();
});

test("keys go by their place, and others are left alone", () => {
  expect(keyName("KeyW")).toBe("w");
  expect(keyName("ArrowLeft")).toBe("left");
  expect(keyName("F5")).toBeNull();
});

test("bars show what is pressed", () => {
  const numbers = { steer_axis: 0, throttle_axis: 5, brake_axis: 2 };
  const pressed = { held: [], presses: {}, axes: [-0.5, 0, -1, 0, 0, 0.5] };
  expect(bars({ device: "gamepad", camera: "CAM", inputs: numbers }, pressed).map((bar) => bar.value)).toEqual([-0.5, 0.75, 0]);
  const keys = { held: ["d", "up"], presses: {}, axes: [] };
  expect(bars({ device: "keyboard", camera: "CAM", inputs: {} }, keys).map((bar) => bar.value)).toEqual([1, 1, 0]);
});
