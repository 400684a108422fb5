"""What pictures and sweeps cost on a graphics card: wall time, uploads and read-back included."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.simulator.gpu_wire import wire_figures
from benchmarks.simulator.render.scene import ReferenceScene, populate, town_of
from carstage.bench.verdict import Figure, Verdict
from carstage_sim.geometry import rotation_matrix
from carstage_sim.render.gpu.camera import GpuCameras, Shot
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.device import Gpu, open_gpu
from carstage_sim.render.gpu.passes import Product
from carstage_sim.render.motion import no_motion
from carstage_sim.render.scene import Frame
from carstage_sim.render.sky import SkyModel
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.state import Weather

_WARM_S = 2.0
_TRIES = 200
_SIZE = (1280, 720)


def _wall_ms(name: str, work: Callable[[], object], target: float | None = None) -> list[Figure]:
    """Median of wall times after the card has come up to speed, and what nine in ten stay below."""
    until = time.perf_counter() + _WARM_S
    while time.perf_counter() < until:
        work()
    spent = []
    for _ in range(_TRIES):
        begun = time.perf_counter()
        work()
        spent.append((time.perf_counter() - begun) * 1e3)
    median = statistics.median(spent)
    most = Figure(f"{name}, nine of ten", statistics.quantiles(spent, n=10)[8])
    if target is None:
        return [Figure(name, median), most]
    return [Figure(name, median, "<=", target), most]


def _shots(scene: ReferenceScene) -> list[Shot]:
    """Five cameras that look around from the scene's place."""
    width, height = _SIZE
    across = (np.arange(width) + 0.5) * (2.0 / width) - 1.0
    upwards = (1.0 - (np.arange(height) + 0.5) * (2.0 / height)) * height / width
    slopes = np.stack([np.tile(across, height), np.repeat(upwards, width)], axis=1)
    pitch, yaw, roll = scene.rotation_deg
    return [
        Shot(
            width, height, 90.0, slopes, np.asarray(scene.location),
            rotation_matrix((pitch, yaw + 72.0 * k, roll)), -1, 0.1, 1000.0,
        )
        for k in range(5)
    ]  # fmt: skip


def _sweep(count: int) -> NDArray[np.float32]:
    """Directions of 64 lasers."""
    rng = np.random.default_rng(0)
    turn, up = rng.uniform(0.0, 2 * np.pi, count), np.radians(rng.uniform(-25.0, 5.0, count))
    flat = np.cos(up)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sin(up)], 1).astype(np.float32)


def _measure(gpu: Gpu, scene: ReferenceScene, frame: Frame) -> tuple[Figure, ...]:
    caster = GpuCaster(gpu, 1)
    cameras = GpuCameras(caster)
    light = SkyModel().lighting(Weather(sun_altitude_angle=45.0), 0.0)
    shots = _shots(scene)
    still = no_motion(len(frame.actor_id))

    def pictures(products: Collection[Product], count: int = 1) -> Callable[[], object]:
        # Each camera has motions of its own, so that flow is not made together.
        at_once = 1 if Product.FLOW in products else count

        def take() -> object:
            under_way = [
                cameras.take(frame, shots[k : k + at_once], products, light, motions=still)
                for k in range(0, count, at_once)
            ]
            return [pending.pictures() for pending in under_way]

        return take

    def rays(count: int) -> Callable[[], object]:
        ways, origin = _sweep(count), np.asarray(scene.location)
        return lambda: caster.cast(frame.scene, origin, ways, low=1e-3, high=120.0, weights=False)

    colours, everything = [Product.COLOURS], list(Product)
    return (
        *_wall_ms("one camera, all outputs, ms", pictures(everything), 2.0),
        *_wall_ms("one camera, colours, ms", pictures(colours)),
        *_wall_ms("one camera, depth, ms", pictures([Product.DEPTH])),
        *_wall_ms("five cameras, all outputs, ms", pictures(everything, 5), 13.0),
        *_wall_ms("five cameras, colours, ms", pictures(colours, 5)),
        *_wall_ms("100,000 rays, ms", rays(100_000), 1.0),
        *_wall_ms("1,000,000 rays, ms", rays(1_000_000), 1.8),
    )


def measure_gpu(town_name: str, wire: Sequence[str]) -> Verdict:
    """Measure pictures and sweeps on the graphics card.

    Args:
        town_name: of the reference scene.
        wire: towns whose pictures are sent to a client.

    Raises:
        NoGpuError: there is no card.
    """
    gpu = open_gpu(software=False)
    town = town_of(town_name)
    with WorldSensors(town) as sensors:
        scene = populate(town, sensors, vehicles=70, walkers=30, seed=7)
        frame = sensors.frame_of(scene.state())
        measured = _measure(gpu, scene, frame)
    what = (
        Figure("card", gpu.name),
        Figure("driver", gpu.driver),
        Figure("triangles of the town", len(frame.static.material)),
        Figure("instances", len(frame.actor_id)),
    )
    sent = [figure for name in wire for figure in wire_figures(name)]
    notes = (f"medians of {_TRIES} times after {_WARM_S:g} s of the same work",)
    return Verdict("gpu", (*what, *measured, *sent), notes)
