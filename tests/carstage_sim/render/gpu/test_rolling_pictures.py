"""Beside a card, pictures of a rolling shutter are made by the CPU."""

from __future__ import annotations

import logging

import pytest

from carstage_sim.sensors import WorldSensors
from sensor_worlds import GROUND, WALL, request, state, town

pytestmark = pytest.mark.xdist_group("gpu")


def test_pictures_by_rows_are_the_cpus_and_the_log_says_so_once(software_gpu, caplog):
    cars, place = [(40, (9.0, 0.0, 0.0), 90.0)], town(GROUND, WALL)
    kinds = ("rgb", "depth", "instance_segmentation", "normals")
    cameras = [
        request(f"camera.{kind}", 100 + n, rolling_shutter_s=0.05) for n, kind in enumerate(kinds)
    ]
    ticks = [state(tick, vehicles=cars, velocity=(0.0, 15.0, 0.0)) for tick in (1, 2)]
    seen = []
    for gpu in (None, software_gpu):
        with WorldSensors(place, threads=2, gpu=gpu) as sensors, caplog.at_level(logging.INFO):
            frames = [sensors.capture(tick, cameras) for tick in ticks]
        seen.append([frame.pixels.tobytes() for tick in frames for _, frame in tick])
    assert seen[0] == seen[1]
    said = [record.getMessage() for record in caplog.records if "rolling" in record.getMessage()]
    assert sorted(said) == [
        f"sensor {100 + n} has a rolling shutter: the CPU draws it" for n in range(4)
    ]
