"""A small dataset that drones and a camera at a junction recorded beside the ego."""

from __future__ import annotations

FRAMES = 6
CONFIG = f"""
name: from above
seed: 5
duration_s: {FRAMES / 10}
fps: 10
map: {{choice: Stage01}}
vehicles: {{count: 12}}
pedestrians: {{count: 12}}
image_size: [320, 240]
max_distance_m: 120
labels: {{lane_lines: true}}
timing: {{warmup_ticks: 10}}
conversion: {{workers: 1}}
supervision: {{hang_s: 120}}
rig:
  sensors:
    - {{id: CAM_FRONT, kind: rgb, pose: {{x: 1.5, z: 1.6}}}}
agents:
  - name: legs
    kind: drone
    path:
      kind: waypoints
      points: [[-120, -120, 40], [-116, -120, 40], [-116, -110, 44]]
      speed_m_s: 20
    gimbal: {{pitch_deg: -90}}
    rig:
      sensors:
        - {{id: CAM, kind: rgb}}
        - {{id: GNSS, kind: gnss}}
  - name: circle
    kind: drone
    path: {{kind: orbit, radius_m: 12, height_m: 50, speed_m_s: 8, start_deg: 45}}
    gimbal: {{look_at: ego}}
    rig:
      sensors:
        - {{id: CAM, kind: rgb}}
        - {{id: IMU, kind: imu}}
  - name: mast
    kind: junction
    rig:
      sensors:
        - {{id: CAM, kind: rgb}}
"""
