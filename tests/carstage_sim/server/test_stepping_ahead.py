"""The world steps while the pictures of the last frame are drawn, and nobody is told before."""

from __future__ import annotations

import pickle
import threading
from contextlib import ExitStack
from typing import Any

import pytest

from carstage_sim.simulation import Simulation
from carstage_sim.world.controls import VehicleControl
from carstage_sim.world.pose import Pose
from carstage_sim.world.state import Weather
from held_drawing import SIZE, SYNCHRONOUS, Gate, Rig, frames_of
from raw_client import read_message
from waiting import await_that, holds_for

pytestmark = pytest.mark.xdist_group("kernels")

_KINDS: list[tuple[str, dict[str, str]]] = [
    ("sensor.camera.rgb", SIZE),
    ("sensor.camera.rgb", {**SIZE, "sensor_tick": "0.1"}),
    ("sensor.camera.depth", SIZE),
    ("sensor.camera.optical_flow", SIZE),
    ("sensor.camera.dvs", SIZE),
    ("sensor.lidar.ray_cast", {"points_per_second": "9000", "sensor_tick": "0.1"}),
    ("sensor.lidar.ray_cast", {"points_per_second": "9000"}),
    ("sensor.other.radar", {}),
]


def _never(_: Any) -> None:
    """No picture is late."""


def _data(frame: Any) -> bytes:
    """All that a sensor sends, as bytes."""
    return pickle.dumps([getattr(frame, name) for name in frame.__slots__])


def test_the_world_steps_while_a_picture_is_drawn_and_nobody_knows_before(
    rig: Rig, gate: Gate, simulation: Simulation
) -> None:
    stream = rig.subscribed(rig.camera)
    gate.open.clear()
    first = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    second = rig.asking("tick_cue")
    await_that(lambda: simulation.world.frame == first + 1)
    assert holds_for(0.2, lambda: second() is None and simulation.world.frame == first + 1)
    gate.open.set()
    await_that(lambda: second() == first + 1)
    assert frames_of(stream, 2) == [first, first + 1]


def test_what_a_call_changes_after_a_step_made_ahead_is_in_the_frame_of_that_step(
    rig: Rig, gate: Gate, simulation: Simulation
) -> None:
    stream = rig.subscribed(rig.camera)
    rig.client.value("tick_cue")
    still = read_message(stream)[48:]
    gate.open.clear()
    frame = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 2)
    ahead = rig.asking("tick_cue")
    await_that(lambda: simulation.world.frame == frame + 1)
    rig.client.value("set_actor_transform", rig.camera.actor_id, [[60.0, 40.0, 9.0], [0, 70, 0]])
    gate.open.set()
    await_that(lambda: ahead() == frame + 1)
    assert read_message(stream)[48:] == still
    assert read_message(stream)[48:] != still


def test_who_comes_after_a_step_made_ahead_is_in_its_frame(simulation: Simulation) -> None:
    simulation.apply_settings(SYNCHRONOUS)
    frame = simulation.tick().state.frame
    simulation.step_ahead()
    simulation.step_ahead()  # it is made once
    actor = simulation.world.spawn("sensor.camera.depth", SIZE, Pose((0.0, 0.0, 3.0)))
    simulation.may_have_changed()
    state = simulation.tick().state
    assert (state.frame, state.delta_s) == (frame + 1, 0.05)
    assert actor.actor_id in state.actor_id
    assert simulation.tick().state.frame == frame + 2


def test_a_step_made_ahead_gives_the_same_frames_as_one_made_in_time() -> None:
    def frames(*, ahead: bool) -> list[tuple[Any, bytes]]:
        with Simulation("Stage01", threads=1) as simulation:
            simulation.apply_settings(SYNCHRONOUS)
            world = simulation.world
            x, y, z, *turned = world.town.spawn_points[0].tolist()
            car = world.spawn("vehicle.tesla.model3", {}, Pose((x, y, z), (0.0, turned[1], 0.0)))
            world.control_vehicle(car.actor_id, VehicleControl(throttle=0.8, steer=0.1))
            camera = world.spawn("sensor.camera.depth", SIZE, Pose((x - 8.0, y, 2.0)))
            told = []
            for _ in range(4):
                if ahead:
                    simulation.step_ahead()
                snapshot = simulation.tick()
                scene = simulation.scene(snapshot, lambda _: True)
                assert scene is not None
                pictures: list[Any] = []
                drawn = simulation.capture(scene, pictures.append, lambda _: None)
                assert drawn is not None
                drawn.done.result()
                (picture,) = [one.frame for one in pictures if one.sensor is camera]
                told.append((snapshot.state.location.tolist(), picture.pixels.tobytes()))
            return told

    assert frames(ahead=True) == frames(ahead=False)


def test_a_tick_that_waits_while_a_map_is_loaded_is_one_of_the_new_episode(
    rig: Rig, gate: Gate, simulation: Simulation
) -> None:
    rig.subscribed(rig.camera)
    gate.open.clear()
    first = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    second = rig.asking("tick_cue")
    await_that(lambda: simulation.world.frame == first + 1)
    threading.Timer(0.2, gate.open.set).start()  # which the load waits for
    rig.client.value("load_new_episode", "Stage01", False, 0x3F)
    await_that(lambda: second() is not None)
    assert second() <= 2


def test_with_a_card_a_frame_is_begun_while_the_last_one_ends(gate: Gate) -> None:
    with Simulation("Stage01", threads=2) as simulation, ExitStack() as resources:
        simulation._begins_early = True
        simulation.warm_up()
        simulation.apply_settings(SYNCHRONOUS)
        resources.callback(gate.open.set)
        rig = Rig(simulation, resources)
        stream, measured = rig.subscribed(rig.camera), rig.subscribed(rig.imu)
        gate.open.clear()
        first = rig.client.value("tick_cue")
        await_that(lambda: gate.came == 1)
        assert rig.client.value("tick_cue") == first + 1
        third = rig.asking("tick_cue")
        assert holds_for(0.2, lambda: third() is None and gate.came == 1)  # one after the other
        assert frames_of(measured, 2) == [first, first + 1]
        gate.let_one_through()
        await_that(lambda: third() == first + 2)
        gate.open.set()
        assert frames_of(stream, 3) == [first, first + 1, first + 2]


def test_frames_that_are_made_side_by_side_are_those_made_one_after_the_other() -> None:
    def pictures(*, at_once: bool) -> list[tuple[int, int, bytes]]:
        with Simulation("Stage01", threads=3) as simulation:
            simulation._begins_early = at_once
            simulation.apply_settings(SYNCHRONOUS)
            world = simulation.world
            x, y, z, *turned = world.town.spawn_points[0].tolist()
            car = world.spawn("vehicle.tesla.model3", {}, Pose((x, y, z), (0.0, turned[1], 0.0)))
            world.control_vehicle(car.actor_id, VehicleControl(throttle=0.8, steer=0.1))
            for kind, attributes in _KINDS:
                world.spawn(kind, attributes, Pose((x - 8.0, y, 2.0)))
            made: list[Any] = []
            drawn = []
            for tick in range(6):
                world.set_weather(Weather(sun_altitude_angle=-60.0 + 20.0 * tick))
                scene = simulation.scene(simulation.tick(), lambda _: True)
                assert scene is not None
                frame = scene.state.frame
                drawn.append(
                    simulation.capture(scene, lambda one, at=frame: made.append((at, one)), _never)
                )
                if not at_once:
                    simulation.finish_drawing()
            simulation.finish_drawing()
            assert all(one is not None and one.done.done() for one in drawn)
            return sorted((one.sensor.actor_id, at, _data(one.frame)) for at, one in made)

    made = pictures(at_once=True)
    assert made == pictures(at_once=False)
    assert len({(sensor, frame) for sensor, frame, _ in made}) == len(made) > 6 * (len(_KINDS) - 2)
