"""Lanes of a map as JSON."""

import json
import math
from itertools import pairwise

import numpy as np

from carstage_sim.describe.map_lanes import map_lanes
from carstage_sim.maps import Town


def test_lanes_are_lines_along_the_samples_with_a_width_each(stage01: Town) -> None:
    document = json.loads(json.dumps(map_lanes(stage01)))
    assert len(document["lanes"]) == len(document["widths_m"]) == len(document["in_junction"])
    length_m = sum(math.dist(a, b) for line in document["lanes"] for a, b in pairwise(line))
    assert 0.8 < length_m / len(stage01.lanes.location) < 1.2  # samples are a metre apart
    assert all(2.0 < width_m < 6.0 for width_m in document["widths_m"])
    assert any(document["in_junction"])
    assert not all(document["in_junction"])


def test_heights_and_spawn_points_are_those_of_the_town(stage01: Town) -> None:
    document = json.loads(json.dumps(map_lanes(stage01)))
    points = np.array([point for lane in document["lanes"] for point in lane])
    heights_m = np.concatenate([np.array(heights) for heights in document["heights_m"]])
    assert len(points) == len(heights_m)
    away_m = np.linalg.norm(stage01.lanes.location[None, :, :2] - points[::40, None], axis=2)
    nearest = stage01.lanes.location[away_m.argmin(axis=1), 2]
    np.testing.assert_allclose(heights_m[::40], nearest, atol=0.3)
    np.testing.assert_allclose(
        document["spawn_points"], stage01.spawn_points[:, [0, 1, 2, 4]], atol=0.006
    )
