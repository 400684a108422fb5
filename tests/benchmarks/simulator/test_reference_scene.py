"""The reference scene of the renderer's figures and of the gallery."""

from __future__ import annotations

import pytest

from benchmarks.simulator.render.scene import populate, town_of
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.state import ActorKind

pytestmark = pytest.mark.xdist_group("kernels")


def test_vehicles_stand_on_the_road_in_the_first_picture():
    town = town_of("Stage01")
    with WorldSensors(town) as sensors:
        state = populate(town, sensors, vehicles=4, walkers=1, seed=3).state()
    heights = state.location[state.kind == ActorKind.VEHICLE, 2]
    assert len(heights) == 4
    assert heights.max() < 0.03
