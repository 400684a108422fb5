"""A small dataset of one drive with and without patches: one of each kind, near enough to see."""

from __future__ import annotations

FRAMES = 4
CONFIG = f"""
name: patches
seed: 11
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
weather: {{choice: ClearNoon}}
vehicles:
  count: 4
  groups: [{{filter: "vehicle.carlamotors.*", count: 3}}]
pedestrians: {{count: 6}}
image_size: [640, 360]
timing: {{warmup_ticks: 3}}
conversion: {{workers: 1}}
supervision: {{hang_s: 240}}
patches:
  - {{target: billboard, pattern: blobs, distance_m: [16, 20], size: [0.7, 0.9]}}
  - {{target: shop_front, pattern: checker, distance_m: [8, 16], size: [0.8, 0.9]}}
  - {{target: vehicle_rear, pattern: noise, distance_m: [9, 12], size: [0.7, 0.9]}}
  - {{target: person, pattern: checker, distance_m: [9, 12], size: 0.9}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}, attributes: {{fov_deg: 60}}}}
    - id: CAM_RIGHT
      kind: rgb
      pose: {{x: 1.5, z: 1.6, yaw_deg: 34}}
      attributes: {{fov_deg: 32}}
    - {{id: DEPTH_FRONT, kind: depth, pose: {{x: 1.5, z: 1.6}}, attributes: {{fov_deg: 60}}}}
    - {{id: LIDAR, kind: lidar, pose: {{z: 2.0}}, attributes: {{channels: 16}}}}
"""
