"""While pictures are drawn, the world goes on and calls are answered."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from carstage_sim.sensors.cameras import RgbCamera
from carstage_sim.sensors.dvs import DvsCamera
from carstage_sim.sensors.flow import OpticalFlowCamera
from carstage_sim.sensors.measurements import DVS_EVENT, DvsFrame, FlowFrame
from carstage_sim.simulation import Simulation
from carstage_sim.wire import streaming
from carstage_sim.world.controls import EpisodeSettings
from held_drawing import SIZE, Gate, Rig, frame_of, frames_of, server_of
from raw_client import read_message
from waiting import await_that, holds_for

pytestmark = pytest.mark.xdist_group("kernels")

PORT = 8000
"""Where a Traffic Manager is said to listen; none does."""


@pytest.fixture
def light_gate(monkeypatch: pytest.MonkeyPatch) -> Iterator[Gate]:
    """A gate for cameras that take long: their pictures are black, without motion, of one event."""
    gate = Gate()

    def colours(camera: RgbCamera, *_: Any) -> Any:
        gate.pass_through()
        return camera.image(np.zeros((camera.height, camera.width, 4), np.uint8))

    def events(camera: DvsCamera, *_: Any) -> Any:
        gate.pass_through()
        return DvsFrame(camera.width, camera.height, camera.fov_deg, np.zeros(1, DVS_EVENT))

    def motion(camera: OpticalFlowCamera, *_: Any) -> Any:
        gate.pass_through()
        still = np.zeros((camera.height, camera.width, 2), np.float32)
        return FlowFrame(camera.fov_deg, still)

    monkeypatch.setattr(RgbCamera, "measure", colours)
    monkeypatch.setattr(DvsCamera, "measure", events)
    monkeypatch.setattr(OpticalFlowCamera, "measure", motion)
    yield gate
    gate.open.set()


def test_calls_are_answered_while_a_picture_is_drawn_and_the_next_tick_waits_for_it(
    rig: Rig, gate: Gate
) -> None:
    stream = rig.subscribed(rig.camera)
    gate.open.clear()
    first = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    assert rig.client.value("version") == "0.9.16"
    assert rig.client.value("get_episode_settings")[0] is True

    second = rig.asking("tick_cue")
    assert holds_for(0.3, lambda: second() is None)
    assert rig.client.value("version") == "0.9.16"
    gate.open.set()
    await_that(lambda: second() == first + 1)
    assert [frame_of(read_message(stream)) for _ in range(2)] == [first, first + 1]
    assert {name.partition("_")[0] for name in gate.threads} == {"drawing"}


def test_a_tick_of_a_client_that_is_gone_is_not_made_when_the_picture_is_drawn(
    rig: Rig, gate: Gate
) -> None:
    """The next client may have loaded a map by then, and its episode would begin a step later."""
    rig.subscribed(rig.camera)
    gate.open.clear()
    first = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    rig.other.value("add_traffic_manager_running", ["127.0.0.1", PORT])
    rig.other.send("tick_cue")
    rig.other.socket.close()
    await_that(lambda: rig.client.value("is_traffic_manager_running", PORT) is False)
    gate.open.set()
    assert holds_for(0.3, lambda: gate.came == 1)
    assert rig.client.value("tick_cue") == first + 1


def test_sensors_that_look_at_nothing_are_measured_while_a_picture_is_drawn(
    rig: Rig, gate: Gate
) -> None:
    camera, imu = rig.subscribed(rig.camera), rig.subscribed(rig.imu)
    gate.open.clear()
    frame = rig.client.value("tick_cue")
    assert frame_of(read_message(imu)) == frame
    assert gate.done == 0
    gate.open.set()
    assert frame_of(read_message(camera)) == frame


def test_calls_are_answered_and_the_next_tick_waits_while_sensors_are_measured(
    rig: Rig, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig.subscribed(rig.camera), rig.subscribed(rig.imu)
    instant, may_measure = simulation._sensors.instant, threading.Event()
    frames = instant.frames

    def measured(*arguments: Any) -> Any:
        assert may_measure.wait(60.0)
        return frames(*arguments)

    monkeypatch.setattr(instant, "frames", measured)
    first = rig.client.value("tick_cue")
    assert rig.client.value("version") == "0.9.16"
    second = rig.asking("tick_cue")
    assert holds_for(0.3, lambda: second() is None)
    may_measure.set()
    await_that(lambda: second() == first + 1)


def test_drawing_begins_before_what_looks_at_nothing_is_measured(
    rig: Rig, gate: Gate, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both need Python's lock, and the next tick waits for the pictures."""
    monkeypatch.setattr("carstage_sim.simulation._MOST_WAIT_S", 60.0)
    camera, imu = rig.subscribed(rig.camera), rig.subscribed(rig.imu)
    sensors, order = simulation._sensors, []
    make, frames = sensors.frame_of, sensors.instant.frames
    monkeypatch.setattr(sensors, "frame_of", lambda state: (order.append("frame"), make(state))[1])
    monkeypatch.setattr(
        sensors.instant, "frames", lambda *scene: (order.append("measured"), frames(*scene))[1]
    )
    gate.open.clear()
    frame = rig.client.value("tick_cue")
    assert frame_of(read_message(imu)) == frame
    assert order == ["frame", "measured"]
    assert gate.done == 0
    gate.open.set()
    assert frame_of(read_message(camera)) == frame


def test_a_scene_that_takes_long_to_make_holds_up_nothing_else(
    rig: Rig, simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera, imu = rig.subscribed(rig.camera), rig.subscribed(rig.imu)
    sensors, came = simulation._sensors, threading.Event()
    make = sensors.frame_of

    def made(state: Any) -> Any:
        assert came.wait(60.0)
        return make(state)

    monkeypatch.setattr(sensors, "frame_of", made)
    frame = rig.client.value("tick_cue")
    assert frame_of(read_message(imu)) == frame
    came.set()
    assert frame_of(read_message(camera)) == frame


def test_a_tick_waits_a_second_at_most_while_one_frame_waits_to_be_drawn(
    rig: Rig, gate: Gate
) -> None:
    """Programs give a call two seconds; a picture may take longer. None is lost."""
    stream = rig.subscribed(rig.camera)
    gate.open.clear()
    first = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    begin_s = time.monotonic()
    assert rig.ticks(1) == [first + 1]
    assert time.monotonic() - begin_s >= 1.0
    more = rig.asking("tick_cue")
    assert holds_for(2.0, lambda: more() is None)
    gate.open.set()
    await_that(lambda: more() == first + 2)
    assert frames_of(stream, 3) == list(range(first, first + 3))


def test_what_a_call_changes_while_a_frame_is_drawn_is_not_in_that_frame(
    rig: Rig, gate: Gate
) -> None:
    stream = rig.subscribed(rig.camera)
    rig.client.value("tick_cue")
    still = read_message(stream)[48:]
    gate.open.clear()
    rig.client.value("tick_cue")
    await_that(lambda: gate.came == 2)
    rig.client.value("set_actor_transform", rig.camera.actor_id, [[60.0, 40.0, 9.0], [0, 70, 0]])
    gate.open.set()
    assert read_message(stream)[48:] == still
    rig.client.value("tick_cue")
    assert read_message(stream)[48:] != still


def test_rays_of_a_client_come_after_the_picture_and_the_others_do_not_wait_for_them(
    rig: Rig, gate: Gate
) -> None:
    rig.subscribed(rig.camera)
    segment = ([0.0, 0.0, 50.0], [0.0, 0.0, -50.0])
    hits = rig.client.value("cast_ray", *segment)
    assert hits
    gate.open.clear()
    rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    later = rig.asking("cast_ray", *segment)
    assert holds_for(0.3, lambda: later() is None)
    assert rig.client.value("version") == "0.9.16"
    gate.open.set()
    await_that(lambda: later() == hits)


def test_a_map_is_loaded_when_the_picture_of_the_old_one_is_out(
    rig: Rig, gate: Gate, simulation: Simulation
) -> None:
    stream = rig.subscribed(rig.camera)
    gate.open.clear()
    frame = rig.client.value("tick_cue")
    await_that(lambda: gate.came == 1)
    loaded = rig.asking("load_new_episode", "", True, 0xFFFF)
    assert holds_for(0.3, lambda: simulation.world.episode_id == 1)
    gate.open.set()
    assert frame_of(read_message(stream)) == frame
    await_that(lambda: simulation.world.episode_id == 2)
    del loaded


def test_an_asynchronous_world_goes_on_and_a_camera_that_is_not_ready_skips_frames(
    rig: Rig, gate: Gate, simulation: Simulation
) -> None:
    pictures, motion = rig.subscribed(rig.camera), rig.subscribed(rig.imu)
    gate.open.clear()
    settings = rig.client.value("get_episode_settings")
    rig.client.value("set_episode_settings", [False, *settings[1:]])
    await_that(lambda: gate.came == 1)
    moving = [frame_of(read_message(motion)) for _ in range(10)]
    assert moving == list(range(moving[0], moving[0] + 10))
    assert gate.came == 1
    gate.open.set()
    first, second = (frame_of(read_message(pictures)) for _ in range(2))
    assert first < moving[-1] < second


@pytest.mark.parametrize("kind", ["colour", "events", "flow"])
def test_the_world_does_not_wait_for_a_camera_that_takes_long_until_somebody_reads_its_pictures(
    rig: Rig, light_gate: Gate, kind: str
) -> None:
    pictures, depths = rig.subscribed(getattr(rig, kind)), rig.subscribed(rig.camera)
    light_gate.open.clear()
    first, second = rig.ticks(2)
    await_that(lambda: light_gate.came == 1)
    # No frame is lost, neither of who reads nor of who has not read yet.
    light_gate.open.set()
    assert frames_of(depths, 2) == [first, second]
    assert frames_of(pictures, 2) == [first, second]

    def waits() -> bool:
        """Whether a tick waits for the picture of the one before."""
        light_gate.open.clear()
        frame, second = *rig.ticks(1), rig.asking("tick_cue")
        waited = holds_for(0.2, lambda: second() is None)
        light_gate.open.set()
        await_that(lambda: second() == frame + 1)
        assert frames_of(pictures, 2) == [frame, frame + 1]
        return waited

    await_that(waits)  # the other side says a moment later that all has come


def test_a_tick_that_is_asked_for_waits_for_one_unread_picture_alone(
    rig: Rig, light_gate: Gate
) -> None:
    pictures, depths = rig.subscribed(rig.colour), rig.subscribed(rig.camera)
    light_gate.open.clear()
    frames = rig.ticks(1)
    await_that(lambda: light_gate.came == 1)
    frames += rig.ticks(1)
    third = rig.asking("tick_cue")
    assert holds_for(0.1, lambda: third() is None)
    light_gate.let_one_through()
    await_that(lambda: third() is not None)
    frames.append(third())
    assert frames_of(depths, 3) == frames
    light_gate.open.set()
    assert frames_of(pictures, 3) == frames


def test_who_ticks_waits_for_late_pictures_of_his_own_sensors_and_nobody_else_does(
    rig: Rig, light_gate: Gate
) -> None:
    pictures = rig.subscribed(rig.spawned_by_other("sensor.camera.rgb", SIZE))
    light_gate.open.clear()
    frames = rig.ticks(1)
    await_that(lambda: light_gate.came == 1)
    frames += rig.ticks(1)
    own = rig.asking("tick_cue")
    assert holds_for(1.5, lambda: own() is None)
    light_gate.let_one_through()
    await_that(lambda: own() is not None)
    frames.append(own())
    # Who is owed nothing gets a tick, for all who ask.
    own = rig.asking("tick_cue")
    assert holds_for(1.5, lambda: own() is None)
    frames += rig.ticks(1)
    await_that(lambda: own() == frames[-1])
    light_gate.open.set()
    assert frames_of(pictures, 4) == frames


def test_pictures_of_who_ticks_do_not_pile_up_on_a_machine_that_is_too_slow(
    rig: Rig, light_gate: Gate, simulation: Simulation
) -> None:
    """A client that takes its pictures late had one more late with each tick, up to 64."""
    pictures = rig.subscribed(rig.spawned_by_other("sensor.camera.rgb", SIZE))
    light_gate.takes_s = 0.25  # longer than the moment that a tick leaves for what is late
    light_gate.give_way = simulation._drawing.give_way
    behind = []
    for _ in range(12):
        frame = rig.other.value("tick_cue")
        behind.append(frame - light_gate.done)
    assert max(behind) - behind[0] <= 2
    assert frames_of(pictures, 12) == list(range(frame - 11, frame + 1))


def test_no_picture_is_drawn_for_who_takes_nothing_until_he_reads_again(
    rig: Rig, light_gate: Gate, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(streaming, "_GIVEN_UP_AFTER_S", 0.3)
    pictures, depths = rig.subscribed(rig.colour), rig.subscribed(rig.camera)
    first, *_ = rig.ticks(1)
    await_that(lambda: light_gate.came == 1)

    def passed_over() -> bool:
        came, frames = light_gate.came, rig.ticks(2)
        assert frames_of(depths, 2)[-1] in frames
        return holds_for(0.1, lambda: light_gate.came == came)

    frames_of(depths, 1)
    await_that(passed_over)
    drawn = light_gate.came
    frames_of(pictures, drawn)

    def drawn_again() -> bool:
        rig.ticks(1)
        return light_gate.came > drawn

    await_that(drawn_again)
    assert frames_of(pictures, 1)[0] > first + drawn


def test_a_world_that_is_late_makes_up_for_it_by_longer_steps(
    monkeypatch: pytest.MonkeyPatch, simulation: Simulation
) -> None:
    clock_s = [100.0]
    monkeypatch.setattr("carstage_sim.simulation.time.monotonic", lambda: clock_s[0])
    simulation.apply_settings(EpisodeSettings())

    def step_after(wall_s: float) -> float:
        clock_s[0] += wall_s
        return simulation.tick().state.delta_s

    assert step_after(0.03) == pytest.approx(0.03)
    steps = [step_after(0.35), *(step_after(0.03) for _ in range(5))]
    assert steps == pytest.approx([0.1, 0.1, 0.1, 0.1, 0.07, 0.03])
    # Nobody wants a world that rushes after a minute of which it knew nothing.
    assert sum([step_after(60.0), *(step_after(0.03) for _ in range(40))]) < 2.5


def test_a_fixed_step_lasts_as_long_as_it_simulates_in_asynchronous_mode(
    monkeypatch: pytest.MonkeyPatch, simulation: Simulation
) -> None:
    with server_of(simulation) as server:
        clock_s, ticks = [100.0], []

        def serve_one(timeout_s: float) -> bool:
            clock_s[0] += timeout_s
            return False

        monkeypatch.setattr("carstage_sim.server.time.monotonic", lambda: clock_s[0])
        monkeypatch.setattr(server, "_serve_one", serve_one)
        monkeypatch.setattr(server, "_tick", lambda: ticks.append(clock_s[0] - 100.0))
        server._next_tick_s = clock_s[0]
        for delta_s in (0.08, None):
            simulation.apply_settings(EpisodeSettings(fixed_delta_seconds=delta_s))
            ticks.clear()
            start_s = server._next_tick_s - 100.0
            while len(ticks) < 3:
                server._run_freely()
            period_s = delta_s or 0.02
            assert ticks == pytest.approx([start_s + k * period_s for k in range(3)])
        simulation.apply_settings(EpisodeSettings(fixed_delta_seconds=0.1))
        clock_s[0] = server._next_tick_s + 0.35
        ticks.clear()
        while len(ticks) < 6:
            server._run_freely()
        late = [tick - ticks[0] for tick in ticks]
        assert late == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.05, 0.15])
