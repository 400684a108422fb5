"""Poses and their matrices, for the tests of the TypeScript that draws them.

``python tests/carstage/web/browser/golden_poses.py`` writes them into ``ui/tests``.
"""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

from carstage.geometry.coordinates import pose_matrix

GOLDEN = Path(__file__).parents[2] / "ui" / "tests" / "golden" / "poses.json"
_RANDOM_POSES = 40


def poses() -> list[dict[str, Any]]:
    """Axis-aligned and random poses, each with its 4x4 matrix."""
    angles = [(0, 0, 0), (0, 0, 90), (0, 0, -90), (0, 0, 180), (0, 30, 0), (20, 0, 0)]
    draw = random.Random(7)
    for _ in range(_RANDOM_POSES):
        angles.append((draw.randint(-180, 180), draw.randint(-89, 89), draw.randint(-180, 180)))
    made = []
    for roll, pitch, yaw in angles:
        location = [round(draw.uniform(-5, 5), 3) for _ in range(3)]
        matrix = pose_matrix(location, [pitch, yaw, roll])
        pose = dict(zip("xyz", location, strict=True))
        pose |= {"roll_deg": roll, "pitch_deg": pitch, "yaw_deg": yaw}
        made.append({"pose": pose, "vehicle_from_sensor": matrix.round(15).tolist()})
    return made


def text() -> str:
    """The file's content."""
    return "[\n" + ",\n".join(json.dumps(pose) for pose in poses()) + "\n]\n"


if __name__ == "__main__":
    GOLDEN.parent.mkdir(parents=True, exist_ok=True)
    GOLDEN.write_text(text())
