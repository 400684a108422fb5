"""Preview through a sensor: a server and a collector, kept warm while somebody looks.

The server starts with the first request and ends when nobody has asked for a while: the embedded
simulator, or the CARLA of the configuration. A look is a collector's plan; its log is drawn here.
"""

from __future__ import annotations

import json
import logging
import selectors
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from carstage.errors import CarStageError, CollectorError, ConfigError
from carstage.files.scratch import Scratch
from carstage.sensor_kinds import known_kind, plugins_of
from carstage.web.configure.checking import ConfigChecker
from carstage.web.errors import WebError
from carstage.web.messages import PreviewPending, PreviewRequest
from carstage.web.messages.base import Document
from carstage.web.preview.picture_server import PictureServer, refuse_used

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.execution import CollectorProcess
    from carstage.spec import EpisodeSpec

_LOOK_EVERY_S = 10.0
_TURN_S = 5.0
"""How long a request waits for those before it."""
_ANSWER_S = 30.0
"""For a look at another map, which has to be loaded."""
_CALL_S = 20.0
_SHOWN = ("seed", "map", "weather", "ego", "server")
_USUAL_SIZE = [640, 360]
_BUSY = "Other pictures are being made."

_log = logging.getLogger("carstage.web")


class SensorPreviewService:
    """Gives pictures, one at a time; safe to use from several threads.

    Args:
        checker: what is a valid sensor.
        used_by_run: whether a run needs a server, by the key that runs tell servers apart by.
    """

    def __init__(
        self, checker: ConfigChecker, used_by_run: Callable[[str], bool] = lambda key: False
    ) -> None:
        self._checker = checker
        self._used_by_run = used_by_run
        self._turn = threading.Lock()
        self._lock = threading.Lock()
        self._folder = Scratch("carstage-preview-")
        self._server: PictureServer | None = None
        self._collector: CollectorProcess | None = None
        self._starting: threading.Thread | None = None
        self._candidate: PictureServer | None = None
        self._problem: tuple[PictureServer, CarStageError] | None = None
        self._used_s = 0.0
        self._number = 0
        self._newest = 0
        self._closing = threading.Event()

    def warm(self, config: Config | None = None) -> bool:
        """Begin to start the server of a configuration, if it does not run; whether it is ready.

        Args:
            config: whose; None: the embedded simulator.
        """
        from carstage.config import Config as AnyConfig

        wanted = AnyConfig() if config is None else config
        with self._lock:
            self._used_s = time.monotonic()
            server = self._server
            if server is not None and server.fits(wanted) and server.alive():
                return True
            if (self._starting is None or not self._starting.is_alive()) and (
                not self._closing.is_set()
            ):
                self._starting = threading.Thread(
                    target=self._start, args=(wanted,), name="sensor preview", daemon=True
                )
                self._starting.start()
            return False

    def warm_for(self, server: Document) -> bool:
        """Begin to start the server of a section ``server``; whether it is ready.

        Raises:
            ConfigError: the section is wrong.
            WebError: a run uses the server.
        """
        config = self._checker.parse({"server": server})
        self._leave_to_runs(config)
        return self.warm(config)

    def look(self, request: PreviewRequest) -> bytes | PreviewPending:
        """What a sensor sees, as JPEG; LiDAR and radar from above.

        A request that a newer one has overtaken while it waited is not looked at any more: whoever
        drags a sensor asks faster than pictures come. Its page asks again if it still wants it.

        Raises:
            ConfigError: the sensor is wrong.
            WebError: it sees nothing.
            CarStageError: it cannot make the picture.
        """
        config = self._config(request)
        self._leave_to_runs(config)
        starting = PreviewPending(state="starting", message="The simulator is starting.")
        if not self.warm(config):
            problem, self._problem = self._problem, None
            if problem is not None and problem[0].fits(config):
                raise problem[1]
            return starting
        spec = self._plan(config)
        with self._lock:
            self._newest += 1
            number = self._newest
        if not self._turn.acquire(timeout=_TURN_S):
            return PreviewPending(state="busy", message=_BUSY)
        try:
            if number != self._newest:
                return PreviewPending(state="busy", message=_BUSY)
            if self._server is None:  # it ended meanwhile: nobody had asked, or a run needs it
                return starting
            return self._draw(spec, self._record(spec), request.width)
        finally:
            self._turn.release()

    def make_room(self, key: str) -> None:
        """Give a server back that a run is about to use."""
        candidate, starting = self._candidate, self._starting
        if candidate is not None and candidate.key == key and starting is not None:
            candidate.kill()  # it holds what the run is about to use
            starting.join()
        server = self._server
        if server is None or server.key != key:
            return
        with self._turn:
            if self._server is server:
                self._end()

    def close(self) -> None:
        """End simulator and collector."""
        self._closing.set()
        if self._candidate is not None:
            self._candidate.kill()  # its first start may take minutes
        if self._starting is not None:
            self._starting.join()
        with self._turn:
            self._end()
        self._folder.remove()

    def _leave_to_runs(self, config: Config) -> None:
        key = PictureServer(config).key
        refuse_used(key is not None and self._used_by_run(key))

    def _config(self, request: PreviewRequest) -> Config:
        """What to look at: the configuration's map, weather, ego and server, and the one sensor."""
        given = request.config
        document: Document = {
            "episodes": 1,
            "vehicles": {"count": 0},
            "pedestrians": {"count": 0},
            "labels": {"cameras": []},
            "timing": {"warmup_ticks": 0},
            "rig": {"sensors": [_sized(dict(request.sensor), given, request.width)]},
            **{key: given[key] for key in _SHOWN if key in given},
        }
        ego = document.get("ego")
        if isinstance(ego, dict):  # nobody drives here
            document["ego"] = {key: value for key, value in ego.items() if key != "driver"}
        try:
            config = self._checker.parse(document)
        except ConfigError as error:
            raise _of_sensor(error) from error
        if config.sensors[0].row.viewer == "none":
            raise WebError(422, "This sensor sees nothing.", "Choose a camera, LiDAR or radar.")
        return config.without_variants()

    def _plan(self, config: Config) -> EpisodeSpec:
        """The episode to look at, on a server that runs."""
        from carstage.config.scene import Ego, MapConfig
        from carstage.plan import plan_episodes
        from carstage.runs.servers import embedded_facts

        if config.server.kind != "embedded":
            server = self._server
            if server is None or server.facts is None:
                raise CollectorError("The server was given back.", "Try again.")
            return plan_episodes(config, server.facts)[0]
        facts = embedded_facts("0.9.16")
        if config.map.choice not in facts.maps:  # a random one
            config = config.model_copy(
                update={
                    "map": MapConfig(choice=next(iter(facts.maps))),
                    "ego": Ego(blueprint=config.ego.blueprint),
                }
            )
        return plan_episodes(config, facts)[0]

    def _start(self, config: Config) -> None:
        with self._turn:
            self._end()  # what another configuration has looked at
        server = PictureServer(config)
        self._candidate = server
        try:
            server.start()
        except CarStageError as error:
            self._problem = (server, error)
            return
        finally:
            self._candidate = None
        with self._lock:
            self._server = server
            self._used_s = time.monotonic()
        threading.Thread(
            target=self._end_when_idle, args=(server,), name="sensor preview idle", daemon=True
        ).start()

    def _end_when_idle(self, server: PictureServer) -> None:
        while not self._closing.wait(_LOOK_EVERY_S):
            with self._turn:
                if self._server is not server:
                    return
                if time.monotonic() - self._used_s > server.idle_s:
                    self._end()
                    return

    def _end(self) -> None:
        self._end_collector()
        with self._lock:
            server, self._server = self._server, None
        if server is not None:
            server.stop()

    def _end_collector(self) -> None:
        """End the collector; one on a server of others is let give that back first."""
        collector, self._collector = self._collector, None
        if collector is None:
            return
        if self._server is None or not self._server.shared:
            collector.kill()
        collector.__exit__(None, None, None)

    def _record(self, spec: EpisodeSpec) -> Path:
        """Have the collector look; the folder of the raw log."""
        self._number += 1
        self._used_s = time.monotonic()
        folder = self._folder.path / str(self._number)
        plan = self._plan_document(spec, folder / "raw")
        folder.mkdir()
        try:
            self._ask(plan, folder)
        except CollectorError:
            self._end_collector()
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
                log_path=self._folder.path / "collector.log",
                python=self._server.python if self._server is not None else sys.executable,
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
        return {
            "plan_version": 1,
            "plugins": plugins_of(sensor.kind for sensor in spec.sensors),
            "server": {"timeout_s": _CALL_S, **self._server.plan()},
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
    """The sensor with a picture of that width, in its own shape."""
    attributes = dict(sensor.get("attributes") or {})
    kind = known_kind(str(sensor.get("kind")))
    if kind is not None and not kind.is_camera:
        return {**sensor, "attach_to": "ego", "attach_index": 0, "rate_hz": None}
    by_axis = [attributes.pop(axis, None) for axis in ("image_size_x", "image_size_y")]
    given = (attributes.get("image_size"), by_axis, config.get("image_size"))
    shape = next((size for size in given if _is_size(size)), _USUAL_SIZE)
    attributes["image_size"] = [width, min(2 * width, max(1, round(width * shape[1] / shape[0])))]
    lens = sensor.get("lens")
    return {
        **sensor,
        "attach_to": "ego",
        "attach_index": 0,
        "attachment": "rigid",
        "rate_hz": None,
        "attributes": attributes,
        **({"lens": _scaled(lens, shape, attributes["image_size"])} if lens else {}),
    }


def _is_size(value: Any) -> TypeGuard[list[int]]:
    return (
        isinstance(value, list) and len(value) == 2 and all(type(v) is int and v > 0 for v in value)
    )


def _scaled(lens: Any, size: list[int], shown: list[int]) -> Any:
    """A lens of pictures of one size, for those of another: it shows the same."""
    if not isinstance(lens, dict):
        return lens
    across, down = shown[0] / size[0], shown[1] / size[1]
    ratios = {"fx": across, "cx": across, "fy": down, "cy": down}
    return {
        key: value * ratios[key] if key in ratios and isinstance(value, int | float) else value
        for key, value in lens.items()
    }


def _of_sensor(error: ConfigError) -> ConfigError:
    """The same error with paths that begin at the sensor."""
    problems = tuple(
        (path[3:] if path[:3] == ("rig", "sensors", 0) else path, message, hint)
        for path, message, hint in error.problems
    )
    return ConfigError(error.message.replace("rig.sensors[0].", ""), error.hint, problems)
