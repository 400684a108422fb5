import { describe, expect, test } from "vitest";
import type { Json } from "../src/state/json";
import { bytes, duration } from "../src/ui/format";
import { axisTicks, thinned } from "../src/ui/LineChart";
import { groupsOf } from "../src/form/groups";
import { alternativeOf, fieldOf, fits, initial, type SchemaNode } from "../src/form/schema";
import { href, parseRoute, type Route } from "../src/app/routes";

/** A piece of the configuration's schema, with each shape that it has. */
const schema: SchemaNode = {
  $defs: {
    MapConfig: {
      type: "object",
      properties: {
        choice: { anyOf: [{ type: "string" }, { type: "null" }], default: null, title: "Map", basic: true },
        random_from: { anyOf: [{ type: "array", items: { type: "string" } }, { type: "null" }], default: null },
        layers: { anyOf: [{ const: "all", type: "string" }, { type: "array", items: { type: "string" } }], default: "all" },
      },
    },
    Vehicles: {
      type: "object",
      properties: {
        count: { type: "integer", title: "Vehicles", default: 20, minimum: 0, maximum: 1000, basic: true },
        radius_m: { anyOf: [{ type: "number", exclusiveMinimum: 0 }, { type: "null" }], title: "Vehicles within (m)", unit: "m" },
      },
    },
    Embedded: { type: "object", properties: { kind: { const: "embedded", default: "embedded" } } },
    Remote: {
      type: "object",
      required: ["kind", "host"],
      properties: { kind: { const: "remote" }, host: { type: "string", default: "127.0.0.1" } },
    },
  },
  properties: {
    fps: { type: "number", title: "Frame rate (Hz)", unit: "Hz", group: "scene", basic: true, minimum: 1, maximum: 240 },
    map: { $ref: "#/$defs/MapConfig", title: "Map", group: "scene", basic: true },
    vehicles: { $ref: "#/$defs/Vehicles", group: "traffic", basic: true },
    image_size: { type: "array", prefixItems: [{ type: "integer" }, { type: "integer" }], unit: "px", group: "rig", basic: true },
    server: {
      oneOf: [{ $ref: "#/$defs/Embedded" }, { $ref: "#/$defs/Remote" }],
      discriminator: { propertyName: "kind", mapping: { embedded: "#/$defs/Embedded", remote: "#/$defs/Remote" } },
      group: "server",
      basic: true,
    },
    rig: { type: "object", group: "rig" },
  },
};
const field = (name: string) => fieldOf(schema, schema.properties?.[name] ?? {});

describe("fields", () => {
  test("a number knows its title without the unit, its unit and its bounds", () => {
    expect(field("fps")).toMatchObject({ kind: "number", title: "Frame rate", unit: "Hz", minimum: 1, maximum: 240 });
  });
  test("a value or null is an optional value", () => {
    expect(field("vehicles").properties?.radius_m).toMatchObject({ kind: "number", optional: true, unit: "m" });
  });
  test("a word or a list is a choice between the two", () => {
    const layers = field("map").properties?.layers;
    expect(layers?.kind).toBe("choices");
    expect(layers?.alternatives?.map(({ kind }) => kind)).toEqual(["const", "list"]);
    expect(fits(layers!.alternatives![0]!, "all")).toBe(true);
    expect(fits(layers!.alternatives![1]!, "all")).toBe(false);
  });
  test("a number that is being typed stays one", () => {
    const percent = fieldOf(schema, {
      anyOf: [{ type: "number" }, { type: "array", prefixItems: [{ type: "number" }, { type: "number" }] }],
    });
    const typed = (value: Json | undefined, before: number) => alternativeOf(percent.alternatives ?? [], value, before);
    expect([typed(-20, -1), typed("-", 0), typed("", 0)]).toEqual([0, 0, 0]);
    expect([typed([1, 2], 0), typed(undefined, 0), typed("word", -1)]).toEqual([1, -1, -1]);
  });
  test("kinds of a section begin with what they need", () => {
    const server = field("server");
    expect(server).toMatchObject({ kind: "variants", discriminator: "kind" });
    expect(initial(server.variants!.remote!)).toEqual({ kind: "remote", host: "127.0.0.1" });
  });
  test("a size is a pair", () => expect(field("image_size").kind).toBe("pair"));
});

describe("groups", () => {
  const groups = groupsOf(schema);
  test("stand in the form's order, the rig apart", () => {
    expect(groups.map(({ name }) => name)).toEqual(["server", "scene", "traffic", "rig"]);
    expect(groups.flatMap(({ basic, more }) => [...basic, ...more]).some(({ path }) => path[0] === "rig")).toBe(false);
  });
  test("usual settings are open, the others below more", () => {
    const traffic = groups.find(({ name }) => name === "traffic");
    expect(traffic?.basic.map(({ path }) => path.join("."))).toEqual(["vehicles.count"]);
    expect(traffic?.more.map(({ path }) => path.join("."))).toEqual(["vehicles.radius_m"]);
  });
  test("one name or a draw is one control; what else the section has is beside it", () => {
    const scene = groups.find(({ name }) => name === "scene");
    expect(scene?.basic.map(({ path }) => path.join("."))).toEqual(["fps", "map"]);
    expect(scene?.more.map(({ path }) => path.join("."))).toEqual(["map.layers"]);
  });
});

describe("words and numbers", () => {
  test("bytes and durations read like prose", () => {
    expect([bytes(0), bytes(999), bytes(1234), bytes(106e6), bytes(61.7e9)]).toEqual(["0 B", "999 B", "1.2 kB", "106 MB", "61.7 GB"]);
    expect([duration(24.2), duration(75), duration(3700)]).toEqual(["24 s", "1 min 15 s", "1 h 01 min"]);
  });
  test("an axis has round values between its ends", () => {
    expect(axisTicks(0, 7, 3)).toEqual([0, 5]);
    expect(axisTicks(0, 4200, 3)).toEqual([0, 2000, 4000]);
    expect(axisTicks(12, 200, 4, true)).toEqual([60, 120, 180]);
    expect(axisTicks(0, 0.6, 3, true)).toEqual([0]);
    expect(axisTicks(0, 0, 3)).toEqual([]);
  });
  test("a thinned line keeps its peaks", () => {
    const points = Array.from({ length: 5000 }, (_, i): [number, number] => [i, i === 2501 ? 9 : 0]);
    const few = thinned(points);
    expect(few.length).toBeLessThanOrEqual(400);
    expect(Math.max(...few.map(([, y]) => y))).toBe(9);
  });
  test("addresses go there and back", () => {
    const routes: Route[] = [
      { page: "configure" },
      { page: "run", run: "20261122-1" },
      { page: "datasets", dataset: "a~b" },
      { page: "episode", dataset: "a~b", episode: "0f" },
    ];
    for (const route of routes) expect(parseRoute(href(route))).toEqual(route);
    expect(parseRoute("#/nowhere")).toEqual({ page: "configure" });
  });
});
