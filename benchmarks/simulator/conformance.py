"""The GPU sees what the CPU sees: hits and pictures of random scenes and of towns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carstage.bench.verdict import Figure, Verdict
from carstage_sim.geometry import rotation_matrix
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps import MapCatalogue
from carstage_sim.mesh import Material, TriangleMesh, build_mesh
from carstage_sim.render.caster import Hits, RayCaster
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.device import Gpu, open_gpu
from carstage_sim.render.scene import Frame, Placement, SceneStore
from carstage_sim.sensors.measurements import ImageFrame, SensorRequest
from carstage_sim.sensors.world_sensors import WorldSensors
from carstage_sim.world.world import World

MOST_IDS = 1e-4
"""Share of pixels whose ids may differ."""
MOST_RANGES = 1e-4
"""Share of ranges that may differ by more than :func:`range_tolerance`."""
MOST_COLOURS = 0.005
"""Share of pixels that may differ by more than two of 255 codes in a channel."""
MOST_MEAN = 0.1
"""Difference of the pictures' means, in codes."""

_KINDS = ("rgb", "depth", "instance_segmentation", "normals")


def range_tolerance(range_m: NDArray[np.floating]) -> NDArray[np.float64]:
    """Metres by which a range may differ: a millimetre, far away 2e-5 of the range."""
    return np.maximum(1e-3, 2e-5 * range_m.astype(np.float64))


@dataclass(slots=True)
class Tally:
    """Counts of what was compared and of what differed."""

    rays: int = 0
    ids: int = 0
    ranges: int = 0
    pixels: int = 0
    instances: int = 0
    depths: int = 0
    normals: int = 0
    colours: int = 0
    mean: float = 0.0

    def hits(self, cpu: Hits, gpu: Hits) -> None:
        """Compare what the same rays met."""
        same = (cpu.row == gpu.row) & (cpu.triangle == gpu.triangle)
        apart = np.abs(cpu.t.astype(np.float64) - gpu.t)[same]
        self.rays += len(same)
        self.ids += int((~same).sum())
        self.ranges += int((apart > range_tolerance(cpu.t[same])).sum())

    def pictures(
        self, cpu: dict[str, NDArray[np.uint8]], gpu: dict[str, NDArray[np.uint8]]
    ) -> None:
        """Compare the pictures of one camera, by kind."""
        apart = {kind: np.abs(cpu[kind].astype(np.int16) - gpu[kind]).max(axis=-1) for kind in cpu}
        same = apart["instance_segmentation"] == 0
        depth, other = decoded_depth(cpu["depth"]), decoded_depth(gpu["depth"])
        self.pixels += same.size
        self.instances += int((~same).sum())
        self.depths += int((np.abs(depth - other) > range_tolerance(depth))[same].sum())
        self.normals += int((apart["normals"] > 1)[same].sum())
        self.colours += int((apart["rgb"] > 2).sum())
        means = cpu["rgb"].mean(axis=(0, 1)) - gpu["rgb"].mean(axis=(0, 1))
        self.mean = max(self.mean, float(np.abs(means).max()))

    def figures(self) -> tuple[Figure, ...]:
        """All shares beside their bounds."""
        rays, pixels = max(self.rays, 1), max(self.pixels, 1)
        return (
            Figure("rays", self.rays, ">=", 1),
            Figure("share_of_rays_with_other_ids", self.ids / rays, "<=", MOST_IDS),
            Figure("share_of_other_ranges", self.ranges / rays, "<=", MOST_RANGES),
            Figure("pixels", self.pixels),
            Figure("share_of_pixels_with_other_ids", self.instances / pixels, "<=", MOST_IDS),
            Figure("share_of_other_depths", self.depths / pixels, "<=", MOST_RANGES),
            Figure("share_of_other_normals", self.normals / pixels, "<=", MOST_COLOURS),
            Figure("share_of_other_colours", self.colours / pixels, "<=", MOST_COLOURS),
            Figure("largest_difference_of_mean_colours", self.mean, "<=", MOST_MEAN),
        )


def decoded_depth(pixels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Metres of a depth picture in CARLA's 24 bits."""
    code = pixels.astype(np.float64) @ np.array([65536.0, 256.0, 1.0, 0.0])
    metres: NDArray[np.float64] = code / (2**24 - 1) * 1000.0
    return metres


def random_frame(seed: int, triangles: int = 2000, instances: int = 40) -> Frame:
    """A heap of triangles, a third of them cards of leaves, with turned heaps in it."""
    rng = np.random.default_rng(seed)

    def heap(count: int, reach: float, size: float) -> TriangleMesh:
        middles = rng.uniform(-reach, reach, (count, 1, 3))
        points = (middles + rng.normal(0.0, size, (count, 3, 3))).reshape(-1, 3)
        index = np.arange(len(points)).reshape(-1, 3)
        kinds = np.array([Material.DEFAULT, Material.DEFAULT, Material.LEAVES])
        material = kinds[np.arange(count) % 3]
        return build_mesh(points, index, material, CityObjectLabel.STATIC)

    models = {"small": heap(60, 1.0, 0.4), "large": heap(300, 3.0, 0.8)}
    placements = [
        Placement(
            100 + k,
            "large" if k % 3 else "small",
            rng.uniform(-30.0, 30.0, 3),
            rotation_matrix(rng.uniform(-180.0, 180.0, 3)),
        )
        for k in range(instances)
    ]
    return SceneStore(heap(triangles, 40.0, 1.5), models.__getitem__, cache=None).frame(placements)


def compare_rays(gpu: Gpu, tally: Tally, *, seeds: Sequence[int], rays: int) -> None:
    """Cast the same rays through random scenes on both."""
    cpu, card = RayCaster(), GpuCaster(gpu)
    for seed in seeds:
        frame = random_frame(seed)
        rng = np.random.default_rng(seed)
        directions = rng.normal(size=(rays, 3)).astype(np.float32)
        origin = rng.uniform(-20.0, 20.0, 3)
        skip = int(rng.integers(-1, 5))
        tally.hits(
            cpu.cast(frame.scene, origin, directions, low=1e-3, high=200.0, skip_row=skip),
            card.cast(frame.scene, origin, directions, low=1e-3, high=200.0, skip_row=skip),
        )
    cpu.close()
    card.close()


def _cameras(
    count: int, size: tuple[int, int], spawn_points: NDArray[np.float64]
) -> Iterator[list[SensorRequest]]:
    """Requests of all kinds for cameras at spawn points, 2 m above the street."""
    places = spawn_points[np.linspace(0, len(spawn_points) - 1, count).astype(int)]
    for number, (x, y, z, _, yaw_deg, _) in enumerate(places.tolist()):
        yield [
            SensorRequest(
                1000 + number * len(_KINDS) + k,
                f"sensor.camera.{kind}",
                {"image_size_x": str(size[0]), "image_size_y": str(size[1]), "fov": "90"},
                (x, y, z + 2.0),
                (-4.0, yaw_deg, 0.0),
                0,
            )
            for k, kind in enumerate(_KINDS)
        ]


def compare_town(gpu: Gpu, tally: Tally, name: str, *, cameras: int, size: tuple[int, int]) -> None:
    """Take the same pictures of a town on both."""
    town = MapCatalogue().load(name)
    with WorldSensors(town) as cpu, WorldSensors(town, gpu=gpu) as card:
        state = World(town, 1).freeze(0.0).state
        for requests in _cameras(cameras, size, town.spawn_points):
            of_cpu, of_gpu = (
                {
                    kind: frame.pixels
                    for kind, (_, frame) in zip(
                        _KINDS, sensors.capture(state, requests), strict=True
                    )
                    if isinstance(frame, ImageFrame)
                }
                for sensors in (cpu, card)
            )
            cpu.reset()
            card.reset()
            tally.pictures(of_cpu, of_gpu)


def check_conformance(
    towns: Sequence[str], *, software: bool, cameras: int, size: tuple[int, int], seeds: int
) -> Verdict:
    """Compare both back ends.

    Args:
        towns: whose streets are looked at.
        software: take a Vulkan driver that computes on the CPU.
        cameras: in each town.
        size: of their pictures.
        seeds: random scenes.

    Raises:
        NoGpuError: there is no such card.
    """
    gpu = open_gpu(software=software)
    tally = Tally()
    compare_rays(gpu, tally, seeds=range(seeds), rays=100_000 if not software else 20_000)
    for name in towns:
        compare_town(gpu, tally, name, cameras=cameras, size=size)
    figures = (Figure("card", gpu.name), Figure("driver", gpu.driver), *tally.figures())
    return Verdict("conformance", figures, [f"towns: {', '.join(towns) or 'none'}"])
