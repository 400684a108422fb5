"""One episode after another: what is refused changes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.maps.loading import TownSource
from carstage_sim.simulation import Simulation
from carstage_sim.world.actors import ActorTable
from carstage_sim.world.world import World

pytestmark = pytest.mark.xdist_group("kernels")


class TwoTowns:
    """A catalogue of a town and the same without spawn points."""

    cache_folder = None
    bake_limits = None

    def __init__(self, town: Town) -> None:
        short = replace(town, name="Short", spawn_points=np.zeros((0, 6)))
        self._towns = {town.name: town, "Short": short}

    def source(self, name: str) -> TownSource:
        return TownSource(name, name)

    def load(self, name: str) -> Town:
        return self._towns[name]


@pytest.fixture
def simulation(stage01: Town) -> Iterator[Simulation]:
    with Simulation("Stage01", maps=cast(Any, TwoTowns(stage01)), threads=1) as running:
        yield running


def test_a_map_without_spawn_points_is_warmed_up_and_loaded(simulation: Simulation) -> None:
    simulation.load("Short", reset_settings=False)
    simulation.warm_up()
    world = simulation.world
    assert world.actors.pose(world.spectator.actor_id).location[:2] == pytest.approx(
        world.town.lanes.location[0, :2].tolist()
    )


def test_a_map_whose_world_cannot_be_made_leaves_the_episode_as_it_was(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, tmp_path: Any
) -> None:
    before, log = simulation.world, str(tmp_path / "running.log")
    simulation.recordings.start(log, before, additional_data=False)

    def fail(*_arguments: object) -> None:
        raise MemoryError

    monkeypatch.setattr(ActorTable, "add", fail)
    with pytest.raises(MemoryError):
        simulation.load("Short", reset_settings=True)
    monkeypatch.undo()
    assert simulation.world is before
    simulation.tick()
    simulation.recordings.stop()
    assert "Frames: 1" in simulation.recordings.file_info(log, show_all=False)
    simulation.load("Stage01", reset_settings=False)
    assert simulation.world.town is before.town
    assert isinstance(simulation.world, World)


@pytest.mark.parametrize("town", ["Stage01", "Short"])
def test_the_gravity_of_imu_sensors_does_not_outlive_its_episode(
    simulation: Simulation, town: str
) -> None:
    simulation.imu_gravity = 1.62
    simulation.load(town, reset_settings=False)
    assert simulation.imu_gravity == 9.81
