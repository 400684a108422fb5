import type { SchemaMessage } from "../api/types";
import { getAt, isObject, setAt, type Json, type JsonObject } from "../state/json";
import type { Pose } from "./coordinates";
import { wrapDegrees } from "./coordinates";
import { kindOf } from "./kinds";

/** A sensor of the document with every number filled in. */
export interface RigSensor {
  /** Its place among all sensors: what is chosen is told by it, as two may have one name for a while. */
  key: string;
  id: string;
  kind: string;
  pose: Pose;
  attributes: JsonObject;
  onEgo: boolean;
  /** As the document or the preset has it. */
  given: JsonObject;
  /** Place in `rig.sensors`; null: it comes from `rig.preset` and is copied when it is changed. */
  index: number | null;
}

const ANGLES = ["roll_deg", "pitch_deg", "yaw_deg"] as const;
const PLACES = ["x", "y", "z"] as const;

/** Sensors as plain JSON of `rig.preset`, or none while they are not known. */
export type PresetSensors = readonly JsonObject[];

function number(value: Json | undefined, otherwise = 0): number {
  return typeof value === "number" && Number.isFinite(value) ? value : otherwise;
}

export function poseOf(value: Json | undefined): Pose {
  const pose = isObject(value) ? value : {};
  return {
    x: number(pose.x),
    y: number(pose.y),
    z: number(pose.z),
    roll_deg: number(pose.roll_deg),
    pitch_deg: number(pose.pitch_deg),
    yaw_deg: number(pose.yaw_deg),
  };
}

function rigSensor(value: Json, index: number | null): Omit<RigSensor, "key"> | null {
  if (!isObject(value)) return null;
  return {
    id: String(value.id ?? ""),
    kind: String(value.kind ?? ""),
    pose: poseOf(value.pose),
    attributes: isObject(value.attributes) ? value.attributes : {},
    onEgo: (value.attach_to ?? "ego") === "ego",
    given: value,
    index,
  };
}

/** All sensors of the rig, those of the preset first. */
export function sensorsOf(document: JsonObject, preset: PresetSensors): RigSensor[] {
  const listed = getAt(document, ["rig", "sensors"]);
  const named = getAt(document, ["rig", "preset"]);
  const from = typeof named === "string" ? preset.map((one) => rigSensor(one, null)) : [];
  const own = Array.isArray(listed) ? listed.map((one, index) => rigSensor(one, index)) : [];
  return [...from, ...own].filter((one) => one !== null).map((one, at) => ({ ...one, key: String(at) }));
}

/** The document with the preset's sensors written out, so that they can be changed. */
export function unfolded(document: JsonObject, preset: PresetSensors): JsonObject {
  if (typeof getAt(document, ["rig", "preset"]) !== "string") return document;
  const listed = getAt(document, ["rig", "sensors"]);
  const all = [...preset, ...(Array.isArray(listed) ? listed : [])];
  return setAt(setAt(document, ["rig", "sensors"], all), ["rig", "preset"], undefined);
}

function list(document: JsonObject): JsonObject[] {
  const listed = getAt(document, ["rig", "sensors"]);
  return Array.isArray(listed) ? listed.filter(isObject) : [];
}

function withList(document: JsonObject, sensors: JsonObject[]): JsonObject {
  return setAt(document, ["rig", "sensors"], sensors);
}

function tidy(value: number): number {
  return Math.round(value * 1e4) / 1e4;
}

/** Poses rounded to a tenth of a millimetre; zeros stay out of the document, as one would write it. */
export function poseJson(pose: Pose): JsonObject {
  const made: JsonObject = {};
  for (const key of PLACES) if (tidy(pose[key]) !== 0) made[key] = tidy(pose[key]);
  for (const key of ANGLES) {
    const angle = tidy(wrapDegrees(pose[key]));
    if (angle !== 0) made[key] = angle;
  }
  return made;
}

/** Give sensors another pose; they are named by their keys. */
export function withPoses(
  document: JsonObject,
  keys: readonly string[],
  change: (pose: Pose, key: string) => Pose,
): JsonObject {
  return withList(
    document,
    list(document).map((sensor, at) =>
      keys.includes(String(at))
        ? { ...sensor, pose: poseJson(change(poseOf(sensor.pose), String(at))) }
        : sensor,
    ),
  );
}

/** A name that is not taken: `CAM`, `CAM_2`, … */
export function freeName(wanted: string, taken: readonly string[]): string {
  if (!taken.includes(wanted)) return wanted;
  const stem = wanted.replace(/_\d+$/, "");
  for (let n = 2; ; n += 1) if (!taken.includes(`${stem}_${n}`)) return `${stem}_${n}`;
}

export function withSensor(document: JsonObject, kind: string, pose: Pose): [JsonObject, string] {
  const sensors = list(document);
  const id = freeName(kindOf(kind)?.short ?? "SENSOR", sensors.map((one) => String(one.id)));
  const made = { id, kind, pose: poseJson(pose), attributes: {} };
  return [withList(document, [...sensors, made]), String(sensors.length)];
}

export function without(document: JsonObject, keys: readonly string[]): JsonObject {
  return withList(document, list(document).filter((_, at) => !keys.includes(String(at))));
}

/** Copies go to the end of the list; these are their keys. */
function appended(sensors: readonly JsonObject[], copies: readonly JsonObject[]): string[] {
  return copies.map((_, at) => String(sensors.length + at));
}

export function withCopies(document: JsonObject, keys: readonly string[]): [JsonObject, string[]] {
  const sensors = list(document);
  const taken = sensors.map((one) => String(one.id));
  const copies = sensors
    .filter((_, at) => keys.includes(String(at)))
    .map((one) => {
      const id = freeName(String(one.id), taken);
      taken.push(id);
      // Aside, so that it is seen; several in one place keep their place among each other.
      const pose = poseOf(one.pose);
      return { ...structuredClone(one), id, pose: poseJson({ ...pose, y: pose.y + 0.2 }) };
    });
  return [withList(document, [...sensors, ...copies]), appended(sensors, copies)];
}

/** Copies on the other side of the car; a name that holds the side changes it. */
export function withMirrored(document: JsonObject, keys: readonly string[]): [JsonObject, string[]] {
  const sensors = list(document);
  const taken = sensors.map((one) => String(one.id));
  const copies = sensors
    .filter((_, at) => keys.includes(String(at)))
    .map((one) => {
      const id = freeName(mirrorName(String(one.id)), taken);
      taken.push(id);
      return { ...structuredClone(one), id, pose: poseJson(mirrored(poseOf(one.pose))) };
    });
  return [withList(document, [...sensors, ...copies]), appended(sensors, copies)];
}

export function mirrored(pose: Pose): Pose {
  return { ...pose, y: -pose.y, yaw_deg: -pose.yaw_deg, roll_deg: -pose.roll_deg };
}

export function mirrorName(id: string): string {
  const swap: Record<string, string> = { LEFT: "RIGHT", RIGHT: "LEFT", left: "right", right: "left" };
  return id.replace(/LEFT|RIGHT|left|right/g, (side) => swap[side] ?? side);
}

/** What a sensor looks at. */
export type View =
  | { shape: "pyramid"; h: number; v: number; range: number }
  | { shape: "cone"; h: number; v: number; range: number }
  | { shape: "sweep"; h: number; upper: number; lower: number; channels: number; range: number };

/** Where the numbers come from that a document leaves out. */
export type Defaults = Pick<SchemaMessage, "defaults" | "sensor_defaults">;

/** What the sensor looks at; null where it does not look, or its numbers are of no such shape. */
export function viewOf(sensor: RigSensor, document: JsonObject, defaults: Defaults): View | null {
  const view = shapeOf(sensor, document, defaults);
  return view && view.h > 0 && view.range > 0 ? view : null;
}

function shapeOf(sensor: RigSensor, document: JsonObject, { defaults, sensor_defaults }: Defaults): View | null {
  const otherwise = getAt(sensor_defaults[sensor.kind] as JsonObject | undefined, ["attributes"]);
  const byKind = isObject(otherwise) ? otherwise : {};
  // A document may name an attribute as CARLA does: without its unit.
  const read = (name: string) =>
    number(sensor.attributes[name] ?? sensor.attributes[name.replace(/_(deg|m)$/, "")], number(byKind[name]));
  const shared = (key: string) => document[key] ?? (defaults as JsonObject)[key];
  switch (kindOf(sensor.kind)?.field_of_view) {
    case "pyramid": {
      const { image_size, image_size_x, image_size_y } = sensor.attributes;
      const byAxis = image_size_x !== undefined && image_size_y !== undefined ? [image_size_x, image_size_y] : undefined;
      const size = image_size ?? byAxis ?? shared("image_size");
      const lens = sensor.given.lens;
      const [h, v] = isObject(lens) ? anglesOf(lens, size) : [read("fov_deg"), verticalAngle(read("fov_deg"), size)];
      return { shape: "pyramid", h, v, range: number(shared("max_distance_m")) };
    }
    case "cone":
      return { shape: "cone", h: read("horizontal_fov_deg"), v: read("vertical_fov_deg"), range: read("range_m") };
    case "sweep":
      return {
        shape: "sweep",
        h: read("horizontal_fov_deg"),
        upper: read("upper_fov_deg"),
        lower: read("lower_fov_deg"),
        channels: read("channels"),
        range: read("range_m"),
      };
    default:
      return null;
  }
}

/**
 * What a lens shows across and down, degrees, without its distortion; 0 where that is no pyramid: half
 * the sphere and more.
 */
function anglesOf(lens: JsonObject, size: Json | undefined): [number, number] {
  const pixels = Array.isArray(size) ? size.map((one) => number(one)) : [];
  const angle = (across: number | undefined, focal: Json | undefined) => {
    const half = (across ?? 0) / 2 / number(focal);
    if (lens.model === "kannala_brandt") return Math.min((half * 360) / Math.PI, 2 * number(lens.max_angle_deg, 180));
    return (Math.atan(half) * 360) / Math.PI;
  };
  const [h, v] = [angle(pixels[0], lens.fx), angle(pixels[1], lens.fy)];
  return h < 180 && v < 180 ? [h, v] : [0, 0];
}

/** Vertical field of view of a pinhole camera whose pictures have that size, degrees. */
function verticalAngle(h: number, size: Json | undefined): number {
  const [width, height] = Array.isArray(size) ? [number(size[0]), number(size[1])] : [0, 0];
  const half = (Math.tan((Math.min(h, 179) * Math.PI) / 360) * height) / Math.max(width, 1);
  return (Math.atan(half) * 360) / Math.PI;
}
