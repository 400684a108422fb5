"""Do frame numbers, times and poses of sensors and snapshots belong together?"""

from __future__ import annotations

import numpy as np

from carstage.geometry import FloatArray
from carstage.selftest.evidence import Evidence
from carstage.selftest.scene_setup import FPS, camera_in_ego, lidar_in_ego
from carstage.selftest.verdict import Check

_CLOCK_S = 1e-4
_POSE_M = 0.02
_TURN = 0.002


def check_frames(evidence: Evidence) -> Check:
    """Every sensor delivered each tick's frame, with its number and its time."""
    expected = "every sensor delivers each frame with its number and time"
    for row in evidence.ledger:
        for name, outcome in row["sensors"].items():
            if outcome["state"] != "ok":
                found = f"{name} was {outcome['state']} in frame {row['frame']}"
                return Check("frames", False, found, expected)
    for name, records in evidence.records.items():
        for record, world in zip(records, evidence.worlds, strict=True):
            if record.frame != world.frame:
                found = f"{name} called frame {world.frame} number {record.frame}"
                return Check("frames", False, found, expected)
            sensor_s = float(record.meta["sensor_timestamp_s"])
            if abs(sensor_s - world.timestamp_s) > _CLOCK_S:
                found = (
                    f"{name} dated frame {world.frame} {sensor_s:.4f} s, its snapshot "
                    f"{world.timestamp_s:.4f} s"
                )
                return Check("frames", False, found, expected)
    for before, after in zip(evidence.worlds, evidence.worlds[1:], strict=False):
        step_s = after.timestamp_s - before.timestamp_s
        if after.frame != before.frame + 1 or abs(step_s - 1.0 / FPS) > _CLOCK_S:
            found = f"frame {after.frame} follows {before.frame} after {step_s:.4f} s"
            return Check("frames", False, found, expected)
    return Check("frames", True, expected, expected)


def check_mounts(evidence: Evidence) -> Check:
    """Sensors stand where they were attached, in every snapshot."""
    expected = "sensors stand where they were attached, at every tick"
    planned = {"depth": (evidence.world_from_camera, camera_in_ego())}
    if evidence.world_from_lidar is not None:
        planned["lidar"] = (evidence.world_from_lidar, lidar_in_ego())
    for name, (seen, ego_from_sensor) in planned.items():
        off_m, turned = _difference(seen, evidence.world_from_ego @ ego_from_sensor)
        if off_m > _POSE_M or turned > _TURN:
            found = f"{name} stands {off_m:.3f} m and {np.degrees(turned):.2f} deg elsewhere"
            return Check("mounts", False, found, expected)
    return Check("mounts", True, expected, expected)


def _difference(first: FloatArray, second: FloatArray) -> tuple[float, float]:
    """The largest distance (m) and angle (rad) between poses ``(T, 4, 4)``."""
    off_m = np.linalg.norm(first[:, :3, 3] - second[:, :3, 3], axis=-1).max()
    turn = first[:, :3, :3] @ np.swapaxes(second[:, :3, :3], -1, -2)
    # Of a small turn, the antisymmetric part holds the sine of its angle.
    sines = np.stack(
        [
            turn[:, 2, 1] - turn[:, 1, 2],
            turn[:, 0, 2] - turn[:, 2, 0],
            turn[:, 1, 0] - turn[:, 0, 1],
        ]
    )
    return float(off_m), float(np.linalg.norm(sines / 2.0, axis=0).max())
