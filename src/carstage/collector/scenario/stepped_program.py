"""Runs somebody else's program in steps that another process makes: Scenic, scenario_runner.

The program runs unmodified, but for this: the world is there already, and ``carla.World.tick`` asks
the process that started this one for the step. That process records, so its frames stay those of a
synchronous capture. It also owns the clock and the Traffic Manager.

This file runs by its path, under a Python with the program's packages and the ``carla`` wheel; it
imports nothing of Car-STAGE. The first line of standard input is a JSON object, the order; each
further line is the number of a frame that was made. Standard output has one JSON object a line:
``{"event": "step", "ego", "vehicles", "walkers", "others", "ended"}`` asks for a step and tells the
ids of everybody, ``{"event": "failed", "message"}`` is the last one.
"""

from __future__ import annotations

import json
import os
import random
import sys
import threading
import traceback
from typing import Any, Callable, Dict, List, Optional, Sequence, TextIO

MOST_SCENES = 20
"""So many scenes are drawn until one finds room in the world."""


class Asking:
    """Asks for steps and waits until the client shows them.

    Args:
        client: ``carla.Client``.
        output: gets the requests.
        timeout_s: how long a frame may take to show up.
    """

    def __init__(self, client: Any, output: TextIO, timeout_s: float) -> None:
        self.client = client
        self._world = client.get_world()
        self._output = output
        self._timeout_s = timeout_s
        self._changed = threading.Condition()
        self._seen = 0
        self._world.on_tick(self._on_tick)
        self.everybody: Callable[[], Sequence[Any]] = list
        self.ego: Callable[[], Optional[Any]] = lambda: None
        self.ended = ""
        self.begun = False
        self.left: List[Any] = []
        self.drives_ego = True

    def step(self) -> int:
        """Have a step made; return the number of its frame. None is made before the first scene.

        Ends this process when nobody wants further steps.
        """
        # Once this is answered, the server has got all that was sent before it.
        self.client.get_server_version()
        self.send(event="step", ended=self.ended, **self._ids())
        self.begun = True
        line = sys.stdin.readline()
        if not line:
            leave(0)
        frame = int(line)
        with self._changed:
            if not self._changed.wait_for(lambda: self._seen >= frame, self._timeout_s):
                raise RuntimeError("frame %d did not show up" % frame)
        return frame

    def send(self, **message: Any) -> None:
        """Write one line."""
        self._output.write(json.dumps(message) + "\n")
        self._output.flush()

    def _on_tick(self, snapshot: Any) -> None:
        with self._changed:
            self._seen = snapshot.frame
            self._changed.notify_all()

    def _ids(self) -> Dict[str, Any]:
        ids = {actor.id: actor.type_id for actor in (*self.everybody(), *self.left)}
        ego = self.ego()
        return {
            "ego": None if ego is None else ego.id,
            "vehicles": [one for one, name in ids.items() if name.startswith("vehicle.")],
            "walkers": [one for one, name in ids.items() if name.startswith("walker.")],
            "others": [
                one for one, name in ids.items() if not name.startswith(("vehicle.", "walker."))
            ],
        }


class Manager:
    """The Traffic Manager of the process that makes the steps, asked for when it is used.

    That process has seeded it and lets it step with the world.
    """

    def __init__(self, get: Callable[[], Any], port: int) -> None:
        self._get = get
        self._port = port

    def __getattr__(self, name: str) -> Any:
        return getattr(self._get(), name)

    def get_port(self) -> int:
        """Where it listens."""
        return self._port

    def set_synchronous_mode(self, mode: bool) -> None:
        """Nothing: it is set."""

    def set_random_device_seed(self, seed: int) -> None:
        """Nothing: it is set."""


def connected(order: Dict[str, Any], output: TextIO) -> Asking:
    """A connection by which steps are asked for from now on, whoever calls ``World.tick``."""
    import carla

    client = carla.Client(order["host"], order["port"])
    client.set_timeout(order["timeout_s"])
    asking = Asking(client, output, order["timeout_s"])
    asking.drives_ego = order["drives_ego"]
    port = order["traffic_manager_port"]
    manager = carla.Client.get_trafficmanager
    carla.World.tick = lambda world, seconds=0.0: asking.step()
    carla.World.apply_settings = lambda world, settings, seconds=0.0: 0
    carla.Client.get_trafficmanager = lambda self, _=0: Manager(lambda: manager(self, port), port)
    return asking


def run_scenic(order: Dict[str, Any], output: TextIO) -> None:
    """Draw a scene and simulate it until nobody asks for steps any more.

    Raises:
        Exception: whatever Scenic, the program or the client raises.
    """
    import carla
    import numpy as np
    import scenic
    from scenic.core.simulators import SimulationCreationError
    from scenic.domains.driving.simulators import DrivingSimulator
    from scenic.simulators.carla.simulator import CarlaSimulation, CarlaSimulator

    asking = connected(order, output)
    client = asking.client

    class Simulation(CarlaSimulation):  # type: ignore[misc]
        def __init__(self, scene: Any, **options: Any) -> None:
            asking.everybody = lambda: _actors_of(self.objects)
            asking.ego = lambda: self.scene.egoObject.carlaActor
            super().__init__(scene, client, client.get_trafficmanager(), False, "", 1, **options)

        def destroy(self) -> None:
            """Keep everybody who was recorded; a scene that found no room leaves nobody."""
            actors = _actors_of(self.objects)
            if asking.begun:
                asking.left = actors  # the objects themselves forget them now
            else:
                gone = [carla.command.DestroyActor(each.id) for each in reversed(actors)]
                client.apply_batch_sync(gone, False)

    class Simulator(CarlaSimulator):  # type: ignore[misc]
        def __init__(self) -> None:
            DrivingSimulator.__init__(self)  # CARLA's loads a map

        def createSimulation(self, scene: Any, *, timestep: Any, **options: Any) -> Any:  # noqa: N802
            return Simulation(scene, timestep=order["step_s"], **options)

    random.seed(order["seed"])
    np.random.seed(order["seed"])  # noqa: NPY002  as Scenic's own command does
    scenario = scenic.scenarioFromFile(
        order["file"], params=order["params"], mode2D=order["mode_2d"]
    )
    problem = ""
    for _ in range(MOST_SCENES):
        scene, _ = scenario.generate()
        try:
            simulation = Simulator().simulate(scene, raiseGuardViolations=True)
        except SimulationCreationError as error:
            if asking.begun:
                raise
            problem = str(error)
            continue
        if simulation is None:
            raise RuntimeError("the scene breaks a requirement of the program")
        stand(asking, str(simulation.result.terminationReason))
    raise RuntimeError("none of %d scenes found room: %s" % (MOST_SCENES, problem))


def _actors_of(objects: Sequence[Any]) -> List[Any]:
    """The actors of Scenic's objects, and the controllers of walkers."""
    actors = [each.carlaActor for each in objects if each.carlaActor is not None]
    controllers = [getattr(each, "carlaController", None) for each in objects]
    return [*actors, *(each for each in controllers if each is not None)]


def run_scenario_runner(order: Dict[str, Any], output: TextIO) -> None:
    """Have scenario_runner play an OpenSCENARIO file until nobody asks for steps any more.

    Raises:
        Exception: whatever scenario_runner or the client raises.
    """
    root = order["scenario_runner"]
    os.environ["SCENARIO_RUNNER_ROOT"] = root
    sys.path.insert(0, root)
    random.seed(order["seed"])
    import scenario_runner as runner
    from srunner.scenariomanager.carla_data_provider import CarlaDataProvider

    asking = connected(order, output)

    class Runner(runner.ScenarioRunner):  # type: ignore[misc]
        def __init__(self, arguments: Any) -> None:
            super().__init__(arguments)
            asking.everybody = lambda: _pool(CarlaDataProvider)
            asking.ego = lambda: self.ego_vehicles[0] if self.ego_vehicles else None

        def _analyze_scenario(self, config: Any) -> None:
            """The scenario is over; nobody is destroyed while the episode goes on."""
            stand(asking, "status %s" % self.manager.scenario_tree.status)

    # Called after a scenario, before it is analysed: it forgets its actors.
    cleanup = CarlaDataProvider.cleanup
    CarlaDataProvider.cleanup = lambda: _keep(asking, CarlaDataProvider, cleanup)
    runner.ScenarioRunner = Runner
    sys.argv = [
        *("scenario_runner.py", "--sync", "--host", order["host"], "--port", str(order["port"])),
        *("--timeout", str(order["timeout_s"]), "--frameRate", str(1.0 / order["step_s"])),
        *("--trafficManagerPort", str(order["traffic_manager_port"])),
        *("--openscenario", order["file"]),
    ]
    if order["params"]:
        given = ",".join("%s:%s" % pair for pair in order["params"].items())
        sys.argv += ["--openscenarioparams", given]
    runner.main()
    raise RuntimeError("scenario_runner ended before the episode; see the collector's log")


def _pool(provider: Any) -> List[Any]:
    """Everybody that scenario_runner has spawned."""
    return [actor for actor in provider._carla_actor_pool.values() if actor is not None]


def _keep(asking: Asking, provider: Any, cleanup: Callable[[], None]) -> None:
    if asking.begun and not asking.left:
        asking.left = _pool(provider)
        provider._carla_actor_pool.clear()
    cleanup()


def stand(asking: Asking, reason: str) -> None:
    """The program is over: everybody brakes and stands until the episode is.

    But not an ego that has a driver of its own.
    """
    import carla

    asking.ended = reason
    ego = None if asking.drives_ego else asking.ego()
    for actor in asking.left:
        if ego is not None and actor.id == ego.id:
            continue
        if isinstance(actor, carla.Vehicle):
            actor.apply_control(carla.VehicleControl(brake=1.0, hand_brake=True))
        elif isinstance(actor, carla.Walker):
            actor.apply_control(carla.WalkerControl())
    while True:
        asking.step()


PROGRAMS = {"scenic": run_scenic, "openscenario": run_scenario_runner}
"""By the kind of scenario."""


def leave(code: int) -> None:
    """End at once: the wheel may abort when its last object goes."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def words(error: BaseException) -> str:
    """What happened, and where in the user's program, in one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    places: List[str] = [
        "%s, line %s" % (frame.filename, frame.lineno)
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename.endswith(".scenic")
    ]
    return "%s: %s%s" % (type(error).__name__, text, " (%s)" % places[-1] if places else "")


def main() -> None:
    """Take the order, and end with this process's standard input."""
    del sys.path[0]  # this folder, whose names are not those of packages
    private = os.fdopen(os.dup(1), "w", encoding="utf-8")  # Scenic and pygame print to the other
    os.dup2(2, 1)
    order = json.loads(sys.stdin.readline())
    try:
        PROGRAMS[order["kind"]](order, private)
    except Exception as error:  # noqa: BLE001  whatever a user's program raises is told
        traceback.print_exc()
        private.write(json.dumps({"event": "failed", "message": words(error)}) + "\n")
        private.flush()
        leave(1)


if __name__ == "__main__":
    main()
