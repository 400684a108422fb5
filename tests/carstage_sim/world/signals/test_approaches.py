"""Detectors of signals: vehicles that come to a light are noticed, those that leave are not."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.world.lane_index import LaneIndex
from carstage_sim.world.signals.approaches import Approaches


@pytest.fixture(scope="module")
def approaches(stage01: Town) -> Approaches:
    return Approaches(stage01.traffic_lights, stage01.lanes)


def noticed(town: Town, approaches: Approaches, place: np.ndarray) -> dict[int, bool]:
    samples = LaneIndex(town.lanes).nearest(place[None])
    queues = approaches.queues(samples)
    assert queues.count.sum() in (0, 1)
    return {int(light): bool(queues.near[light]) for light in np.flatnonzero(queues.count)}


@pytest.mark.parametrize(
    ("metres", "is_near"), [(-2.0, True), (15.0, True), (35.0, False), (90.0, None)]
)
def test_every_light_counts_who_comes_to_it(
    stage01: Town, approaches: Approaches, metres: float, is_near: bool | None
) -> None:
    lanes = LaneIndex(stage01.lanes)
    for light, site in enumerate(stage01.traffic_lights):
        for box in site.trigger:
            here = lanes.nearest(np.array([box.center]))[0]
            yaw = np.radians(stage01.lanes.rotation_deg[here, 1])
            place = np.array(box.center) - metres * np.array([np.cos(yaw), np.sin(yaw), 0.0])
            assert noticed(stage01, approaches, place).get(light) == is_near


def test_every_light_sees_who_is_on_its_junction(stage01: Town, approaches: Approaches) -> None:
    lanes, sites = stage01.lanes, stage01.traffic_lights
    for junction_id in {site.junction_id for site in sites}:
        on_it = np.flatnonzero(lanes.junction_id == junction_id).astype(np.int32)
        for sample in (on_it[0], on_it[len(on_it) // 2]):
            beyond = approaches.queues(np.array([sample])).beyond
            assert beyond.tolist() == [site.junction_id == junction_id for site in sites]


def test_nobody_on_the_road_is_noticed_by_nobody(stage01: Town, approaches: Approaches) -> None:
    queues = approaches.queues(np.zeros(0, np.int32))
    assert not queues.count.any()
    assert not queues.near.any()
    assert not queues.beyond.any()
