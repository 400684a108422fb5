"""Where the self-test's rig and what it looks at are put."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.errors import ServerError
from carstage.selftest.scene_setup import WALKER, choose_places, plan_self_test

BLUEPRINTS = {
    "vehicle.tesla.model3",
    "sensor.camera.rgb",
    "sensor.camera.depth",
    "sensor.camera.semantic_segmentation",
    "sensor.camera.instance_segmentation",
    "sensor.camera.optical_flow",
    "sensor.lidar.ray_cast",
    WALKER,
}
HERE = [10.0, 20.0, 0.5, 0.0, 90.0, 0.0]  # heading along +y


def test_vehicle_stands_on_a_spawn_point_ahead_of_the_ego() -> None:
    points = np.array([HERE, [10.5, 34.0, 0.5, 0.0, 90.0, 0.0], [10.0, 26.0, 0.5, 0.0, 90.0, 0.0]])
    ego, ahead = choose_places(points)
    assert ego.tolist() == HERE
    assert ahead.tolist() == points[1].tolist()


def test_vehicle_stands_ahead_where_no_spawn_point_does() -> None:
    ego, ahead = choose_places(np.array([HERE]))
    assert ego.tolist() == HERE
    assert ahead[:3] == pytest.approx([10.0, 34.0, 0.5])


def test_no_two_steps_of_the_rig_are_alike() -> None:
    spec = plan_self_test("0.9.16", "Town", np.array([HERE]), BLUEPRINTS)
    poses = np.array(spec.scenario.actors[0].poses)
    steps = np.diff(poses, axis=0)
    assert len(poses) == spec.steps
    assert len({tuple(step) for step in steps.round(3).tolist()}) == len(steps)


def test_sensors_and_walkers_that_the_server_lacks_are_left_out() -> None:
    lacking = BLUEPRINTS - {"sensor.camera.optical_flow", WALKER}
    spec = plan_self_test("0.9.13", "Town", np.array([HERE]), lacking)
    assert [sensor.id for sensor in spec.sensors] == [
        "rgb",
        "depth",
        "semantic",
        "instance",
        "lidar",
    ]
    assert len(spec.scenario.actors) == 2


def test_map_without_spawn_points_is_refused() -> None:
    with pytest.raises(ServerError, match="no spawn points"):
        plan_self_test("0.9.16", "Town", np.zeros((0, 6)), BLUEPRINTS)


def test_server_without_vehicles_is_refused() -> None:
    with pytest.raises(ServerError, match="no vehicle"):
        plan_self_test("0.9.16", "Town", np.array([HERE]), {"sensor.camera.depth"})
