"""The real client loads maps of the user's, stand-ins for CARLA's towns, and its own OpenDRIVE."""

from __future__ import annotations

from collections.abc import Iterator

import carla
import pytest

import small_maps
from running_simulator import RunningSimulator, start_simulator, stop_simulator

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("own maps")]


@pytest.fixture(scope="module")
def server(tmp_path_factory) -> Iterator[RunningSimulator]:
    folder = tmp_path_factory.mktemp("maps")
    (folder / "Street.xodr").write_text(small_maps.parking_street())
    (folder / "Broken.xodr").write_text("<OpenDRIVE/>")
    running = start_simulator(
        tmp_path_factory.mktemp("server") / "stderr.log",
        "--exit-with-parent", "--maps", str(folder), "--map", "Street", "--alias", "Mine=Street",
    )  # fmt: skip
    yield running
    stop_simulator(running)


@pytest.fixture
def client(server: RunningSimulator) -> carla.Client:
    client = carla.Client(server.host, server.port)
    client.set_timeout(60.0)
    return client


def test_the_users_maps_are_offered_and_keep_their_names(client):
    names = {name.rsplit("/", 1)[-1] for name in client.get_available_maps()}
    assert {"Stage01", "Street", "Mine"} <= names
    world = client.load_world("Street")
    assert world.get_map().name == "Carla/Maps/Street"
    parked = world.get_environment_objects(carla.CityObjectLabel.Car)
    assert len(parked) > 5
    assert {piece.type for piece in parked} == {carla.CityObjectLabel.Car}


def test_an_alias_answers_to_the_name_that_was_asked_for(client):
    world = client.load_world("Mine")
    assert world.get_map().name == "Carla/Maps/Mine"
    assert client.reload_world().get_map().name == "Carla/Maps/Mine"


def test_a_broken_map_leaves_the_world_as_it_is(client):
    before = client.load_world("Street").id
    with pytest.raises(RuntimeError, match=r"Broken\.xodr.*no <road>"):
        client.load_world("Broken")
    with pytest.raises(RuntimeError, match="map not found"):
        client.load_world("Nowhere")
    world = client.get_world()
    assert world.id == before
    assert world.get_map().name == "Carla/Maps/Street"


def test_a_client_builds_a_world_from_its_own_opendrive(client):
    parameters = carla.OpendriveGenerationParameters(
        wall_height=1.5, enable_pedestrian_navigation=False
    )
    world = client.generate_opendrive_world(small_maps.crossing_on_two_levels(), parameters)
    assert world.get_map().name == "Carla/Maps/OpenDriveMap"
    assert world.get_environment_objects(carla.CityObjectLabel.Buildings) == []
    assert world.get_random_location_from_navigation() is None
    on_bridge = world.ground_projection(carla.Location(1.7, 1.7, 9.0), 20.0)
    assert on_bridge.location.z == pytest.approx(6.0, abs=0.05)
    below = world.ground_projection(carla.Location(1.7, 1.7, 4.0), 20.0)
    assert below.location.z == pytest.approx(0.0, abs=0.05)
    with pytest.raises(RuntimeError, match="could not be correctly parsed"):
        client.generate_opendrive_world("<OpenDRIVE/>", parameters)


def test_the_client_sees_signs_as_actors_with_their_landmarks_ids(client):
    stop = small_maps.light(5, 150, (-1, -1)).replace("1000001", "206")
    text = small_maps.document(small_maps.road(1, 0, 0, 0, 200, signals=stop))
    world = client.generate_opendrive_world(text, carla.OpendriveGenerationParameters())
    (sign,) = world.get_actors().filter("traffic.stop")
    (landmark,) = world.get_map().get_all_landmarks_of_type("206")
    assert isinstance(sign, carla.TrafficSign)
    assert sign.get_location().distance_2d(landmark.transform.location) < 0.01
    trigger = sign.get_transform().transform(sign.trigger_volume.location)
    assert 145.0 < trigger.x < 150.0
    assert trigger.y == pytest.approx(1.75, abs=0.1)


def test_a_world_is_loaded_only_if_it_is_another(client):
    first = client.load_world("Street").id
    client.load_world_if_different("Street")
    assert client.get_world().id == first
    client.load_world_if_different("Mine")
    assert client.get_world().id != first
