import { trackText } from "../ui/tracks";
import type { TableName } from "./tableAddress";

interface TableLook {
  title: string;
  /** Columns that are shown at first, in this order. */
  usual: readonly string[];
}

export const TABLES: Record<TableName, TableLook> = {
  camera_objects: {
    title: "Objects in cameras",
    usual: ["episode_id", "k", "class", "track_id", "sensor_id", "distance", "visible", "occluded", "occluded_px", "occlusion_ratio", "truncated", "visible_px", "bbox_modal", "alpha"],
  },
  objects: {
    title: "Objects",
    usual: ["episode_id", "k", "class", "track_id", "blueprint", "distance_ego", "num_lidar_points", "visibility", "velocity", "light_state"],
  },
  ego: {
    title: "Ego",
    usual: ["episode_id", "k", "timestamp_s", "speed", "throttle", "brake", "steer", "speed_limit_kmh", "location"],
  },
  events: {
    title: "Events",
    usual: ["episode_id", "k", "kind", "state", "reason", "begin_s", "end_s", "actors", "min_distance", "min_ttc", "collision", "parameters"],
  },
  frames: { title: "Frames", usual: [] },
};

/** What stands above a column where its name alone does not say it. */
const HEADINGS: Record<string, string> = {
  episode_id: "episode",
  k: "frame",
  track_id: "track",
  sensor_id: "camera",
  distance: "distance from camera",
  distance_ego: "distance from ego",
  num_lidar_points: "LiDAR points",
  num_radar_points: "radar points",
  occluded: "occlusion by vertices",
  occluded_px: "occlusion by pixels",
  visible_px: "visible pixels",
  bbox_modal: "visible 2D box",
  bbox_amodal: "whole 2D box",
  speed_limit_kmh: "speed limit",
  timestamp_s: "time",
  begin_s: "begin",
  end_s: "end",
  actors: "tracks",
  min_distance: "nearest",
  min_ttc: "least time to collision",
};
/** What the schema gives as a unit, but what are the values that there may be. */
const UNITS = new Set(["m", "s", "deg", "rad", "m/s", "m/s²", "rad/s", "px", "km/h"]);

/** What levels mean; the number stands before it. */
const OCCLUSION = ["mostly visible", "partly hidden", "largely hidden", "not known"];
const LEVELS: Record<string, readonly string[]> = { occluded: OCCLUSION, occluded_px: OCCLUSION };

export function heading(column: string): string {
  return HEADINGS[column] ?? column.replaceAll("_", " ");
}

export function unitOf(unit: string): string {
  return UNITS.has(unit) ? unit : "";
}

export function allowedValues(unit: string): string {
  return unit && unit !== "-" && !UNITS.has(unit) ? unit : "";
}

const DIGITS: Record<string, number> = { m: 1, px: 0, deg: 1, "km/h": 1, s: 2, "m/s": 2 };

/** A cell in words; `full` is what stands there when one points at it. */
export function cellText(column: string, unit: string, value: unknown): { text: string; full?: string } {
  if (value === null || value === undefined) return { text: "–" };
  if (typeof value === "number") {
    if (column === "track_id" || column === "parent_track_id") return { text: trackText(value), full: `track ${value}` };
    const level = LEVELS[column]?.[value];
    if (level) return { text: `${value} ${level}` };
    if (Number.isInteger(value)) return { text: String(value) };
    return { text: value.toFixed(DIGITS[unit] ?? 3), full: String(value) };
  }
  if (typeof value === "boolean") return { text: value ? "yes" : "no" };
  if (Array.isArray(value)) return { text: value.map((one) => cellText("", unit, one).text).join(", "), full: JSON.stringify(value) };
  const text = typeof value === "object" ? JSON.stringify(value) : String(value);
  return text.length > 60 ? { text: `${text.slice(0, 57)}…`, full: text } : { text };
}
