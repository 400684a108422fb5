"""How much is measured: the values of each experiment, ticks and repeats."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

Experiment = Literal["frames", "cameras", "lidars", "objects", "totals"]
EXPERIMENTS: Final[tuple[Experiment, ...]] = ("frames", "cameras", "lidars", "objects", "totals")

QUICK, DOCS, PAPER = "quick", "docs", "paper"


@dataclass(frozen=True, slots=True)
class Preset:
    """One size of the whole comparison.

    Attributes:
        repeats: how often every program runs at every value.
        frames: of ``frames``, for programs that are fast.
        slow_share: programs whose every picture takes long record that share of the frames: what
            counts is seconds per frame, and those would otherwise take hours.
        cameras, lidars: how many there are, and the frames that each run has.
        objects: vehicles, and as many pedestrians.
        totals_cameras, totals_frames: of the runs against a server that takes its time.
        sides: values of ``cameras`` at which the programs are run that no target names; the first
            and the last are enough for a line.
        actors: vehicles, and as many pedestrians, of all experiments but ``objects``.
        fps: simulated frames per second.
        image_size: of every camera (px).
        carla_version: which the server speaks and the client is of.
    """

    name: str
    repeats: int
    frames: tuple[int, ...]
    slow_share: float
    cameras: tuple[int, ...]
    camera_frames: int
    lidars: tuple[int, ...]
    lidar_frames: int
    objects: tuple[int, ...]
    object_frames: int
    totals_frames: int
    totals_cameras: tuple[int, ...] = (3,)
    sides: tuple[int, ...] = (1, 5)
    actors: int = 10
    fps: float = 10.0
    image_size: tuple[int, int] = (1280, 720)
    carla_version: str = "0.9.16"

    def slow(self, frames: int) -> int:
        """Frames of a program that is slow."""
        return max(2, round(frames * self.slow_share))


PRESETS: Final[dict[str, Preset]] = {
    preset.name: preset
    for preset in (
        Preset(
            QUICK,
            repeats=1,
            frames=(10, 30),
            slow_share=0.1,
            cameras=(1, 2, 3),
            camera_frames=30,
            lidars=(1, 2, 3),
            lidar_frames=40,
            objects=(0, 25, 50),
            object_frames=20,
            totals_frames=50,
            totals_cameras=(1,),
            sides=(),
        ),
        Preset(
            DOCS,
            repeats=3,
            frames=(20, 40, 80, 160),
            slow_share=0.1,
            cameras=(1, 2, 3, 4, 5),
            camera_frames=100,
            lidars=(1, 2, 3, 4, 5),
            lidar_frames=100,
            objects=(0, 25, 50, 100, 200),
            object_frames=60,
            totals_frames=600,
        ),
        Preset(
            PAPER,
            repeats=10,
            frames=(250, 500, 1000, 2000),
            slow_share=1.0,
            cameras=(1, 2, 3, 4, 5),
            camera_frames=2000,
            lidars=(1, 2, 3, 4, 5),
            lidar_frames=2000,
            objects=(0, 25, 50, 100, 200),
            object_frames=250,
            totals_frames=2000,
            sides=(1, 2, 3, 4, 5),
            actors=50,
            fps=30.0,
            carla_version="0.9.14",
        ),
    )
}
