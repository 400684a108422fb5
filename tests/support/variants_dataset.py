"""A small dataset of one drive in four variants: dry, under water, by night, by another rig."""

from __future__ import annotations

FRAMES = 10
NAMES = ("as_configured", "night", "rain", "wide")
CONFIG = f"""
name: one drive in variants
seed: 5
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
weather: {{choice: ClearNoon}}
vehicles: {{count: 12}}
pedestrians: {{count: 8}}
scenario:
  events: [{{kind: cut_in, at_s: 0.2}}]
image_size: [160, 96]
timing: {{warmup_ticks: 40}}
conversion: {{workers: 1}}
supervision: {{hang_s: 120}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
variants:
  as_configured: {{}}
  rain: {{weather: {{choice: HardRainNoon, parameters: {{precipitation_deposits: 100}}}}}}
  night: {{weather: {{choice: ClearNight}}}}
  wide:
    rig:
      sensors:
        - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}, attributes: {{fov_deg: 120}}}}
        - {{id: LIDAR, kind: lidar, pose: {{z: 2.0}}, attributes: {{channels: 16}}}}
"""
