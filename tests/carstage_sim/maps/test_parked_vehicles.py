"""Parked vehicles of a town with parking bays."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.maps.loading import load_town
from carstage_sim.maps.town import MapLayer


@pytest.fixture(scope="module")
def stage02() -> Town:
    return load_town("Stage02")


def test_bays_of_the_built_in_town_are_parked_in(stage02):
    parked = [e for e in stage02.level_objects if e.layer == MapLayer.PARKED_VEHICLES]
    assert len(parked) >= 50
    assert len({entry.name.rsplit("_", 1)[0] for entry in parked}) == 6
    lanes = stage02.lanes
    yaw = np.radians(lanes.rotation_deg[:, 1])
    for entry in parked:
        box = entry.box
        turn = np.radians(box.rotation_deg[1])
        ahead, aside = (
            np.array([np.cos(turn), np.sin(turn)]),
            np.array([-np.sin(turn), np.cos(turn)]),
        )
        corners = np.array(box.center[:2]) + [
            along * box.extent[0] * ahead + across * box.extent[1] * aside
            for along in (-1.0, 1.0)
            for across in (-1.0, 1.0)
        ]
        for corner in corners:
            away = lanes.location[:, :2] - corner
            nearest = int(np.argmin(np.hypot(*away.T)))
            across = away[nearest] @ (-np.sin(yaw[nearest]), np.cos(yaw[nearest]))
            # Mirrors end at the line; samples of a bent lane are a metre apart.
            assert abs(across) > lanes.width_m[nearest] / 2 - 0.03, entry.name
