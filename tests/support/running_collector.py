"""The collector as a process of its own, and what it leaves on the server."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from carstage.server import free_port

END_S = 90.0
MISSED = "The Traffic Manager missed its cue"
GIVEN_BACK = {"synchronous": False, "step_s": None, "actors": []}


class Collector:
    """Runs the collector's process on plans; what it leaves running is ended by its id."""

    def __init__(self, port: int, folder: Path, home: Path) -> None:
        self.port = port
        self.folder = folder
        self.environment = {**os.environ, "HOME": str(home)}
        self.processes: list[subprocess.Popen[bytes]] = []

    def start(self, plan: dict[str, Any], *options: str, **streams: Any) -> subprocess.Popen[bytes]:
        plan["server"].update(port=self.port, traffic_manager_port=free_port())
        path = self.folder / f"plan{len(self.processes)}.json"
        path.write_text(json.dumps(plan))
        process = subprocess.Popen(
            [sys.executable, "-m", "carstage.collector", str(path), *options],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=self.environment,
            **streams,
        )
        self.processes.append(process)
        return process

    def run(self, plan: dict[str, Any]) -> tuple[int, list[dict[str, Any]]]:
        """Its exit status and events.

        Where the client's Traffic Manager misses its cue, an attempt is given up, which a run makes
        again. So does this: it happens about once in ten thousand steps of a busy machine.
        """
        code, events = self._run(plan)
        if any(MISSED in str(event.get("reason")) for event in events):
            for episode in plan["episodes"]:
                shutil.rmtree(episode["folder"], ignore_errors=True)
            code, events = self._run(plan)
        return code, events

    def _run(self, plan: dict[str, Any]) -> tuple[int, list[dict[str, Any]]]:
        process = self.start(plan)
        output, errors = process.communicate(timeout=END_S)
        sys.stdout.write(errors.decode() + output.decode())  # shown with a test that fails
        return process.returncode, [json.loads(line) for line in output.splitlines()]

    def await_event(self, process: subprocess.Popen[bytes], name: str) -> dict[str, Any]:
        assert process.stdout is not None
        for line in process.stdout:
            event: dict[str, Any] = json.loads(line)
            if event["event"] == name:
                return event
        raise AssertionError(f"the collector ended without an event {name}")

    def left_on_server(self) -> dict[str, Any]:
        """What a fresh client finds: settings, and actors that an episode brings along."""
        code = (
            "import carla, json, sys\n"
            "client = carla.Client('127.0.0.1', int(sys.argv[1])); client.set_timeout(20.0)\n"
            "world = client.get_world(); settings = world.get_settings()\n"
            "kinds = ('vehicle.', 'walker.', 'sensor.', 'controller.')\n"
            "actors = [a.type_id for a in world.get_actors() if a.type_id.startswith(kinds)]\n"
            "print(json.dumps([settings.synchronous_mode, settings.fixed_delta_seconds, actors]))\n"
        )
        done = subprocess.run(
            [sys.executable, "-c", code, str(self.port)],
            env=self.environment,
            capture_output=True,
            timeout=END_S,
            check=True,
        )
        synchronous, step_s, actors = json.loads(done.stdout)
        return {"synchronous": synchronous, "step_s": step_s, "actors": actors}
