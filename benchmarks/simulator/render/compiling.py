"""How long kernels take to compile, and whether two processes share the compile cache safely.

Each runs :func:`report`: it compiles or loads all kernels, makes a picture of a small scene, and
prints its CPU seconds and a digest of the picture.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time

from benchmarks.simulator.render.scene import NO_ACTORS, plain_view
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure
from carstage_sim.cache import CACHE_VARIABLE
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.film import Film
from carstage_sim.render.picture import PictureMaker
from carstage_sim.render.scene import SceneStore
from carstage_sim.sensors.view import Camera
from carstage_sim.world.state import Weather

_COLD_FIRST_S, _COLD_ALL_S, _WARM_S = 40.0, 80.0, 4.0
_PATIENCE_S = 1500.0


def compile_figures() -> list[Figure]:
    """Two processes at once with an empty cache, then one that finds what they left."""
    slow = slowness()
    with tempfile.TemporaryDirectory(prefix="carstage-kernels-") as folder:
        cold = _processes(2, folder)
        (warm,) = _processes(1, folder)
    digests = {str(process["picture"]) for process in (*cold, warm)}
    first = min(float(process["first_rgb_s"]) for process in cold) / slow
    whole = min(float(process["all_s"]) for process in cold) / slow
    return [
        Figure("scaled_cpu_s_first_rgb_frame_cold", first, "<=", _COLD_FIRST_S),
        Figure("scaled_cpu_s_all_kernels_cold", whole, "<=", _COLD_ALL_S),
        Figure("scaled_cpu_s_all_kernels_warm", float(warm["all_s"]) / slow, "<=", _WARM_S),
        Figure("pictures_of_processes_that_share_a_cache", len(digests), "==", 1),
    ]


def _processes(count: int, folder: str) -> list[dict[str, float | str]]:
    """What processes report that run at the same time with one cache folder."""
    environment = os.environ | {CACHE_VARIABLE: folder}
    started = [
        subprocess.Popen(
            [sys.executable, "-c", f"from {__name__} import report; report()"],
            env=environment,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(count)
    ]
    answers: list[dict[str, float | str]] = []
    for process in started:
        out, _ = process.communicate(timeout=_PATIENCE_S)
        if process.returncode:
            raise RuntimeError(f"a process that compiles kernels ended with {process.returncode}")
        answers.append(json.loads(out))
    return answers


def report() -> None:
    """What a process that compiles prints, as JSON."""
    began = time.process_time()
    caster = RayCaster(1)
    view = plain_view(caster, Weather(), pole_m=2.0)
    camera = Camera(32, 24, 90.0, (-3.0, 0.0, 2.0), (-20.0, 0.0, 0.0), 0)
    picture = view.colours(camera, Film())
    first_rgb_s = time.process_time() - began
    PictureMaker(caster).warm_up(SceneStore(None, NO_ACTORS, cache=None))
    print(
        json.dumps(
            {
                "first_rgb_s": first_rgb_s,
                "all_s": time.process_time() - began,
                "picture": hashlib.sha256(picture.tobytes()).hexdigest(),
            }
        )
    )
