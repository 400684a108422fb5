"""Scenarios of other programs, which run in processes of their own, in step with the recording.

The program asks for each step, and this process makes it. So everybody is where the program put
them in the very frame that is recorded, and no frame comes unasked.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import subprocess
import threading
import time
from queue import Empty, Full, Queue
from typing import Any, Callable, Dict, List, Optional

import carla

from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.scenario.base import Population, Scenario, scenario
from carstage.collector.scenario.traffic import TrafficDriver
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, OpenScenarioSpec, ScenicSpec

PROGRAM = os.path.join(os.path.dirname(__file__), "stepped_program.py")
COMPILE_S = 500.0
"""How long the program may take to read the map and to draw a scene."""
STEP_S = 60.0
"""How long its behaviours may take for a step."""
STEPS_TO_THE_EGO = 20
"""So many steps the program may take before it has an ego."""
END_S = 5.0
POLL_S = 0.1
MOST_LINES = 16

_log = logging.getLogger(__name__)


class ProgramProcess:
    """A running program; owns the process.

    Args:
        python: the interpreter that has what the program needs.
        order: see ``stepped_program``.
    """

    def __init__(self, python: str, order: Dict[str, Any]) -> None:
        try:
            self._process = subprocess.Popen(
                [python, PROGRAM],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                encoding="utf-8",
            )
        except OSError as error:
            raise SceneError(
                "scenario.python: %s cannot be run: %s." % (python, error),
                "Give the Python that has what the program needs.",
            ) from error
        # It waits for each step; one that writes more waits for its lines to be read.
        self._lines: Queue[str] = Queue(MOST_LINES)
        self._ends = threading.Event()
        self._reader = threading.Thread(target=self._read, name="program", daemon=True)
        self._reader.start()
        self._write(json.dumps(order))

    def made(self, frame: int) -> None:
        """Tell the program that its step was made."""
        self._write(str(frame))

    def asked(self, patience_s: float, check: Optional[Callable[[], None]] = None) -> Any:
        """Wait for the program's next request of a step.

        Args:
            patience_s: how long.
            check: called meanwhile; raises when somebody asks to end.

        Raises:
            SceneError: the program failed, or asks for nothing.
        """
        deadline_s = time.monotonic() + patience_s
        while time.monotonic() < deadline_s:
            if check is not None:
                check()
            try:
                line = self._lines.get(timeout=POLL_S)
            except Empty:
                continue
            message = json.loads(line) if line else {"event": "failed", "message": "it ended"}
            if message["event"] == "step":
                return message
            raise SceneError(
                "scenario.file: the program failed: %s." % message["message"].rstrip("."),
                "Its whole traceback is in the collector's log. Another seed draws other scenes.",
            )
        raise SceneError(
            "scenario.file: the program asked for no step for %g s." % patience_s,
            "Run it by itself to see what takes so long.",
        )

    def end(self) -> None:
        """End the process; may be called twice."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.close()
        except OSError as error:
            _log.info("the program was gone already: %s", error)
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._ends.set()
        self._reader.join(END_S)  # its pipe is closed now, unless a process of its own lives on

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as lines:
            for line in lines:
                self._put(line)
        self._put("")

    def _put(self, line: str) -> None:
        """Hand a line over, unless nobody takes lines any more."""
        while not self._ends.is_set():
            try:
                self._lines.put(line, timeout=POLL_S)
            except Full:
                continue
            return

    def _write(self, line: str) -> None:
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        except OSError as error:
            _log.info("the program takes no more lines: %s", error)  # asked() says why


class ProgramScenario(Scenario):
    """Everybody is placed and moved by a program, which has the ego, too."""

    def __init__(
        self,
        client: Any,
        session: WorldSession,
        spec: EpisodeSpec,
        server: ServerPlan,
        program: Optional[ProgramPlan] = None,
    ) -> None:
        super().__init__(client, session, spec, server, program)
        if program is None:
            raise SceneError("program: the plan does not say where it is.")
        self._plan = program
        self._driver = TrafficDriver(client, session, spec, server.traffic_manager_port)
        self._actors: List[int] = []
        self._is_asked = True
        self._ended = ""

    def populate(self, check: Callable[[], None]) -> Population:
        """Have the program place everybody.

        Raises:
            SceneError: it failed, is another one than planned, or its ego is no vehicle.
        """
        self._session.on_exit("the program's actors", self._destroy)
        self._program = ProgramProcess(self._plan.python, {**self._common(), **self._order()})
        self._session.on_exit("program", self._program.end)
        told = self._program.asked(COMPILE_S, check)
        world = self._session.world
        for _ in range(STEPS_TO_THE_EGO):
            if told["ego"] is not None:
                break
            self._program.made(world.tick())
            told = self._program.asked(COMPILE_S, check)
        self._note(told)
        if told["ego"] not in told["vehicles"]:
            raise SceneError(
                "scenario.file: the program has no ego that is a vehicle.", "Let it have one."
            )
        others = [one for one in told["vehicles"] if one != told["ego"]]
        counts = {"vehicles": len(others), "pedestrians": len(told["walkers"])}
        vehicles = [world.get_actor(one) for one in others]
        return Population(world.get_actor(told["ego"]), vehicles, [], counts, dict(counts))

    def prepare(self) -> None:
        """Start the Traffic Manager, by which the program may have vehicles driven."""
        self._driver.prepare()

    def start(self, population: Population) -> None:
        """Tell of the first step, which showed everybody."""
        super().start(population)
        self._go_on()

    def before_step(self, tick: Optional[int]) -> None:
        """Have the program act on what the last step showed."""
        del tick
        if not self._is_asked:
            self._go_on()
        self._is_asked = False

    def _go_on(self) -> None:
        self._program.made(self._session.world.get_snapshot().frame)
        told = self._program.asked(STEP_S)
        self._note(told)
        self._is_asked = True
        if told["ended"] and not self._ended:
            self._ended = told["ended"]
            _log.info("the program is over: %s; everybody stands", self._ended)

    def _note(self, told: Dict[str, Any]) -> None:
        known = set(self._actors)
        for group in ("vehicles", "walkers", "others"):
            self._actors += [one for one in told[group] if one not in known]

    def _destroy(self) -> None:
        gone = [carla.command.DestroyActor(one) for one in reversed(self._actors)]
        self._client.apply_batch_sync(gone, False)

    def _common(self) -> Dict[str, Any]:
        """What each program is told."""
        return {
            "kind": self._spec.scenario.kind,
            "host": self._server.host,
            "port": self._server.port,
            "timeout_s": self._server.timeout_s,
            "traffic_manager_port": self._server.traffic_manager_port,
            "file": self._plan.file,
            "seed": self._spec.seeds.spawn,
            "step_s": self._spec.step_s,
            "drives_ego": self._spec.ego.driver is None,
        }

    def _order(self) -> Dict[str, Any]:
        """What this one is told besides."""
        raise NotImplementedError

    def _check_program(self, planned: str) -> None:
        with open(self._plan.file, "rb") as file:
            found = "sha256:%s" % hashlib.sha256(file.read()).hexdigest()
        if found != planned:
            raise SceneError(
                "scenario.file: %s is another one than was planned with." % self._plan.file,
                "Start the run again.",
            )


@scenario("openscenario")
class OpenScenario(ProgramScenario):
    """scenario_runner plays an OpenSCENARIO file; the ego is its first ego vehicle."""

    def _order(self) -> Dict[str, Any]:
        spec = self._spec.scenario
        assert isinstance(spec, OpenScenarioSpec)
        self._check_program(spec.program)
        return {
            "scenario_runner": self._plan.scenario_runner,
            "params": dict(spec.parameters),
        }


@scenario("scenic")
class ScenicScenario(ProgramScenario):
    """A Scenic program; the ego is its ``ego``."""

    def _order(self) -> Dict[str, Any]:
        spec = self._spec.scenario
        assert isinstance(spec, ScenicSpec)
        self._check_program(spec.program)
        return {
            "mode_2d": spec.mode_2d,
            "params": {
                **spec.parameters,
                "map": self._map_file(),
                "carla_map": self._spec.map,
                "timestep": self._spec.step_s,
                "weather": None,  # this configuration's own
                "render": 0,
            },
        }

    def _map_file(self) -> str:
        """The server's own map for Scenic, which keeps what it makes of it beside the file."""
        text = self._session.map.to_opendrive().encode("utf-8")
        name = "%s-%s.xodr" % (self._spec.map, hashlib.sha256(text).hexdigest()[:16])
        path = os.path.join(self._plan.maps, name)
        if not os.path.exists(path):
            os.makedirs(self._plan.maps, exist_ok=True)
            scratch = "%s.%d" % (path, os.getpid())
            with open(scratch, "wb") as file:
                file.write(text)
            os.replace(scratch, path)
        return path
