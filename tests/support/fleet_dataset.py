"""A small dataset of a fleet: the ego, a second car that a driver drives, a roadside unit."""

from __future__ import annotations

FRAMES = 5
NOISE_M = 0.02
_LIDAR = (
    "{id: LIDAR, kind: lidar, pose: {z: 2.0}, "
    f"attributes: {{channels: 32, points_per_second: 200000, noise_stddev_m: {NOISE_M}}}}}"
)
CONFIG = f"""
name: a fleet
seed: 5
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
vehicles: {{count: 6}}
pedestrians: {{count: 4}}
image_size: [160, 96]
labels: {{lidars: all}}
timing: {{warmup_ticks: 10}}
conversion: {{workers: 1}}
supervision: {{hang_s: 120}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {_LIDAR}
agents:
  - name: car2
    color: [200, 20, 20]
    driver: route
    rig:
      sensors:
        - {{id: CAM_BACK, kind: rgb, pose: {{x: -2.0, z: 1.6, yaw_deg: 180}}}}
        - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
        - {_LIDAR}
        - {{id: IMU, kind: imu}}
  - name: mast
    kind: roadside
    pose: {{x: -112, y: -111, z: 6, yaw_deg: -150, pitch_deg: -15}}
    rig:
      sensors:
        - {{id: CAM, kind: rgb}}
        - {_LIDAR.replace("pose: {z: 2.0}, ", "")}
"""
