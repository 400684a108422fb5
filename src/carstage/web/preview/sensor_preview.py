"""Preview through a sensor: an embedded simulator and a collector, kept warm for some minutes.

The simulator starts with the first request and ends when nobody has asked for a while. A look is a
collector's plan; its log is drawn here.
"""

from __future__ import annotations

import json
import logging
import selectors
import tempfile
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

from carstage.errors import CarStageError, CollectorError, ConfigError
from carstage.sensor_kinds import known_kind, plugins_of
from carstage.web.configure.checking import ConfigChecker
from carstage.web.errors import WebError
from carstage.web.messages import PreviewPending, PreviewRequest
from carstage.web.messages.base import Document

if TYPE_CHECKING:
    from carstage.execution import CollectorProcess
    from carstage.server import EmbeddedServer
    from carstage.spec import EpisodeSpec

_IDLE_S = 240.0
_LOOK_EVERY_S = 10.0
_TURN_S = 5.0
"""How long a request waits for those before it."""
_ANSWER_S = 30.0
"""For a look at another map, which has to be loaded."""
_CALL_S = 20.0
_SHAPELESS = (360, 640)
_BUSY = "Other pictures are being made."

_log = logging.getLogger("carstage.web")


class SensorPreviewService:
    """Gives pictures, one at a time; safe to use from several threads.

    Args:
        checker: what is a valid sensor.
    """

    def __init__(self, checker: ConfigChecker) -> None:
        self._checker = checker
        self._turn = threading.Lock()
        self._lock = threading.Lock()
        self._folder = tempfile.TemporaryDirectory(prefix="carstage-preview-")
        self._server: EmbeddedServer | None = None
        self._collector: CollectorProcess | None = None
        self._starting: threading.Thread | None = None
        self._candidate: EmbeddedServer | None = None
        self._problem: CarStageError | None = None
        self._used_s = 0.0
        self._number = 0
        self._newest = 0
        self._closing = threading.Event()

    def warm(self) -> bool:
        """Begin to start the simulator, if it does not run; whether it is ready."""
        with self._lock:
            self._used_s = time.monotonic()
            if self._server is not None and self._server.alive():
                return True
            if (self._starting is None or not self._starting.is_alive()) and (
                not self._closing.is_set()
            ):
                self._starting = threading.Thread(
                    target=self._start, name="sensor preview", daemon=True
                )
                self._starting.start()
            return False

    def look(self, request: PreviewRequest) -> bytes | PreviewPending:
        """What a sensor sees, as JPEG; LiDAR and radar from above.

        A request that a newer one has overtaken while it waited is not looked at any more: whoever
        drags a sensor asks faster than pictures come. Its page asks again if it still wants it.

        Raises:
            ConfigError: the sensor is wrong.
            WebError: it sees nothing.
            CarStageError: it cannot make the picture.
        """
        spec = self._plan(request)
        if not self.warm():
            problem, self._problem = self._problem, None
            if problem is not None:
                raise problem
            return PreviewPending(state="warming", message="The simulator is starting.")
        with self._lock:
            self._newest += 1
            number = self._newest
        if not self._turn.acquire(timeout=_TURN_S):
            return PreviewPending(state="busy", message=_BUSY)
        try:
            if number != self._newest:
                return PreviewPending(state="busy", message=_BUSY)
            if self._server is None:  # it ended meanwhile, as nobody had asked
                return PreviewPending(state="warming", message="The simulator is starting.")
            return self._draw(spec, self._record(spec), request.width)
        finally:
            self._turn.release()

    def close(self) -> None:
        """End simulator and collector."""
        self._closing.set()
        if self._candidate is not None:
            self._candidate.kill()  # its first start may take minutes
        if self._starting is not None:
            self._starting.join()
        with self._turn:
            self._end()
        self._folder.cleanup()

    def _plan(self, request: PreviewRequest) -> EpisodeSpec:
        """The episode to look at: the configuration's map, weather and ego, and the one sensor."""
        from carstage.plan import plan_episodes
        from carstage.runs.servers import embedded_facts

        given = request.config
        sensor = dict(request.sensor)
        document: Document = {
            "episodes": 1,
            "vehicles": {"count": 0},
            "pedestrians": {"count": 0},
            "labels": {"cameras": []},
            "timing": {"warmup_ticks": 0},
            "rig": {"sensors": [_sized(sensor, given, request.width)]},
            **{key: given[key] for key in ("seed", "map", "weather", "ego") if key in given},
        }
        try:
            config = self._checker.parse(document)
        except ConfigError as error:
            raise _of_sensor(error) from error
        if config.sensors[0].row.viewer == "none":
            raise WebError(422, "This sensor sees nothing.", "Choose a camera, LiDAR or radar.")
        facts = embedded_facts("0.9.16")
        if config.map.choice not in facts.maps:  # a map of another server, or a random one
            document["map"] = {"choice": next(iter(facts.maps))}
            document["ego"] = {"blueprint": config.ego.blueprint}
            config = self._checker.parse(document)
        return plan_episodes(config, facts)[0]

    def _start(self) -> None:
        from carstage.server import EmbeddedServer

        server = EmbeddedServer(arguments=("--quality", "low"))
        self._candidate = server
        try:
            server.start()
        except CarStageError as error:
            self._problem = error
            return
        finally:
            self._candidate = None
        with self._lock:
            self._server = server
            self._used_s = time.monotonic()
        threading.Thread(
            target=self._end_when_idle, name="sensor preview idle", daemon=True
        ).start()

    def _end_when_idle(self) -> None:
        while not self._closing.wait(_LOOK_EVERY_S):
            with self._turn:
                if time.monotonic() - self._used_s > _IDLE_S:
                    self._end()
                    return

    def _end(self) -> None:
        collector, self._collector = self._collector, None
        if collector is not None:
            collector.kill()
            collector.__exit__(None, None, None)
        with self._lock:
            server, self._server = self._server, None
        if server is not None:
            server.stop()

    def _record(self, spec: EpisodeSpec) -> Path:
        """Have the collector look; the folder of the raw log."""
        self._number += 1
        self._used_s = time.monotonic()
        folder = Path(self._folder.name) / str(self._number)
        plan = self._plan_document(spec, folder / "raw")
        folder.mkdir()
        try:
            self._ask(plan, folder)
        except CollectorError:
            collector, self._collector = self._collector, None
            if collector is not None:
                collector.kill()
                collector.__exit__(None, None, None)
            raise
        return folder / "raw"

    def _ask(self, plan: dict[str, Any], folder: Path) -> None:
        from carstage.execution import CollectorProcess

        collector = self._collector
        if collector is None or collector.exit_code is not None:
            if collector is not None:
                collector.__exit__(None, None, None)
            collector = CollectorProcess(
                plan,
                plan_path=folder / "plan.json",
                log_path=Path(self._folder.name) / "collector.log",
                module="carstage.collector.sensor_preview",
            )
            self._collector = collector.__enter__()
        else:
            (folder / "plan.json").write_text(json.dumps(plan), "utf-8")
            collector.send_line(str(folder / "plan.json"))
        deadline_s = time.monotonic() + _ANSWER_S
        with selectors.DefaultSelector() as selector:
            selector.register(collector, selectors.EVENT_READ)
            while time.monotonic() < deadline_s and not collector.ended:
                if not selector.select(0.2):
                    continue
                for event in collector.read_events():
                    if event["event"] == "looked":
                        return
                    if event["event"] == "error":
                        raise _PreviewError(str(event.get("message")), str(event.get("hint") or ""))
        raise CollectorError("The simulator gave no picture.", "Try again.")

    def _plan_document(self, spec: EpisodeSpec, folder: Path) -> dict[str, Any]:
        assert self._server is not None
        endpoint = self._server.endpoint
        return {
            "plan_version": 1,
            "plugins": plugins_of(sensor.kind for sensor in spec.sensors),
            "server": {
                "host": endpoint.host,
                "port": endpoint.port,
                "timeout_s": _CALL_S,
                "traffic_manager_port": endpoint.traffic_manager_port,
            },
            "episodes": [
                {
                    "episode_id": "preview",
                    "attempt": "a1",
                    "folder": str(folder),
                    "spec": spec.to_json(),
                }
            ],
        }

    def _draw(self, spec: EpisodeSpec, raw: Path, width: int) -> bytes:
        import shutil

        from carstage.rawlog.tail import NewestRecords
        from carstage.web.preview.sensor_picture import sensor_picture

        sensor = spec.sensors[0]
        record = NewestRecords(raw, sensor.id).look()
        shutil.rmtree(raw.parent, ignore_errors=True)
        if record is None:
            raise CollectorError("The simulator gave no picture.", "Try again.")
        return sensor_picture(sensor, spec.dialect, record, width)


class _PreviewError(CarStageError, RuntimeError):
    """The collector could not look; it goes on."""


def _sized(sensor: Document, config: Document, width: int) -> Document:
    """The sensor with a picture of that width, in the shape of its own."""
    attributes = dict(sensor.get("attributes") or {})
    kind = known_kind(str(sensor.get("kind")))
    if kind is not None and not kind.is_camera:
        return {**sensor, "attach_to": "ego", "attach_index": 0, "rate_hz": None}
    size = attributes.get("image_size") or config.get("image_size")
    shape = (
        size
        if isinstance(size, list) and len(size) == 2 and all(type(v) is int and v > 0 for v in size)
        else [_SHAPELESS[1], _SHAPELESS[0]]
    )
    attributes.pop("image_size_x", None)
    attributes.pop("image_size_y", None)
    attributes["image_size"] = [width, min(2 * width, max(1, round(width * shape[1] / shape[0])))]
    return {
        **sensor,
        "attach_to": "ego",
        "attach_index": 0,
        "attachment": "rigid",
        "rate_hz": None,
        "attributes": attributes,
    }


def _of_sensor(error: ConfigError) -> ConfigError:
    """The same error with paths that begin at the sensor."""
    problems = tuple(
        (path[3:] if path[:3] == ("rig", "sensors", 0) else path, message, hint)
        for path, message, hint in error.problems
    )
    return ConfigError(error.message.replace("rig.sensors[0].", ""), error.hint, problems)
