"""CPU time of cameras and LiDAR in the reference scene, and rays per pixel."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence

from benchmarks.simulator.render.scene import ReferenceScene
from carstage.bench.calibration import slowness
from carstage.bench.verdict import Figure
from carstage_sim.render.scene import top_tree
from carstage_sim.sensors.measurements import SensorRequest

ALL_CAMERAS = (
    "camera.rgb", "camera.depth", "camera.semantic_segmentation", "camera.instance_segmentation",
    "camera.normals", "camera.optical_flow",
)  # fmt: skip
"""One of each kind of camera: together all outputs."""

_TARGETS_MS = {(640, 360): 300.0, (1280, 720): 1100.0}
_LIDAR = {
    "channels": 64, "points_per_second": 2_000_000, "rotation_frequency": 20, "range": 100,
    "upper_fov": 10, "lower_fov": -30,
}  # fmt: skip
_LIDAR_MS = 90.0
_TOP_MS = 1.0
_MOST_MORE = 0.05
_PAIRS_PER_TRY = 2


def speed_figures(scene: ReferenceScene, *, tries: int) -> list[Figure]:
    """The lines of the budget, scaled by how slow the machine is; kernels are compiled before."""
    figures: list[Figure] = []
    for (width, height), target_ms in _TARGETS_MS.items():
        figures += _of_cameras(scene, width, height, target_ms, tries)
    figures += _of_shared_casts(scene, tries)
    lidar = [scene.request("lidar.ray_cast_semantic", 50, **_LIDAR)]
    lidar_ms = _scaled_ms(scene, lidar, tries)
    figures.append(Figure("scaled_cpu_ms_lidar_of_100k_rays", lidar_ms, "<=", _LIDAR_MS))
    frame = scene.sensors.frame_of(scene.state())
    drawn, bounds = frame.scene, frame.bounds
    slow = slowness()
    top_ms = _cpu_ms(lambda: top_tree(drawn.rotation, drawn.position, bounds), 9) / slow
    figures.append(Figure("scaled_cpu_ms_top_level_rebuild", top_ms, "<=", _TOP_MS))
    figures.append(Figure("machine_slowness", slow))
    return figures


def picture_ms(scene: ReferenceScene) -> float:
    """CPU milliseconds of one colour picture."""
    request = scene.request("camera.rgb", image_size_x=640, image_size_y=360)
    return _capture_ms(scene, [request], 1)


def _of_cameras(
    scene: ReferenceScene, width: int, height: int, target_ms: float, tries: int
) -> list[Figure]:
    """All outputs of one pose, and colour alone."""
    name = f"{width}x{height}"
    size = {"image_size_x": width, "image_size_y": height}
    requests = [scene.request(kind, n, **size) for n, kind in enumerate(ALL_CAMERAS)]
    colour_ms = _scaled_ms(scene, requests[:1], tries)
    rays = scene.sensors.last_ray_count / (width * height)
    whole_ms = _scaled_ms(scene, requests, tries)
    return [
        Figure(f"scaled_cpu_ms_rgb_{name}", colour_ms),
        Figure(f"scaled_cpu_ms_all_outputs_{name}", whole_ms, "<=", target_ms),
        Figure(f"camera_rays_per_pixel_{name}", rays),
    ]


def _of_shared_casts(scene: ReferenceScene, tries: int) -> list[Figure]:
    """What a second sensor of the same pose costs, as a share of the first one's picture.

    The median of pairs that are measured in turn: what others take of the machine's caches in one
    picture is of the size of the target.
    """
    size = {"image_size_x": 640, "image_size_y": 360}
    requests = [scene.request(kind, n, **size) for n, kind in enumerate(ALL_CAMERAS)]
    figures = []
    for request in requests[1:]:
        ratios = []
        for _ in range(_PAIRS_PER_TRY * tries):
            both = _capture_ms(scene, [requests[0], request], 1)
            ratios.append(both / _capture_ms(scene, requests[:1], 1))
        kind = request.type_id.split(".")[-1]
        more = statistics.median(ratios) - 1.0
        figures.append(Figure(f"more_for_{kind}_of_the_same_pose", more, "<=", _MOST_MORE))
    return figures


def _scaled_ms(scene: ReferenceScene, requests: Sequence[SensorRequest], tries: int) -> float:
    """CPU time over how slow the machine is right before and after: it changes by the minute."""
    before = slowness()
    least = _capture_ms(scene, requests, tries)
    return least / (0.5 * (before + slowness()))


def _capture_ms(scene: ReferenceScene, requests: Sequence[SensorRequest], tries: int) -> float:
    # Once before: a first flow is that of nothing.
    scene.sensors.capture(scene.state(), requests)
    states = [scene.state() for _ in range(tries)]
    return _cpu_ms(lambda: scene.sensors.capture(states.pop(0), requests), tries)


def _cpu_ms(work: Callable[[], object], tries: int) -> float:
    """Least CPU time of several tries: what others take of the caches is not ours."""
    best = float("inf")
    for _ in range(tries):
        began = time.process_time()
        work()
        best = min(best, time.process_time() - began)
    return best * 1e3
