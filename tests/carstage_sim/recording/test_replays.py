from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from carstage_sim.maps import Town
from carstage_sim.recording import RecorderController, RecordingError, RecordingsFolder
from carstage_sim.recording import recorder_controller as deck_module
from carstage_sim.recording.events import ActorAdded, actors_added_packet
from carstage_sim.recording.layout import FRAME, HEADER, LogInfo, Packet, packet, rows_packet
from carstage_sim.recording.recorder import Recorder
from carstage_sim.recording.replay_actors import ReplayCast, ReplayOptions
from carstage_sim.world.controls import VehicleControl, WalkerControl
from carstage_sim.world.pose import Pose
from carstage_sim.world.signals.traffic_lights import TrafficLightState
from carstage_sim.world.snapshot import Snapshot
from carstage_sim.world.state import ActorKind, Weather
from carstage_sim.world.world import World

CAR = "vehicle.tesla.model3"
TRUCK = "vehicle.carlamotors.firetruck"
WALKER = "walker.pedestrian.0001"
DELTA_S = 0.05


def place(town: Town, index: int) -> Pose:
    x, y, z, pitch, yaw, roll = town.spawn_points[index].tolist()
    return Pose((x, y, z), (pitch, yaw, roll))


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def new_world(stage01: Town, earlier: World) -> Callable[[], World]:
    return lambda: World(stage01, episode_id=1, previous=earlier)


@pytest.fixture
def recorder(tmp_path: Path) -> Iterator[RecorderController]:
    recorder = RecorderController(RecordingsFolder(tmp_path))
    yield recorder
    recorder.end_episode()


def tick(world: World, recorder: RecorderController) -> Snapshot:
    recorder.before_tick(DELTA_S)
    snapshot = world.tick(DELTA_S, 5)
    recorder.after_tick(snapshot)
    return snapshot


def populate(world: World) -> tuple[int, int]:
    """Two cars, one of them the hero, and a walker that goes round in a circle."""
    hero = world.spawn(CAR, {"role_name": "hero", "color": "1,2,3"}, place(world.town, 0))
    other = world.spawn(CAR, {}, place(world.town, 6))
    x, y, z = place(world.town, 12).location
    walker = world.spawn(WALKER, {}, Pose((x, y, z + 1.0)))
    world.control_vehicle(hero.actor_id, VehicleControl(throttle=0.6, steer=0.2))
    world.control_vehicle(other.actor_id, VehicleControl(throttle=0.9, steer=-0.3))
    world.control_walker(walker.actor_id, WalkerControl((0.6, 0.8, 0.0), 1.4))
    return hero.actor_id, walker.actor_id


def drive(world: World, recorder: RecorderController, ticks: int) -> list[Snapshot]:
    frames = []
    for number in range(ticks):
        if number == ticks // 2:
            world.set_weather(Weather(cloudiness=80.0, sun_altitude_angle=-10.0))
            for car in world.actors.of_kind(ActorKind.VEHICLE):
                assert car.vehicle is not None
                car.vehicle.light_state = 3
        frames.append(tick(world, recorder))
    return frames


def recording(
    new_world: Callable[[], World], recorder: RecorderController, ticks: int
) -> list[Snapshot]:
    world = new_world()
    populate(world)
    recorder.start("drive.log", world, additional_data=True)
    frames = drive(world, recorder, ticks)
    recorder.stop()
    return frames


def rows_of(snapshot: Snapshot, *kinds: ActorKind) -> np.ndarray:
    return np.isin(snapshot.state.kind, kinds)


def test_replay_in_a_fresh_world_repeats_poses_ids_lights_and_weather(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recorded = recording(new_world, recorder, 100)
    world = new_world()
    recorder.replay("drive.log", world, ReplayOptions())
    for original in recorded[1:]:
        again = tick(world, recorder)
        assert again.state.actor_id.tolist() == original.state.actor_id.tolist()
        moving = rows_of(original, ActorKind.VEHICLE, ActorKind.WALKER)
        apart = again.state.location[moving] - original.state.location[moving]
        assert np.abs(apart).max() < 0.01
        turned = again.state.rotation_deg[moving] - original.state.rotation_deg[moving]
        assert np.abs((turned + 180.0) % 360.0 - 180.0).max() < 0.01
        assert again.traffic_lights.state.tolist() == original.traffic_lights.state.tolist()
        assert again.state.light_state.tolist() == original.state.light_state.tolist()
        assert again.state.weather.cloudiness == original.state.weather.cloudiness
        np.testing.assert_allclose(again.vehicles.control, original.vehicles.control, atol=1e-6)
        np.testing.assert_allclose(again.walkers.speed, original.walkers.speed, atol=1e-6)
        angle = again.state.wheel_angle_deg - original.state.wheel_angle_deg
        assert np.abs(angle).max() < 0.01
    assert not recorder.replaying


def test_replayed_velocities_follow_from_the_poses(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recorded = recording(new_world, recorder, 40)
    world = new_world()
    recorder.replay("drive.log", world, ReplayOptions())
    again = [tick(world, recorder) for _ in recorded[1:]][-1]
    cars = rows_of(again, ActorKind.VEHICLE)
    expected = recorded[-1].state.velocity[cars]
    np.testing.assert_allclose(again.state.velocity[cars][:, :2], expected[:, :2], atol=0.02)
    assert np.linalg.norm(expected[0]) > 1.0


@pytest.mark.parametrize("time_factor", [1.0, 2.0])
def test_a_replay_that_begins_late_or_on_living_actors_begins_in_motion(
    new_world: Callable[[], World], recorder: RecorderController, time_factor: float
) -> None:
    recorded = recording(new_world, recorder, 60)[40:43]
    fresh, lived_in = new_world(), new_world()
    populate(lived_in)
    for actor_id in (car.actor_id for car in lived_in.actors.of_kind(ActorKind.VEHICLE)):
        x, y, z = lived_in.actors.pose(actor_id).location
        lived_in.set_pose(actor_id, Pose((x + 5.0, y, z)))
    tick(lived_in, recorder)
    recorder.set_time_factor(time_factor)
    for world in (fresh, lived_in):
        recorder.replay("drive.log", world, ReplayOptions(start_s=2.0))
        again = tick(world, recorder).state
        moving = np.isin(again.kind, (ActorKind.VEHICLE, ActorKind.WALKER))
        then = rows_of(recorded[0], ActorKind.VEHICLE, ActorKind.WALKER)
        first, later = recorded[0].state, recorded[int(time_factor)].state
        velocity = (later.location[then] - first.location[then]) / DELTA_S
        assert np.linalg.norm(velocity, axis=1).min() > 1.0
        np.testing.assert_allclose(again.velocity[moving], velocity, atol=0.02)
        np.testing.assert_allclose(again.acceleration[moving], 0.0, atol=3.0 * time_factor**2)
        turned = again.angular_velocity_deg[moving][:-1, 2] / time_factor
        np.testing.assert_allclose(turned, first.angular_velocity_deg[then][:-1, 2], atol=3.0)


def test_replay_at_another_step_is_between_the_recorded_poses(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recorded = recording(new_world, recorder, 40)
    world = new_world()
    recorder.set_time_factor(0.5)
    recorder.replay("drive.log", world, ReplayOptions(start_s=0.5))
    again = tick(world, recorder)
    cars = rows_of(again, ActorKind.VEHICLE)
    middle = (recorded[10].state.location[cars] + recorded[11].state.location[cars]) / 2.0
    np.testing.assert_allclose(again.state.location[cars], middle, atol=0.01)


def test_negative_start_counts_from_the_end_and_a_duration_ends_the_replay(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recorded = recording(new_world, recorder, 41)
    world = new_world()
    text = recorder.replay("drive.log", world, ReplayOptions(start_s=-1.0, duration_s=0.5))
    assert "Total time recorded: 2\n" in text
    assert "Replaying from 1 s - 1.5 s (2 s) at 1.0x\n" in text
    played = 0
    while recorder.replaying:
        again = tick(world, recorder)
        played += 1
    assert played == 10
    cars = rows_of(again, ActorKind.VEHICLE)
    np.testing.assert_allclose(
        again.state.location[cars], recorded[30].state.location[cars], atol=0.01
    )


def test_replays_in_the_session_of_the_recording_give_the_recorded_ids_back(
    new_world: Callable[[], World], recorder: RecorderController, stage01: Town
) -> None:
    world = new_world()
    _, walker = populate(world)
    recorder.start("drive.log", world, additional_data=True)
    recorded = drive(world, recorder, 20)
    recorder.stop()
    cars = [car.actor_id for car in world.actors.of_kind(ActorKind.VEHICLE)]
    world.kill_walker(walker)
    for actor_id in (*cars, walker):
        world.destroy(actor_id)
    bystander = world.spawn(TRUCK, {}, place(stage01, 20)).actor_id
    for _ in range(2):
        recorder.replay("drive.log", world, ReplayOptions())
        again = [tick(world, recorder) for _ in recorded[1:]][-1]
        ids = again.state.actor_id
        assert ids[again.vehicles.rows].tolist() == [*cars, bystander]
        assert ids[again.walkers.rows].tolist() == [walker]
        assert ids.tolist() == sorted(ids.tolist())
        played = np.isin(ids, [*cars, walker])
        moving = rows_of(recorded[-1], ActorKind.VEHICLE, ActorKind.WALKER)
        apart = again.state.location[played] - recorded[-1].state.location[moving]
        assert np.abs(apart).max() < 0.01
    bystander_pose = world.actors.pose(bystander)
    np.testing.assert_allclose(bystander_pose.location, place(stage01, 20).location, atol=0.5)
    for _ in range(220):  # the walker that was killed had ten seconds left
        world.tick(DELTA_S)
    assert walker in world.actors
    assert world.spawn(CAR, {}, place(stage01, 30)).actor_id == bystander + 1


def test_actors_whose_ids_are_taken_are_mapped_to_new_ones(
    new_world: Callable[[], World], recorder: RecorderController, stage01: Town
) -> None:
    recorded = recording(new_world, recorder, 20)
    world = new_world()
    strangers = [world.spawn(WALKER, {}, place(stage01, index)).actor_id for index in (20, 24, 28)]
    recorder.replay("drive.log", world, ReplayOptions())
    again = tick(world, recorder)
    cars = world.actors.of_kind(ActorKind.VEHICLE)
    assert [car.actor_id for car in cars] == [strangers[-1] + 1, strangers[-1] + 2]
    # The recorded walker's id is a living walker's of the same type: that one plays its part.
    assert len(world.actors.of_kind(ActorKind.WALKER)) == len(strangers)
    now = again.state.location[rows_of(again, ActorKind.VEHICLE)]
    then = recorded[1].state.location[rows_of(recorded[1], ActorKind.VEHICLE)]
    np.testing.assert_allclose(now, then, atol=0.01)


def test_actors_that_come_and_go_do_so_in_the_replay(
    new_world: Callable[[], World], recorder: RecorderController, stage01: Town
) -> None:
    world = new_world()
    recorder.start("drive.log", world, additional_data=False)
    first = world.spawn(CAR, {}, place(stage01, 0)).actor_id
    drive(world, recorder, 10)
    world.destroy(first)
    second = world.spawn(CAR, {}, place(stage01, 6)).actor_id
    drive(world, recorder, 10)
    recorder.stop()
    world = new_world()
    recorder.replay("drive.log", world, ReplayOptions())
    alive = []
    while recorder.replaying:
        tick(world, recorder)
        alive.append([car.actor_id for car in world.actors.of_kind(ActorKind.VEHICLE)])
    assert alive == [[first]] * 9 + [[second]] * 10


def test_actors_that_come_in_a_replay_come_without_a_velocity(
    new_world: Callable[[], World], recorder: RecorderController, stage01: Town
) -> None:
    world = new_world()
    recorder.start("drive.log", world, additional_data=False)
    drive(world, recorder, 10)
    car = world.spawn(CAR, {}, place(stage01, 0)).actor_id
    drive(world, recorder, 10)
    recorder.stop()
    world = new_world()
    x, y, z = place(stage01, 0).location
    assert world.spawn(CAR, {}, Pose((x + 5.0, y, z))).actor_id == car
    recorder.replay("drive.log", world, ReplayOptions())
    while recorder.replaying:
        again = tick(world, recorder).state
        assert np.abs(again.velocity[again.kind == ActorKind.VEHICLE, :2]).max() < 0.5


def test_attached_actors_ride_on_their_parents_again_and_sensors_come_on_request(
    new_world: Callable[[], World], recorder: RecorderController, stage01: Town
) -> None:
    world = new_world()
    car = world.spawn(CAR, {}, place(stage01, 0)).actor_id
    mount = Pose((1.0, 0.2, 2.0), (-5.0, 10.0, 0.0))
    world.spawn("sensor.camera.rgb", {"fov": "77"}, mount, parent_id=car)
    world.control_vehicle(car, VehicleControl(throttle=1.0))
    recorder.start("drive.log", world, additional_data=False)
    recorded = drive(world, recorder, 20)[-1]
    recorder.stop()
    for sensors in (False, True):
        world = new_world()
        recorder.replay("drive.log", world, ReplayOptions(sensors=sensors))
        again = [tick(world, recorder) for _ in range(19)][-1]
        cameras = world.actors.of_kind(ActorKind.SENSOR)
        assert len(cameras) == int(sensors)
    assert (cameras[0].parent_id, cameras[0].attributes["fov"]) == (car, "77")
    rows = rows_of(again, ActorKind.SENSOR)
    np.testing.assert_allclose(again.state.location[rows], recorded.state.location[rows], atol=0.01)


def test_ignored_hero_is_left_out(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recording(new_world, recorder, 10)
    world = new_world()
    recorder.ignore_hero = True
    text = recorder.replay("drive.log", world, ReplayOptions())
    tick(world, recorder)
    assert "Ignoring Hero vehicle\n" in text
    roles = [car.attributes["role_name"] for car in world.actors.of_kind(ActorKind.VEHICLE)]
    assert roles == ["autopilot"]


def test_spectator_follows_the_recorded_actor(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recording(new_world, recorder, 10)
    world = new_world()
    hero = world.spectator.actor_id + 1
    recorder.replay(
        "drive.log", world, ReplayOptions(follow_id=hero, follow_offset=Pose((0, 0, 3.0)))
    )
    tick(world, recorder)
    above = np.subtract(
        world.actors.pose(world.spectator.actor_id).location, world.actors.pose(hero).location
    )
    np.testing.assert_allclose(above, (0.0, 0.0, 3.0), atol=0.05)


def test_stopping_a_replay_gives_back_physics_and_takes_its_actors_away_on_request(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    recording(new_world, recorder, 40)
    for keep in (True, False):
        world = new_world()
        recorder.replay("drive.log", world, ReplayOptions())
        for _ in range(20):
            tick(world, recorder)
        recorder.end_replay(keep_actors=keep)
        assert not recorder.replaying
        cars = world.actors.of_kind(ActorKind.VEHICLE)
        assert len(cars) == (2 if keep else 0)
        for car in cars:
            assert (car.simulate_physics, car.collides) == (True, True)
        for _ in range(60):
            snapshot = tick(world, recorder)
        cars_rows = rows_of(snapshot, ActorKind.VEHICLE)
        assert np.abs(snapshot.state.velocity[cars_rows][:, :2]).max(initial=0.0) < 0.3


def test_traffic_lights_go_on_from_the_replayed_states_without_two_greens(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    world = new_world()
    for _ in range(150):  # 7.5 s of the first green are over when the recording begins
        tick(world, recorder)
    recorder.start("lights.log", world, additional_data=False)
    for _ in range(101):
        recorded = tick(world, recorder)
    recorder.stop()
    replayed = new_world()
    recorder.replay("lights.log", replayed, ReplayOptions())
    while recorder.replaying:
        again = tick(replayed, recorder)
    assert again.traffic_lights.state.tolist() == recorded.traffic_lights.state.tolist()
    for _ in range(400):
        expected, found = tick(world, recorder), tick(replayed, recorder)
        assert found.traffic_lights.state.tolist() == expected.traffic_lights.state.tolist()
    assert TrafficLightState.GREEN in found.traffic_lights.state


def test_same_drive_gives_the_same_bytes(
    new_world: Callable[[], World], recorder: RecorderController, tmp_path: Path
) -> None:
    recording(new_world, recorder, 30)
    first = (tmp_path / "drive.log").read_bytes()
    recording(new_world, recorder, 30)
    assert (tmp_path / "drive.log").read_bytes() == first


def test_a_log_that_was_cut_off_replays_to_its_last_whole_frame(
    new_world: Callable[[], World], recorder: RecorderController, tmp_path: Path
) -> None:
    recording(new_world, recorder, 30)
    path = tmp_path / "drive.log"
    path.write_bytes(path.read_bytes()[:-700])
    world = new_world()
    recorder.replay("drive.log", world, ReplayOptions())
    ticks = 0
    while recorder.replaying:
        tick(world, recorder)
        ticks += 1
    assert 20 < ticks < 29


def test_doors_and_street_lamps_are_replayed(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    world = new_world()
    hero, _ = populate(world)
    recorder.start("evening.log", world, additional_data=False)
    for number in range(12):
        if number == 6:
            status = world.live(hero).vehicle
            assert status is not None
            status.open_doors = 0b101
            lamp = world.street_lights.states()[0]
            world.street_lights.apply([replace(lamp, intensity=500.0, colour=(255, 10, 30))])
        recorded = tick(world, recorder)
    recorder.stop()
    expected = world.street_lights.states()
    world = new_world()
    recorder.replay("evening.log", world, ReplayOptions())
    while recorder.replaying:
        again = tick(world, recorder)
    assert again.state.doors is not None
    assert recorded.state.doors is not None
    assert again.state.doors.tolist() == recorded.state.doors.tolist()
    assert world.street_lights.states() == expected


def test_a_replay_of_the_running_recording_shows_its_last_frame_too(
    new_world: Callable[[], World], recorder: RecorderController
) -> None:
    world = new_world()
    recorder.start("running.log", world, additional_data=False)
    for _ in range(3):
        tick(world, recorder)
    assert "Total time recorded: 0.1\n" in recorder.replay("running.log", world, ReplayOptions())


def test_a_refused_replay_lets_the_lights_go_on(
    new_world: Callable[[], World], recorder: RecorderController, tmp_path: Path
) -> None:
    damaged = [
        LogInfo(1, 0, "Carla/Maps/Stage01").encode(),
        packet(Packet.FRAME_START, FRAME.pack(1, -1.0, 0.0)),
        packet(Packet.EVENT_ADD, b""),
        packet(Packet.FRAME_END, b""),
    ]
    (tmp_path / "damaged.log").write_bytes(b"".join(damaged))
    world = new_world()
    with pytest.raises(RecordingError, match="not a CARLA recorder"):
        recorder.replay("damaged.log", world, ReplayOptions())
    assert not world.lights.led


@pytest.mark.parametrize(("door", "bits"), [(3, 0b1000), (6, 0b11_1111), (7, 0), (200, 0)])
def test_doors_that_no_vehicle_has_are_not_replayed(
    new_world: Callable[[], World], door: int, bits: int
) -> None:
    world = new_world()
    car = world.spawn(CAR, {}, place(world.town, 0))
    cast = ReplayCast(world, ReplayOptions())
    added = ActorAdded(car.actor_id, int(car.kind), place(world.town, 0), 0, CAR, ())
    opened = rows_packet(Packet.VEHICLE_DOOR, id=[car.actor_id], door=[door], open=[True])
    cast.play(
        [
            (Packet.EVENT_ADD, actors_added_packet([added])[HEADER.size :]),
            (Packet.VEHICLE_DOOR, opened[HEADER.size :]),
        ]
    )
    assert car.vehicle is not None
    assert car.vehicle.open_doors == bits


def test_a_recorded_id_after_which_no_more_are_left_is_not_taken(
    new_world: Callable[[], World], stage01: Town
) -> None:
    world = new_world()
    cast = ReplayCast(world, ReplayOptions())
    added = ActorAdded(0xFFFF_FFFF, int(ActorKind.VEHICLE), place(stage01, 0), 0, CAR, ())
    cast.play([(Packet.EVENT_ADD, actors_added_packet([added])[HEADER.size :])])
    played = cast.actor(0xFFFF_FFFF)
    assert played is not None
    assert world.spawn(CAR, {}, place(stage01, 6)).actor_id == played.actor_id + 1


@pytest.mark.parametrize(
    "pose", [Pose((np.nan, 0.0, 0.0)), Pose(rotation_deg=(0.0, np.inf, 0.0))], ids=["place", "turn"]
)
def test_actors_without_a_finite_pose_are_not_replayed(
    new_world: Callable[[], World], pose: Pose
) -> None:
    world = new_world()
    before = len(world.actors)
    cast = ReplayCast(world, ReplayOptions())
    added = ActorAdded(500, int(ActorKind.VEHICLE), pose, 0, CAR, ())
    cast.play([(Packet.EVENT_ADD, actors_added_packet([added])[HEADER.size :])])
    assert cast.actor(500) is None
    assert len(world.actors) == before


def test_the_longest_way_of_a_log_begins_with_a_finite_velocity(
    new_world: Callable[[], World], recorder: RecorderController, tmp_path: Path
) -> None:
    world = new_world()
    car = ActorAdded(500, int(ActorKind.VEHICLE), place(world.town, 0), 0, CAR, ())
    parts = [LogInfo(1, 0, "Carla/Maps/Stage01").encode()]
    for number, x_cm in enumerate((-3e38, 3e38)):
        position = {"id": [500], "location": [(x_cm, 0.0, 0.0)], "rotation": [(0.0, 0.0, 0.0)]}
        parts += [
            packet(Packet.FRAME_START, FRAME.pack(number + 1, DELTA_S, number * DELTA_S)),
            actors_added_packet([car] if number == 0 else []),
            rows_packet(Packet.POSITION, **position),
            packet(Packet.FRAME_END, b""),
        ]
    (tmp_path / "far.log").write_bytes(b"".join(parts))
    recorder.replay("far.log", world, ReplayOptions())
    assert np.isfinite(world.fleet.location).all()
    assert world.fleet.velocity[0].tolist() == pytest.approx((6e36 / DELTA_S, 0.0, 0.0))


def test_a_full_disk_is_a_recording_error_and_the_file_is_given_back(
    new_world: Callable[[], World],
) -> None:
    world = new_world()
    recorder = Recorder(Path("/dev/full"), world, additional_data=False)
    recorder.record(world.tick(DELTA_S))
    with pytest.raises(RecordingError, match="No space left"):
        recorder.flush()
    with pytest.raises(RecordingError, match="No space left"):
        recorder.close()
    recorder.close()


def test_an_episode_ends_whatever_becomes_of_its_recording(
    new_world: Callable[[], World],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr(deck_module, "check_writable", lambda _path: None)
    recorder = RecorderController(RecordingsFolder(Path("/dev")))
    world = new_world()
    recorder.start("full", world, additional_data=False)
    tick(world, recorder)
    recorder.end_episode()
    assert "No space left" in caplog.text
    recorder.stop()


def test_a_recording_that_cannot_go_on_gives_its_file_back(
    new_world: Callable[[], World], recorder: RecorderController, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = new_world()
    recorder.start("drive.log", world, additional_data=False)
    closed = []

    def fail(_recorder: Recorder, _snapshot: Snapshot) -> None:
        raise RecordingError("cannot write")

    close = Recorder.close
    monkeypatch.setattr(Recorder, "record", fail)
    monkeypatch.setattr(Recorder, "close", lambda self: closed.append(close(self)))
    tick(world, recorder)
    assert closed == [None]
