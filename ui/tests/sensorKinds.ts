import type { SensorKind, SensorKinds } from "../src/api/types";
import type { Defaults } from "../src/rig/sensors";

function kind(name: string, title: string, rest: Partial<SensorKind>): SensorKind {
  return {
    name,
    title,
    blueprint: `sensor.${name}`,
    short: name.toUpperCase(),
    modality: "camera",
    content: "colour",
    icon: "camera",
    viewer: "image",
    field_of_view: "pyramid",
    is_camera: rest.viewer === undefined,
    codecs: [],
    since: "0.9.13",
    ...rest,
  };
}

/** Some of the server's kinds, and one of a plug-in: a sonar. */
export const KINDS: SensorKinds = {
  kinds: [
    kind("rgb", "Camera (RGB)", { short: "CAM" }),
    kind("depth", "Depth camera", { modality: "truth" }),
    kind("lidar", "LiDAR", { modality: "lidar", icon: "lidar", viewer: "points", field_of_view: "sweep" }),
    kind("sonar", "Sonar", { modality: "radar", icon: "radar", viewer: "radar", field_of_view: "cone" }),
    kind("imu", "IMU", { modality: "inertial", icon: "box", viewer: "none", field_of_view: "none" }),
  ],
  modalities: [
    { name: "camera", title: "Cameras", colour: "camera" },
    { name: "truth", title: "Ground-truth cameras", colour: "truth" },
    { name: "lidar", title: "LiDAR", colour: "lidar" },
    { name: "radar", title: "Radar", colour: "radar" },
    { name: "inertial", title: "IMU and GNSS", colour: "inertial" },
  ],
};

export const DEFAULTS: Defaults = {
  defaults: { image_size: [640, 360], max_distance_m: 80 },
  sensor_defaults: {
    rgb: { attributes: { fov_deg: 90 } },
    depth: { attributes: { fov_deg: 90 } },
    lidar: { attributes: { channels: 64, range_m: 100, horizontal_fov_deg: 360, upper_fov_deg: 10, lower_fov_deg: -30 } },
    sonar: { attributes: { horizontal_fov_deg: 50, vertical_fov_deg: 20, range_m: 5 } },
    imu: { attributes: {} },
  },
};
