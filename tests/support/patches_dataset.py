"""A small dataset of one drive with and without patches on boards, a lorry and a person."""

from __future__ import annotations

FRAMES = 5
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
image_size: [320, 180]
timing: {{warmup_ticks: 5}}
conversion: {{workers: 1}}
supervision: {{hang_s: 240}}
patches:
  - {{target: billboard, pattern: noise, size: 0.9, distance_m: 14}}
  - {{target: billboard, pattern: blobs, side: left, distance_m: [16, 30]}}
  - {{target: shop_front, pattern: checker, distance_m: [10, 30]}}
  - {{target: vehicle_rear, pattern: noise, size: 0.8}}
  - {{target: person, pattern: checker}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: CAM_BACK, kind: rgb, pose: {{x: -1.5, z: 1.6, yaw_deg: 180}}}}
    - {{id: DEPTH_FRONT, kind: depth, pose: {{x: 1.5, z: 1.6}}}}
    - {{id: LIDAR, kind: lidar, pose: {{z: 2.0}}, attributes: {{channels: 16}}}}
"""
