"""Preview through a sensor: pictures of a simulator that is kept warm."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from carstage.server import Endpoint, free_port
from carstage.spec import EpisodeSpec
from carstage.web.configure.checking import ConfigChecker
from carstage.web.errors import WebError
from carstage.web.messages import PreviewPending, PreviewRequest
from carstage.web.preview.sensor_preview import SensorPreviewService
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

    monkeypatch.setattr(SensorPreviewService, "warm", lambda _: True)
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
    monkeypatch.setattr(SensorPreviewService, "warm", lambda _: False)
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
