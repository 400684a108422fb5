"""The server's two ports, asked by a client that does what the real one never would."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import pytest

from raw_client import RawClient, await_first_message, read_message, subscribe

if TYPE_CHECKING:
    from running_simulator import RunningSimulator

SETTINGS = [True, False, [True, 0.05], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
ORIGIN = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]


@pytest.fixture
def client(simulator: RunningSimulator) -> Iterator[RawClient]:
    """A client on a new episode in synchronous mode."""
    with RawClient(simulator.host, simulator.port) as raw:
        raw.value("set_episode_settings", SETTINGS)
        raw.value("load_new_episode", "", False, 0xFFFF)
        yield raw


def spawn(client: RawClient, type_id: str, transform: list[list[float]]) -> list[object]:
    definitions = client.value("get_actor_definitions")
    uid, _, _, attributes = next(d for d in definitions if d[1] == type_id)
    description = [uid, type_id, [[name, kind, value] for name, kind, value, *_ in attributes]]
    actor: list[object] = client.value("spawn_actor", description, transform)
    return actor


def snapshot_stream(client: RawClient) -> int:
    _, (token,) = client.value("get_episode_info")
    (stream_id,) = struct.unpack_from("<I", token)
    return int(stream_id)


def free_place(client: RawClient, index: int = 0) -> list[list[float]]:
    _, spawn_points = client.value("get_map_info")
    place: list[list[float]] = spawn_points[index]
    return place


def test_unknown_call_is_refused_in_the_words_of_rpclib(client: RawClient) -> None:
    error, result = client.call("make_coffee", 1, 2)
    assert error == "rpclib: server could not find function 'make_coffee' with argument count 3."
    assert result is None


def test_wrong_number_of_arguments_is_a_refusal_and_the_server_lives_on(client: RawClient) -> None:
    error, (result,) = client.call("get_actor_bounding_box")
    assert error is None
    assert result[0] == 0
    assert result[1][0] == "get_actor_bounding_box takes 1 arguments, got 0"
    assert client.value("version") == "0.9.16"


def test_garbage_on_the_rpc_port_costs_only_its_own_connection(
    simulator: RunningSimulator, client: RawClient
) -> None:
    with RawClient(simulator.host, simulator.port) as rude:
        rude.socket.sendall(b"GET / HTTP/1.1\r\n\r\n")
        assert rude.socket.recv(100) == b""
    assert client.value("version") == "0.9.16"


def test_tick_answers_the_number_of_the_frame_it_made(client: RawClient) -> None:
    first = client.value("tick_cue")
    assert [client.value("tick_cue") for _ in range(3)] == [first + 1, first + 2, first + 3]


def test_snapshot_is_published_before_the_tick_is_answered(
    simulator: RunningSimulator, client: RawClient
) -> None:
    with subscribe(simulator.host, simulator.streaming_port, snapshot_stream(client)) as stream:
        await_first_message(client, stream)
        frame = client.value("tick_cue")
        stream.setblocking(False)
        (size,) = struct.unpack("<I", stream.recv(4))
        assert size > 84
        assert struct.unpack("<QQ", stream.recv(16))[1] == frame


def test_tick_waits_for_a_client_that_was_just_told_where_the_snapshots_are(
    simulator: RunningSimulator, client: RawClient
) -> None:
    stream_id = snapshot_stream(client)
    client.value("get_sensor_token", stream_id)
    with ThreadPoolExecutor(1) as threads:
        begun = threading.Event()

        def subscribe_late() -> socket.socket:
            begun.wait(0.5)  # never set: a client whose thread is slow
            return subscribe(simulator.host, simulator.streaming_port, stream_id)

        late = threads.submit(subscribe_late)
        frame = client.value("tick_cue")
        with late.result() as stream:
            assert struct.unpack_from("<Q", read_message(stream), 8) == (frame,)


def read_what_was_on_its_way(stream: socket.socket) -> None:
    stream.settimeout(0.1)
    with contextlib.suppress(TimeoutError):
        while True:
            read_message(stream)


def test_every_episode_has_its_own_stream_of_snapshots(client: RawClient) -> None:
    before = snapshot_stream(client)
    client.value("load_new_episode", "", False, 0xFFFF)
    assert snapshot_stream(client) > before


def test_subscriber_of_an_episode_that_ended_sees_the_next_one(
    simulator: RunningSimulator, client: RawClient
) -> None:
    with subscribe(simulator.host, simulator.streaming_port, snapshot_stream(client)) as stream:
        (episode_id,) = struct.unpack_from("<Q", await_first_message(client, stream), 48)
        client.value("load_new_episode", "", False, 0xFFFF)
        message = read_message(stream)
        next_id, _, _, *_, flags = struct.unpack_from("<Qdf3iI", message, 48)
        assert (next_id, flags) == (episode_id + 1, 1)  # with the change of map


def test_stream_that_does_not_exist_stays_open_and_silent(
    simulator: RunningSimulator, client: RawClient
) -> None:
    with subscribe(simulator.host, simulator.streaming_port, 4_000_000_000) as stream:
        for _ in range(3):
            client.value("tick_cue")
        stream.setblocking(False)
        with pytest.raises(BlockingIOError):  # neither data nor an end
            stream.recv(1)


def test_stream_of_a_destroyed_sensor_stays_open_and_silent(
    simulator: RunningSimulator, client: RawClient
) -> None:
    sensor_id, *_, token = spawn(client, "sensor.other.gnss", free_place(client))
    (stream_id,) = struct.unpack_from("<I", token)
    with subscribe(simulator.host, simulator.streaming_port, stream_id) as stream:
        await_first_message(client, stream)
        assert client.value("destroy_actor", sensor_id) is True
        read_what_was_on_its_way(stream)
        for _ in range(3):
            client.value("tick_cue")
        stream.setblocking(False)
        with pytest.raises(BlockingIOError):
            stream.recv(1)


@pytest.mark.parametrize("stream_id", [-1, 2**32, 2**64 - 1, -(2**63)])
def test_number_that_no_stream_can_have_is_refused(client: RawClient, stream_id: int) -> None:
    _, ((kind, (text,)),) = client.call("get_sensor_token", stream_id)
    assert kind == 0
    assert text == f"{stream_id} is no stream: 0 to 4294967295"


def test_ids_that_no_actor_can_have_are_not_looked_through(
    simulator: RunningSimulator, client: RawClient
) -> None:
    sensor_id, *_, token = spawn(client, "sensor.other.obstacle", free_place(client))
    lidar_id, *_, lidar_token = spawn(client, "sensor.lidar.ray_cast_semantic", ORIGIN)
    for actor_id in (sensor_id, lidar_id):
        client.value("set_ignored_vehicles", actor_id, [-(2**63), -1, 2**40])
    (stream_id,) = struct.unpack_from("<I", token)
    (lidar_stream,) = struct.unpack_from("<I", lidar_token)
    with (
        subscribe(simulator.host, simulator.streaming_port, stream_id),
        subscribe(simulator.host, simulator.streaming_port, lidar_stream) as lidar,
    ):
        await_first_message(client, lidar)


def test_queries_about_a_destroyed_vehicle_are_answered(client: RawClient) -> None:
    vehicle_id, *_ = spawn(client, "vehicle.tesla.model3", free_place(client))
    box = client.value("get_actor_bounding_box", vehicle_id)
    assert client.value("destroy_actor", vehicle_id) is True
    assert client.value("destroy_actor", vehicle_id) == ["unable to destroy actor: not found"]
    assert client.value("get_actor_bounding_box", vehicle_id) == box
    assert client.value("get_vehicle_light_state", vehicle_id) == [0]
    assert client.value("get_physics_control", vehicle_id)[11] > 0.0
    assert client.value("set_actor_simulate_physics", vehicle_id, True) is None


def test_actor_of_the_episode_before_is_still_answered_after_a_reload(client: RawClient) -> None:
    places = [free_place(client, index) for index in (0, 20)]
    _, second = (spawn(client, "vehicle.tesla.model3", place)[0] for place in places)
    client.value("load_new_episode", "", False, 0xFFFF)
    assert client.value("get_actors_by_id", [second]) == []
    assert client.value("get_actor_bounding_box", second)[1][0] > 1.0


def test_reload_starts_ids_and_frames_anew(client: RawClient) -> None:
    def episode() -> tuple[int, object]:
        client.value("load_new_episode", "", False, 0xFFFF)
        frame = client.value("tick_cue")
        return frame, spawn(client, "vehicle.tesla.model3", free_place(client))[0]

    assert episode() == episode()


def test_reload_gives_another_episode_id(client: RawClient) -> None:
    before, _ = client.value("get_episode_info")
    client.value("load_new_episode", "", False, 0xFFFF)
    after, _ = client.value("get_episode_info")
    assert after != before


def test_unknown_map_is_refused_and_the_world_stays(client: RawClient) -> None:
    before = client.value("get_episode_info")
    _, ((failed, message),) = client.call("load_new_episode", "Atlantis", True, 0xFFFF)
    assert (failed, message) == (True, ["map not found"])
    assert client.value("get_episode_info") == before


def test_refusals_name_call_reason_and_actor_in_the_words_of_carla(client: RawClient) -> None:
    light_id = client.value("get_actors_by_id", list(range(1, 5)))[0][0]
    for call, arguments, reason in (
        ("get_physics_control", (999_999,), "Actor could not be found in the registry"),
        ("get_physics_control", (light_id,), "Actor does not match the expected type"),
        ("set_traffic_light_state", (999_999, 0), "Actor could not be found in the registry"),
    ):
        actor_id = arguments[0]
        text = f"Responding error from function {call}: {reason}.  Actor Id: {actor_id}"
        assert client.value(call, *arguments) == [text]
    _, (((failed, (text,)),),) = client.call(
        "apply_batch", [[[6, [999_999, [[0.0] * 3, [0.0] * 3]]]]], False
    )
    assert failed == 0
    assert text.startswith("Responding error from function set_actor_transform: ")


def test_spawning_onto_a_vehicle_is_refused_in_the_words_of_carla(client: RawClient) -> None:
    place = free_place(client)
    spawn(client, "vehicle.tesla.model3", place)
    definitions = client.value("get_actor_definitions")
    uid = next(d[0] for d in definitions if d[1] == "vehicle.audi.tt")
    _, ((kind, message),) = client.call("spawn_actor", [uid, "vehicle.audi.tt", []], place)
    assert (kind, message) == (0, ["Spawn failed because of collision at spawn position"])


def test_sensor_with_an_impossible_attribute_is_refused_when_it_is_spawned(
    client: RawClient,
) -> None:
    description = [0, "sensor.camera.rgb", [["image_size_x", 2, "-3"]]]
    _, ((kind, message),) = client.call("spawn_actor", description, ORIGIN)
    assert kind == 0
    assert "image_size_x" in message[0]


def test_batch_puts_the_new_actor_into_the_commands_that_follow_it(client: RawClient) -> None:
    control = [0.5, 0.25, 0.0, False, False, False, 0]
    spawn_command = [
        0,
        [
            [0, "vehicle.tesla.model3", []],
            free_place(client),
            [False],
            72,  # clients leave the kind of attachment uninitialised
            "",
            [[[2, [0, control]]], [[18, [0, 6]]]],
        ],
    ]
    error, ((success,),) = client.call("apply_batch", [[spawn_command]], False)
    assert error is None
    assert success[0] == 1
    assert client.value("get_vehicle_light_states") == [[success[1], 6]]
    client.value("tick_cue")
    telemetry = client.value("get_telemetry_data", success[1])
    assert telemetry[1:4] == [0.25, 0.5, 0.0]


def test_batch_attaches_to_no_parent_that_is_not_there(client: RawClient) -> None:
    before = client.value("get_actors_by_id", list(range(1, 1000)))
    camera = [0, "sensor.camera.rgb", []]
    spawn_command = [0, [camera, ORIGIN, [True, 0], 0, "", []]]
    _, (((kind, (message,)),),) = client.call("apply_batch", [[spawn_command]], False)
    assert kind == 0
    assert "unable to attach actor: parent actor 0 not found" in message
    error, ((kind, (message,)),) = client.call("spawn_actor_with_parent", camera, ORIGIN, 0, 0)
    assert (error, kind) == (None, 0)
    assert "unable to attach actor: parent actor 0 not found" in message
    assert client.value("get_actors_by_id", list(range(1, 1000))) == before


def test_batch_answers_every_command_also_after_one_that_failed(client: RawClient) -> None:
    unknown = [[1, [999_999]]]
    malformed = [[2, [1]]]
    error, results = client.call("apply_batch", [unknown, malformed, unknown], False)
    assert error is None
    assert [kind for ((kind, _),) in results] == [0, 0, 0]


def test_spawned_actor_is_reported_though_a_command_that_follows_it_fails(
    client: RawClient,
) -> None:
    no_vehicle = [[18, [999_999, 6]]]
    spawn_command = [0, [[0, "sensor.other.imu", []], ORIGIN, [False], 0, "", [no_vehicle]]]
    _, (((kind, actor_id),),) = client.call("apply_batch", [[spawn_command]], False)
    assert kind == 1
    assert client.value("destroy_actor", actor_id) is True


NAN = float("nan")


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("set_episode_settings", [[True, False, [True, NAN], *SETTINGS[3:]]]),
        ("set_episode_settings", [[True, False, [True, 1e9], *SETTINGS[3:]]]),
        ("set_episode_settings", [[*SETTINGS[:4], NAN, *SETTINGS[5:]]]),
        ("set_actor_transform", ["V", [[NAN, 0.0, 0.0], [0.0, 0.0, 0.0]]]),
        ("set_actor_target_velocity", ["V", [float("inf"), 0.0, 0.0]]),
        ("set_weather_parameters", [[NAN] * 14]),
        ("apply_control_to_walker", ["W", [[1.0, 0.0, 0.0], NAN, False]]),
        ("apply_ackermann_control_to_vehicle", ["V", [0.0, 0.0, 5.0, NAN, 0.0]]),
        ("apply_ackermann_controller_settings", ["V", [NAN] * 6]),
    ],
)
def test_numbers_that_would_break_the_world_are_refused(
    client: RawClient, name: str, arguments: list[object]
) -> None:
    ids = {
        "V": spawn(client, "vehicle.tesla.model3", free_place(client))[0],
        "W": spawn(client, "walker.pedestrian.0001", free_place(client, 5))[0],
    }
    error, ((_, (text,)),) = client.call(name, *[ids.get(str(item), item) for item in arguments])
    assert error is None
    assert "must be" in text
    client.value("tick_cue")


@pytest.mark.parametrize(
    ("field", "value"), [(11, 0.0), (11, NAN), (1, NAN), (14, [[NAN, 1.0]]), (15, [[0.0] * 10])]
)
def test_physics_that_no_vehicle_can_have_are_refused(
    client: RawClient, field: int, value: object
) -> None:
    vehicle = spawn(client, "vehicle.tesla.model3", free_place(client))[0]
    control = client.value("get_physics_control", vehicle)
    control[field] = value
    error, ((failed, *_),) = client.call("apply_physics_control", vehicle, control)
    assert (error, failed) == (None, True)
    client.value("tick_cue")


@pytest.mark.parametrize("field", [0, 10, 14, 15])
def test_empty_lists_of_physics_leave_the_vehicle_as_it_was(client: RawClient, field: int) -> None:
    vehicle = spawn(client, "vehicle.tesla.model3", free_place(client))[0]
    before = client.value("get_physics_control", vehicle)
    client.value("apply_physics_control", vehicle, [*before[:field], [], *before[field + 1 :]])
    assert client.value("get_physics_control", vehicle) == before


def test_traffic_manager_of_a_loopback_client_is_found_at_the_loopback(
    simulator: RunningSimulator, client: RawClient
) -> None:
    assert client.value("is_traffic_manager_running", 8123) is False
    assert client.value("add_traffic_manager_running", ["192.0.2.7", 8123]) is True
    with RawClient(simulator.host, simulator.port) as other:
        assert other.value("get_traffic_manager_running", 8123) == ["127.0.0.1", 8123]
        assert other.value("add_traffic_manager_running", ["127.0.0.1", 8123]) is False


def test_traffic_manager_is_forgotten_when_its_client_is_gone(
    simulator: RunningSimulator, client: RawClient
) -> None:
    with RawClient(simulator.host, simulator.port) as owner:
        owner.value("add_traffic_manager_running", ["127.0.0.1", 8124])
        assert client.value("is_traffic_manager_running", 8124) is True
    for _ in range(1000):
        if client.value("is_traffic_manager_running", 8124) is False:
            break
    else:
        pytest.fail("the registration outlived its client")


def test_boxes_of_the_level_hold_the_heads_of_its_traffic_lights(client: RawClient) -> None:
    boxes = client.value("get_all_level_BBs", 7)
    lights = client.value("get_group_traffic_lights", 1)
    heads = [box for light in lights for box in client.value("get_light_boxes", light)]
    assert all(head in boxes for head in heads)
    assert all(box in client.value("get_all_level_BBs", 255) for box in boxes)


def test_boxes_of_the_level_hold_the_masts_of_its_traffic_lights(client: RawClient) -> None:
    boxes = [box[:3] for box in client.value("get_all_level_BBs", 6)]
    pieces = client.value("get_environment_objects", 6)
    assert [name for _, box, _, name, _ in pieces if box[:3] not in boxes] == []


def test_an_unloaded_layer_has_no_boxes(client: RawClient) -> None:
    buildings = client.value("get_all_level_BBs", 3)
    assert buildings
    client.value("unload_map_layer", 1)
    try:
        assert client.value("get_all_level_BBs", 3) == []
    finally:
        client.value("load_map_layer", 1)
    assert client.value("get_all_level_BBs", 3) == buildings


@pytest.mark.parametrize(
    ("direction", "range_m", "found"),
    [
        ([0.0, 0.0, -0.25], 9.0, True),
        ([0.0, 0.0, -4.0], 3.0, False),
        ([0.0, 0.0, 0.0], 9.0, False),
    ],
)
def test_the_length_of_a_direction_does_not_change_how_far_a_point_is_projected(
    client: RawClient, direction: list[float], range_m: float, found: bool
) -> None:
    (x, y, z), _ = free_place(client)
    is_found, _ = client.value("project_point", [x, y, z + 6.0], direction, range_m)
    assert is_found is found


def test_navigation_mesh_is_found_under_a_name_of_its_content(client: RawClient) -> None:
    (path,) = client.value("get_required_files", "Nav")
    mesh = client.value("request_file", path)
    assert struct.unpack_from("<I", mesh)[0] == 0x4D534554
    assert path.startswith("Carla/Maps/Nav/Stage01-")
    assert client.value("get_required_files", "TM") == []


def test_free_run_answers_a_tick_with_a_frame_to_come(client: RawClient) -> None:
    client.value("set_episode_settings", [False, *SETTINGS[1:]])
    frames = [client.value("tick_cue") for _ in range(3)]
    assert frames == sorted(set(frames))
    client.value("set_episode_settings", SETTINGS)


# Every call of the protocol that asks nothing of the world's content; V is a vehicle's id, W a
# walker's, L a traffic light's.
CALLS: dict[str, list[object]] = {
    "add_actor_angular_impulse": ["V", [0.0, 0.0, 1.0]],
    "add_actor_force": ["V", [1.0, 0.0, 0.0]],
    "add_actor_force_at_location": ["V", [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    "add_actor_impulse": ["V", [1.0, 0.0, 0.0]],
    "add_actor_impulse_at_location": ["V", [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    "add_actor_torque": ["V", [0.0, 0.0, 1.0]],
    "apply_ackermann_control_to_vehicle": ["V", [0.1, 0.0, 5.0, 0.0, 0.0]],
    "apply_ackermann_controller_settings": ["V", [0.1, 0.0, 0.2, 0.01, 0.0, 0.01]],
    "apply_control_to_walker": ["W", [[1.0, 0.0, 0.0], 1.2, False]],
    "are_gbuffers_enabled": ["V"],
    "blend_pose": ["W", 1.0],
    "cast_ray": [[0.0, 0.0, 5.0], [0.0, 0.0, -5.0]],
    "clear_debug_shape": [],
    "clear_debug_string": [],
    "close_vehicle_door": ["V", 6],
    "disable_actor_constant_velocity": ["V"],
    "disable_sensor_for_ros": [3],
    "enable_actor_constant_velocity": ["V", [1.0, 0.0, 0.0]],
    "enable_carsim": ["V", ""],
    "enable_environment_objects": [[1], False],
    "enable_gbuffers": ["V", True],
    "enable_sensor_for_ros": [3],
    "freeze_all_traffic_lights": [False],
    "freeze_traffic_light": ["L", False],
    "get_ackermann_controller_settings": ["V"],
    "get_actor_bone_names": ["V"],
    "get_actor_bone_relative_transforms": ["V"],
    "get_actor_bone_world_transforms": ["V"],
    "get_actor_component_names": ["V"],
    "get_actor_component_relative_transform": ["V", "x"],
    "get_actor_component_world_transform": ["V", "x"],
    "get_actor_socket_names": ["V"],
    "get_actor_socket_relative_transforms": ["V"],
    "get_actor_socket_world_transforms": ["V"],
    "get_all_level_BBs": [255],
    "get_available_maps": [],
    "get_bones_transform": ["W"],
    "get_environment_objects": [255],
    "get_gbuffer_token": ["V", 0],
    "get_group_traffic_lights": ["L"],
    "get_imui_gravity": [],
    "get_light_boxes": ["L"],
    "get_map_data": [],
    "get_names_of_all_objects": [],
    "get_navigation_mesh": [],
    "get_pose_from_animation": ["W"],
    "get_spectator": [],
    "get_vehicle_bone_world_transforms": ["V"],
    "get_weather_parameters": [],
    "get_wheel_pitch_angle": ["V", 0],
    "get_wheel_steer_angle": ["V", 0],
    "is_sensor_enabled_for_ros": [3],
    "load_map_layer": [1],
    "open_vehicle_door": ["V", 6],
    "project_point": [[0.0, 0.0, 5.0], [0.0, 0.0, -1.0], 10.0],
    "query_lights_state": ["127.0.0.1:2000"],
    "replay_file": ["never recorded", 0.0, 0.0, 0, False],
    "reset_all_traffic_lights": [],
    "reset_traffic_light_group": ["L"],
    "restore_physx_physics": ["V"],
    "send": ["V", "x"],
    "set_actor_autopilot": ["V", False],
    "set_actor_collisions": ["V", True],
    "set_actor_enable_gravity": ["V", True],
    "set_actor_location": ["V", [0.0, 0.0, 0.5]],
    "set_actor_target_angular_velocity": ["V", [0.0, 0.0, 1.0]],
    "set_actor_target_velocity": ["V", [1.0, 0.0, 0.0]],
    "set_annotations_traverse_translucency": [True],
    "set_bones_transform": ["W", [[]]],
    "set_imui_gravity": [9.81],
    "set_replayer_ignore_hero": [True],
    "set_replayer_ignore_spectator": [True],
    "set_replayer_time_factor": [1.0],
    "set_traffic_light_green_time": ["L", 9.0],
    "set_traffic_light_red_time": ["L", 2.0],
    "set_traffic_light_state": ["L", 1],
    "set_traffic_light_yellow_time": ["L", 3.0],
    "set_vehicle_light_state": ["V", [8]],
    "set_wheel_pitch_angle": ["V", 0, 0.0],
    "set_wheel_steer_direction": ["V", 0, 0.0],
    "show_recorder_actors_blocked": ["x", 1.0, 1.0],
    "show_recorder_collisions": ["x", 118, 118],
    "show_recorder_file_info": ["x", True],
    "show_vehicle_debug_telemetry": ["V", True],
    "start_recorder": ["x", True],
    "stop_recorder": [],
    "stop_replayer": [False],
    "update_day_night_cycle": ["127.0.0.1:2000", False],
    "update_lights_state": ["127.0.0.1:2000", [], False],
    "use_carsim_road": ["V", False],
}


def test_calls_of_the_protocol_are_answered_without_an_error(client: RawClient) -> None:
    vehicle = spawn(client, "vehicle.tesla.model3", free_place(client))[0]
    walker = spawn(client, "walker.pedestrian.0001", free_place(client, 5))[0]
    ids = {"V": vehicle, "W": walker, "L": 1}
    failed = {}
    for name, arguments in CALLS.items():
        error, result = client.call(name, *[ids.get(str(item), item) for item in arguments])
        if error is not None or result[0][0] not in (1, False):
            failed[name] = error or result
    assert failed == {}
    client.value("tick_cue")
