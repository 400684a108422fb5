import { describe, expect, test } from "vitest";
import { readingName, readingText } from "../src/episode/FrameFacts";

describe("readings of small sensors", () => {
  test("have units and no more digits than tell something", () => {
    expect(readingText("accelerometer", [2.017, 2.3072e-6, 9.81])).toBe("2.02, 0.00, 9.81 m/s²");
    expect(readingText("gyroscope", [0, 0.5, -9.1563e-7])).toBe("0.0000, 0.5000, 0.0000 rad/s");
    expect([readingName("compass_rad"), readingText("compass_rad", 3.14159)]).toEqual(["compass", "3.1416 rad"]);
    expect([readingName("altitude_m"), readingText("altitude_m", 0)]).toEqual(["altitude", "0.00 m"]);
  });
  test("tell places of a metre apart", () => {
    expect(readingText("latitude_deg", 49.00061)).toBe("49.0006100°");
    expect(readingText("latitude_deg", 49.00062)).not.toBe(readingText("latitude_deg", 49.00061));
  });
  test("of others are told as they are", () => {
    expect([readingName("velocity"), readingText("velocity", [1.5, 2])]).toEqual(["velocity", "1.5000, 2"]);
    expect(readingText("compass_rad", null)).toBe("–");
  });
});
