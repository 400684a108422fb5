/**
 * CARLA's frames: left-handed, x forward, y right, z up; yaw turns right, pitch up, roll to the
 * right side down, applied roll first. three.js is right-handed: y changes its sign.
 */
export interface Pose {
  x: number;
  y: number;
  z: number;
  roll_deg: number;
  pitch_deg: number;
  yaw_deg: number;
}

export type Vector = readonly [number, number, number];
export type Matrix = readonly [Vector, Vector, Vector];

const RAD = Math.PI / 180;

/** Rotation from the sensor's to the vehicle's axes, rows; the upper left of `carla.Transform.get_matrix()`. */
export function rotation(pose: Pose): Matrix {
  const [cy, sy] = [Math.cos(pose.yaw_deg * RAD), Math.sin(pose.yaw_deg * RAD)];
  const [cr, sr] = [Math.cos(pose.roll_deg * RAD), Math.sin(pose.roll_deg * RAD)];
  const [cp, sp] = [Math.cos(pose.pitch_deg * RAD), Math.sin(pose.pitch_deg * RAD)];
  return [
    [cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr],
    [cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr],
    [sp, -cp * sr, cp * cr],
  ];
}

export function rotate(matrix: Matrix, v: Vector): Vector {
  const row = (r: Vector) => r[0] * v[0] + r[1] * v[1] + r[2] * v[2];
  return [row(matrix[0]), row(matrix[1]), row(matrix[2])];
}

/** From the vehicle's axes to the sensor's: the transposed rotation. */
export function rotateBack(m: Matrix, v: Vector): Vector {
  return [
    m[0][0] * v[0] + m[1][0] * v[1] + m[2][0] * v[2],
    m[0][1] * v[0] + m[1][1] * v[1] + m[2][1] * v[2],
    m[0][2] * v[0] + m[1][2] * v[1] + m[2][2] * v[2],
  ];
}

export function add(a: Vector, b: Vector): Vector {
  return [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
}

export function scale(a: Vector, s: number): Vector {
  return [a[0] * s, a[1] * s, a[2] * s];
}

/** CARLA's position in three.js. */
export function toThree(v: Vector): [number, number, number] {
  return [v[0], -v[1], v[2]];
}

/** Angles of `new THREE.Euler(x, y, z, "ZYX")`, radians. */
export function eulerZYX(pose: Pose): [number, number, number] {
  return [pose.roll_deg * RAD, -pose.pitch_deg * RAD, -pose.yaw_deg * RAD];
}

/** A pose back from three.js: position and the angles of an Euler of order ZYX, radians. */
export function fromThree(position: Vector, euler: Vector): Pose {
  return {
    x: position[0],
    y: -position[1],
    z: position[2],
    roll_deg: euler[0] / RAD,
    pitch_deg: -euler[1] / RAD,
    yaw_deg: -euler[2] / RAD,
  };
}

/** An angle in (-180, 180]. */
export function wrapDegrees(angle: number): number {
  const turned = ((angle % 360) + 360) % 360;
  return turned > 180 ? turned - 360 : turned;
}

/** The nearest multiple of a step, without the noise of floating point. */
export function snap(value: number, step: number): number {
  return Math.round(Math.round(value / step) * step * 1e6) / 1e6;
}
