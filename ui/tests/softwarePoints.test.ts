import { describe, expect, it } from "vitest";
import { splat, type Film } from "../src/three/softwarePoints";

/** Clip space is the points' own: x to the right, y up, z away, w 1. */
const AS_THEY_ARE = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
const [RED, GREEN] = [0xff0000ff, 0xff00ff00];

function drawn(positions: number[], colours: number[], size: number, clip = AS_THEY_ARE): Film {
  const film = { width: 4, height: 4, colours: new Uint32Array(16), depths: new Float32Array(16) };
  splat(film, clip, Float32Array.from(positions), Float32Array.from(colours), positions.length / 3, size);
  return film;
}

/** Rows of the film, the lowest first: a letter where a point is. */
function rows({ colours, depths }: Film): string[] {
  const letters = [...depths].map((depth, i) => (depth === 1 ? "." : colours[i] === RED ? "r" : colours[i] === GREEN ? "g" : "?"));
  return [0, 4, 8, 12].map((at) => letters.slice(at, at + 4).join(""));
}

describe("points drawn without WebGL", () => {
  it("are squares around their places, cut at the edge of the picture", () => {
    expect(rows(drawn([-0.75, -0.25, 0], [1, 0, 0], 1))).toEqual(["....", "r...", "....", "...."]);
    expect(rows(drawn([0, 0, 0], [0, 1, 0], 2))).toEqual(["....", ".gg.", ".gg.", "...."]);
    expect(rows(drawn([1, 1, 0], [1, 0, 0], 3))).toEqual(["....", "....", "..rr", "..rr"]);
  });

  it("hide each other, the nearest on top, in whatever order they come", () => {
    const [near, far] = [[0, 0, -0.5], [0, 0, 0.5]];
    expect(rows(drawn([...near, ...far], [1, 0, 0, 0, 1, 0], 2))[1]).toBe(".rr.");
    expect(rows(drawn([...far, ...near], [0, 1, 0, 1, 0, 0], 2))[1]).toBe(".rr.");
    expect(drawn([...far], [0, 1, 0], 2).depths[5]).toBeCloseTo(0.75);
  });

  it("are left out behind the eye and before and behind what is in view", () => {
    const empty = ["....", "....", "....", "...."];
    expect(rows(drawn([0, 0, -1.1], [1, 0, 0], 2))).toEqual(empty);
    expect(rows(drawn([0, 0, 1.1], [1, 0, 0], 2))).toEqual(empty);
    const eye = AS_THEY_ARE.with(15, -1);
    expect(rows(drawn([0, 0, 0], [1, 0, 0], 2, eye))).toEqual(empty);
  });

  it("have the colours that materials of three.js have", () => {
    const { colours } = drawn([0, 0, 0], [0.5, 0, 1], 2);
    expect((colours[5] ?? 0) >>> 0).toBe(0xffff00bc); // 0.5 linear is 188 in sRGB
  });
});
