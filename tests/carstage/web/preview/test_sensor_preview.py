"""Preview through a sensor: pictures of a simulator that is kept warm."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import carla
import numpy as np
import pytest
from PIL import Image

from carstage.errors import CarStageError
from carstage.server import Endpoint, RemoteServer, free_port
from carstage.spec import EpisodeSpec
from carstage.web.configure.checking import ConfigChecker
from carstage.web.errors import WebError
from carstage.web.messages import PreviewPending, PreviewRequest
from carstage.web.preview.sensor_preview import SensorPreviewService, _sized
from carstage.web.roots import Roots
from running_simulator import RunningSimulator
from sites import Site
from waiting import await_that

pytestmark = pytest.mark.end_to_end


class Borrowed:
    """The tests' simulator in place of one that is started."""

    simulator: RunningSimulator

    def __init__(self, **_: Any) -> None:
        self.endpoint = Endpoint(
            self.simulator.host, self.simulator.port, free_port(), "0.9.16", None
        )

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def alive(self) -> bool:
        return True


@pytest.fixture
def preview(
    simulator: RunningSimulator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[SensorPreviewService]:
    monkeypatch.setattr(Borrowed, "simulator", simulator, raising=False)
    monkeypatch.setattr("carstage.server.EmbeddedServer", Borrowed)
    service = SensorPreviewService(ConfigChecker(Roots((tmp_path,))))
    await_that(service.warm)
    yield service
    service.close()


def asked(config: dict[str, Any], kind: str, **sensor: Any) -> PreviewRequest:
    entry = {"id": "LOOK", "kind": kind, "pose": {"x": 1.5, "z": 1.6}, **sensor}
    return PreviewRequest(config=config, sensor=entry, width=160)


def picture(content: bytes | PreviewPending) -> Image.Image:
    assert isinstance(content, bytes)
    return Image.open(io.BytesIO(content))


def test_each_kind_of_sensor_gives_a_picture_of_what_it_sees(
    preview: SensorPreviewService, demo: dict[str, Any]
) -> None:
    front = picture(preview.look(asked(demo, "rgb")))
    assert (front.format, front.size) == ("JPEG", (160, 90))
    left = picture(preview.look(asked(demo, "rgb", pose={"z": 1.6, "yaw_deg": -90})))
    assert np.abs(np.asarray(front, int) - np.asarray(left, int)).mean() > 10
    again = picture(preview.look(asked(demo, "rgb")))
    assert np.abs(np.asarray(front, int) - np.asarray(again, int)).mean() < 10
    for kind in ("depth", "lidar", "radar"):
        assert np.asarray(picture(preview.look(asked(demo, kind)))).any(), kind
    assert not np.asarray(picture(preview.look(asked(demo, "flow")))).any()  # all stands still
    elsewhere = {**demo, "weather": {"choice": "ClearNight"}, "map": {"choice": "Atlantis"}}
    night = picture(preview.look(asked(elsewhere, "rgb")))
    assert np.asarray(night).mean() < 0.8 * np.asarray(front).mean()
    with pytest.raises(WebError, match="sees nothing"):
        preview.look(asked(demo, "imu"))


def test_of_requests_that_wait_only_the_newest_is_looked_at(
    site: Site, demo: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    del site  # it has loaded what the service imports
    looking, go_on = threading.Event(), threading.Event()
    looks: list[float] = []

    def record(_: SensorPreviewService, spec: EpisodeSpec) -> Path:
        looks.append(spec.sensors[0].pose.y_m)
        looking.set()
        assert go_on.wait(60)
        return tmp_path

    monkeypatch.setattr(SensorPreviewService, "warm", lambda *_: True)
    monkeypatch.setattr(SensorPreviewService, "_record", record)
    monkeypatch.setattr(SensorPreviewService, "_draw", lambda *_: b"picture")
    service = SensorPreviewService(ConfigChecker(Roots((tmp_path,))))
    service._server = Borrowed.__new__(Borrowed)  # type: ignore[assignment]
    with ThreadPoolExecutor(4) as pool:

        def ask(y: float) -> Future[bytes | PreviewPending]:
            asked_before = service._newest
            request = asked(demo, "rgb", pose={"y": y})
            answer = pool.submit(service.look, request)
            await_that(lambda: service._newest > asked_before)
            return answer

        first = ask(0.1)
        assert looking.wait(60)
        overtaken, newest = ask(0.2), ask(0.3)
        go_on.set()
        assert first.result() == newest.result() == b"picture"
        waited = overtaken.result()
    assert isinstance(waited, PreviewPending)
    assert waited.state == "busy"
    assert looks == [0.1, 0.3]
    service.close()


def test_while_the_simulator_starts_the_page_is_told_to_ask_again(
    site: Site, demo: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(SensorPreviewService, "warm", lambda *_: False)
    request = asked(demo, "rgb").model_dump()
    answer = site.client.post("/api/preview", json=request)
    assert (answer.status_code, answer.json()["state"]) == (202, "starting")


@pytest.mark.parametrize("sensor", [{"kind": "rgb"}, {"id": "A", "kind": "eye"}, {}])
def test_wrong_sensors_are_refused_with_the_field(
    site: Site, demo: dict[str, Any], sensor: dict[str, Any]
) -> None:
    answer = site.client.post("/api/preview", json={"config": demo, "sensor": sensor})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["path"][0] in ("id", "kind")


@pytest.fixture
def remote(simulator: RunningSimulator, demo: dict[str, Any]) -> dict[str, Any]:
    """The demonstration on a server that somebody else has started."""
    server = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    return {**demo, "server": server}


@pytest.fixture
def client(simulator: RunningSimulator) -> Iterator[Any]:
    """Somebody else's client of that server, whose world is free again at the end."""
    made = carla.Client(simulator.host, simulator.port)
    made.set_timeout(60.0)
    made.load_world("Stage01")
    yield made
    world = made.get_world()
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = False, None
    world.apply_settings(settings)
    made.load_world("Stage01")


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[SensorPreviewService]:
    service = SensorPreviewService(ConfigChecker(Roots((tmp_path,))))
    yield service
    service.close()


def looked(service: SensorPreviewService, request: PreviewRequest) -> bytes:
    """The answer when the server is ready."""
    answers: list[bytes] = []

    def look() -> bool:
        answer = service.look(request)
        if isinstance(answer, bytes):
            answers.append(answer)
        return bool(answers)

    await_that(look)
    return answers[0]


def values_of(settings: Any) -> dict[str, Any]:
    return {name: getattr(settings, name) for name in dir(settings) if not name.startswith("_")}


def test_pictures_come_from_a_server_at_an_address_which_is_given_back_as_it_was(
    elsewhere: SensorPreviewService, remote: dict[str, Any], client: Any
) -> None:
    world = client.get_world()
    settings = values_of(world.get_settings())
    assert not settings["synchronous_mode"]
    front = picture(looked(elsewhere, asked(remote, "rgb")))
    assert (front.format, front.size) == ("JPEG", (160, 90))
    assert np.asarray(picture(looked(elsewhere, asked(remote, "lidar")))).any()
    assert client.get_world().get_settings().synchronous_mode
    elsewhere.make_room("another server")
    assert client.get_world().get_settings().synchronous_mode, "it is not the one to give back"
    elsewhere.make_room(f"{remote['server']['host']}:{remote['server']['port']}")
    left = client.get_world()
    assert values_of(left.get_settings()) == settings
    assert not [a for a in left.get_actors() if a.type_id.startswith(("vehicle", "sensor"))]


def test_a_server_that_somebody_uses_is_left_alone(
    elsewhere: SensorPreviewService, remote: dict[str, Any], client: Any
) -> None:
    world = client.get_world()
    before = world.id
    blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
    car = world.spawn_actor(blueprint, world.get_map().get_spawn_points()[0])
    world.wait_for_tick()
    with pytest.raises(CarStageError, match=r"somebody else: 1 actors of others") as refused:
        looked(elsewhere, asked(remote, "rgb"))
    assert "when they have finished" in refused.value.hint
    now = client.get_world()
    assert now.id == before
    assert now.get_actor(car.id) is not None
    assert not now.get_settings().synchronous_mode
    car.destroy()


def test_who_comes_between_two_pictures_keeps_the_world(
    elsewhere: SensorPreviewService, remote: dict[str, Any], client: Any
) -> None:
    looked(elsewhere, asked(remote, "rgb"))
    world = client.load_world("Stage01", False)
    settings = world.get_settings()
    settings.synchronous_mode, settings.fixed_delta_seconds = True, 0.02
    world.apply_settings(settings)
    blueprint = world.get_blueprint_library().find("vehicle.tesla.model3")
    car = world.spawn_actor(blueprint, world.get_map().get_spawn_points()[0])
    world.tick()
    with pytest.raises(CarStageError, match="somebody else"):
        looked(elsewhere, asked(remote, "rgb"))
    elsewhere.close()
    now = client.get_world()
    assert now.id == world.id
    assert now.get_settings().fixed_delta_seconds == pytest.approx(0.02)
    assert now.get_actor(car.id) is not None


def test_a_server_that_a_run_needs_is_refused(tmp_path: Path, remote: dict[str, Any]) -> None:
    service = SensorPreviewService(ConfigChecker(Roots((tmp_path,))), lambda key: True)
    with pytest.raises(WebError, match="A run uses this server"):
        service.look(asked(remote, "rgb"))
    with pytest.raises(WebError, match="A run uses this server"):
        service.warm_for(remote["server"])
    service.close()


def test_a_server_that_does_not_answer_is_told(
    elsewhere: SensorPreviewService, demo: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    # A default is bound when the function is made: the constant's name is read no more.
    monkeypatch.setitem(RemoteServer.__init__.__kwdefaults__, "timeout_s", 1.0)
    nobody = {**demo, "server": {"kind": "remote", "port": free_port()}}
    with pytest.raises(CarStageError, match="answer"):
        looked(elsewhere, asked(nobody, "rgb"))
    elsewhere.close()  # it tries again meanwhile: as long as its patience is short


def test_a_smaller_picture_shows_what_the_lens_shows(demo: dict[str, Any]) -> None:
    numbers = {"fx": 700.0, "fy": 710.0, "cx": 650.0, "cy": 330.0}
    lens = {"model": "brown_conrady", **numbers, "k1": -0.2}
    sizes = {"image_size": [1280, 720]}, {"image_size_x": 1280, "image_size_y": 720}
    for attributes in sizes:
        sensor = {"id": "LOOK", "kind": "rgb", "attributes": attributes, "lens": lens}
        shown = _sized(sensor, demo, 320)
        assert shown["attributes"] == {"image_size": [320, 180]}
        quarters = {name: value / 4 for name, value in numbers.items()}
        assert shown["lens"] == {**lens, **quarters}
    of_the_rig = _sized({"kind": "rgb", "lens": lens}, {"image_size": [640, 640]}, 320)
    assert of_the_rig["lens"]["fy"] == 355.0
    assert "lens" not in _sized({"kind": "rgb"}, demo, 320)
