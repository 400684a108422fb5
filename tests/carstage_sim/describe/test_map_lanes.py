"""Lanes of a map as JSON."""

import json
import math
from itertools import pairwise

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
