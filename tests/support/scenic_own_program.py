"""Somebody's own Scenic simulation: ``HOST PORT FILE MAP XODR SEED STEP_S TICKS``.

Scenic's interface to CARLA runs as it is: it loads the map and ticks. When everybody is placed, the
ego's id and the frame of the first tick are printed, and a line on standard input is waited for.
Then it ticks at a pace that can be followed. It runs under the Python that has Scenic.
"""

from __future__ import annotations

import os
import random
import sys
import threading
from typing import Any

import numpy as np
import scenic
from scenic.simulators.carla.simulator import CarlaSimulation, CarlaSimulator

PACE_S = 0.15


def main() -> None:
    host, port, file, town, xodr, seed, step_s, ticks = sys.argv[1:]
    pace = threading.Event()

    class Paced(CarlaSimulation):
        def setup(self) -> None:
            super().setup()
            ego = self.scene.egoObject.carlaActor.id
            sys.stdout.write(f"\nready {ego} {self.current_frame - 1}\n")
            sys.stdout.flush()
            sys.stdin.readline()

        def step(self) -> None:
            super().step()
            pace.wait(PACE_S)

    class Simulator(CarlaSimulator):
        def createSimulation(self, scene: Any, *, timestep: Any, **options: Any) -> Any:  # noqa: N802
            del timestep
            return Paced(
                scene, self.client, self.tm, False, "", 1, timestep=self.timestep, **options
            )

    random.seed(int(seed))
    np.random.seed(int(seed))  # noqa: NPY002
    params = {"map": xodr, "carla_map": town, "timestep": float(step_s), "weather": "ClearNoon"}
    scenario = scenic.scenarioFromFile(file, params={**params, "render": 0}, mode2D=True)
    scene, _ = scenario.generate()
    simulator = Simulator(town, xodr, host, int(port), 120, False, timestep=float(step_s))
    simulator.simulate(scene, maxSteps=int(ticks))
    simulator.destroy()
    sys.stdout.flush()
    os._exit(0)  # the wheel may abort when its last object goes


if __name__ == "__main__":
    main()
