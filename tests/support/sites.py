"""A running application, and fake runs for it."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from benchmarks.framework.bare_specs import bare_sensor, bare_spec
from carstage.runs.identity import identify
from carstage.web.app import create_app
from carstage.web.loading import load
from carstage.web.settings import WebSettings

HERE = "http://127.0.0.1:8321"


@dataclass(frozen=True)
class Site:
    """A running application."""

    client: TestClient
    root: Path
    dataset: str
    episode: str

    @property
    def episode_url(self) -> str:
        return f"/api/datasets/{self.dataset}/episodes/{self.episode}"


def open_site(root: Path, **settings: Any) -> TestClient:
    load()  # here, so that a test never meets modules that a thread of the server is importing
    return TestClient(create_app(WebSettings(roots=(root,), **settings)), base_url=HERE)


class FakeRun:
    """A folder as a run leaves it, and, for one that lives, a process that does nothing."""

    def __init__(
        self, out: Path, run_id: str, config: dict[str, Any], *, minds_signals: bool = True
    ) -> None:
        self.folder = out / "runs" / run_id
        self.folder.mkdir(parents=True)
        (out / "commits").mkdir(exist_ok=True)
        description = {"format_version": 1, "name": "fake", "created_by": "a test", "tags": []}
        (out / "dataset.json").write_text(json.dumps(description))
        # A shell may have started the tests with SIGINT ignored, which children inherit.
        handler = "SIG_DFL" if minds_signals else "SIG_IGN"
        program = f"import signal, time; signal.signal(signal.SIGINT, signal.{handler})"
        self.process = subprocess.Popen([sys.executable, "-c", f"{program}; time.sleep(600)"])
        self._status = {
            "format_version": 1,
            "run_id": run_id,
            "state": "recording",
            **identify(self.process.pid),
            "heartbeat": time.time(),
            "episodes": {"total": 2, "committed": 1, "failed": 0, "skipped": 0},
            "current": {
                "episode_id": "e2",
                "index": 1,
                "attempt": "a1",
                "ticks_done": 5,
                "ticks_total": 10,
                "frames_converted": 0,
                "frames_total": 10,
            },
            "message": None,
        }
        sensors = [
            bare_sensor("CAM", "rgb"),
            bare_sensor("CAM.depth", "depth", hidden=True),
            bare_sensor("IMU", "imu"),
            bare_sensor("TOP", "lidar"),
        ]
        spec = bare_spec(sensors, steps=10)
        plan = {
            "format_version": 1,
            "run_id": run_id,
            "config": config,
            "episodes": [{"episode_id": name, "spec": spec} for name in ("e1", "e2")],
        }
        (self.folder / "plan.json").write_text(json.dumps(plan))
        self.say()
        self.event("run_started", run_id=run_id)

    def say(self, **changes: Any) -> None:
        """Replace ``status.json``."""
        self._status.update(changes)
        temporary = self.folder / ".status"
        temporary.write_text(json.dumps(self._status))
        temporary.replace(self.folder / "status.json")

    def event(self, name: str, **fields: Any) -> None:
        with (self.folder / "events.jsonl").open("a") as events:
            events.write(json.dumps({"time": time.time(), "event": name, **fields}) + "\n")

    def end(self) -> None:
        self.process.kill()
        self.process.wait()
