/** What a sensor measures, and so which colour it has everywhere. */
export type Modality = "camera" | "truth" | "lidar" | "radar" | "inertial";

export interface KindInfo {
  label: string;
  short: string;
  modality: Modality;
  /** Whether it looks somewhere: has a field of view. */
  looks: boolean;
}

export const KINDS: Record<string, KindInfo> = {
  rgb: { label: "Camera (RGB)", short: "CAM", modality: "camera", looks: true },
  depth: { label: "Depth camera", short: "DEPTH", modality: "truth", looks: true },
  semantic: { label: "Semantic camera", short: "SEMANTIC", modality: "truth", looks: true },
  instance: { label: "Instance camera", short: "INSTANCE", modality: "truth", looks: true },
  flow: { label: "Optical flow", short: "FLOW", modality: "truth", looks: true },
  normals: { label: "Surface normals", short: "NORMALS", modality: "truth", looks: true },
  lidar: { label: "LiDAR", short: "LIDAR", modality: "lidar", looks: true },
  semantic_lidar: { label: "Semantic LiDAR", short: "SEMLIDAR", modality: "lidar", looks: true },
  radar: { label: "Radar", short: "RADAR", modality: "radar", looks: true },
  imu: { label: "IMU", short: "IMU", modality: "inertial", looks: false },
  gnss: { label: "GNSS", short: "GNSS", modality: "inertial", looks: false },
};

export const MODALITIES: Record<Modality, string> = {
  camera: "Cameras",
  truth: "Ground-truth cameras",
  lidar: "LiDAR",
  radar: "Radar",
  inertial: "IMU and GNSS",
};

const OTHER: KindInfo = { label: "Sensor", short: "SENSOR", modality: "inertial", looks: false };

export function kindInfo(kind: string): KindInfo {
  return KINDS[kind] ?? OTHER;
}

export function isCamera(kind: string): boolean {
  const { modality } = kindInfo(kind);
  return modality === "camera" || modality === "truth";
}

/** The colour of a modality as a CSS variable. */
export function colourOf(kind: string): string {
  return `var(--${kindInfo(kind).modality})`;
}
