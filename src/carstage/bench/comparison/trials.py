"""Every run of every program: its scene, its turn, and what came of it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from carstage.bench.comparison.presets import Experiment, Preset
from carstage.bench.comparison.programs import (
    CARSTAGE,
    DISCARD,
    FPNG,
    NATIVE,
    NUMPY,
    PROGRAMS,
    Program,
)
from carstage.bench.episodes import camera, roof_sensor

POINTS = 100_000
WARMUP_TICKS = 4
LOOP = 3
"""Distinct frames of a sensor: all of them are drawn in the warm-up."""
_OBJECT_IMAGE = (320, 180)

Key = tuple[str, str, int, int]


@dataclass(frozen=True, slots=True)
class Trial:
    """One run of one program.

    Attributes:
        experiment, program: names.
        value: what the experiment varies.
        repeat: from 0.
        frames: to record.
    """

    experiment: Experiment
    program: str
    value: int
    repeat: int
    frames: int

    @property
    def key(self) -> Key:
        """Unique in a campaign."""
        return self.experiment, self.program, self.value, self.repeat

    @property
    def labels(self) -> bool:
        """Whether every frame is labelled."""
        return self.experiment in ("frames", "objects") and self.program != DISCARD

    def document(self, preset: Preset) -> dict[str, Any]:
        """The configuration of its scene, without server and codecs."""
        sensors, size, actors = _rig(self.experiment, self.value, preset)
        labelled = self.experiment in ("frames", "objects")
        return {
            "name": "comparison",
            "seed": 7,
            "fps": preset.fps,
            "duration_s": self.frames / preset.fps,
            "image_size": list(size),
            "vehicles": {"count": actors},
            "pedestrians": {"count": actors},
            "timing": {"warmup_ticks": WARMUP_TICKS, **PROGRAMS[self.program].timing},
            "labels": {
                "cameras": ["CAM_1"] if labelled else [],
                "method": "stage_vo",
                "level_objects": [],
            },
            "ground_truth": dict.fromkeys(("vehicles", "pedestrians", "ego_motion"), labelled),
            "rig": {"sensors": sensors},
        }


@dataclass(frozen=True, slots=True)
class TrialResult:
    """What a run used, from its start until all is on the disk.

    Attributes:
        wall_s: time that passed, conversion and labels included.
        recorded_s: the same from the first tick that counts: without the start of the program,
            of the scene, and without the pictures that a repeating server first has to draw.
        cpu_s: CPU seconds of the program and all that it started.
        server_cpu_s: of the server meanwhile; NaN for one that we did not start.
        peak_mb: most resident memory of the program and all that it started, without pages of
            files.
        files, mb: what it left.
        spawned: vehicles and pedestrians that found a place.
        found: what the program itself counted, such as lost pictures.
        contents: what its first files hold; see ``contents``.
    """

    wall_s: float
    recorded_s: float
    cpu_s: float
    server_cpu_s: float
    peak_mb: float
    files: int
    mb: float
    spawned: int
    found: Mapping[str, float] = field(default_factory=dict)
    contents: Mapping[str, Any] = field(default_factory=dict)


def plan_trials(preset: Preset, experiments: Iterable[Experiment]) -> list[Trial]:
    """All runs, in their order: programs take turns at each value, first and last change places."""
    trials = []
    for repeat in range(preset.repeats):
        for experiment in experiments:
            for value in values_of(experiment, preset):
                turns = programs_of(experiment, value, preset)
                for program in turns if repeat % 2 == 0 else reversed(turns):
                    frames = _frames(experiment, value, preset, program)
                    trials.append(Trial(experiment, program.name, value, repeat, frames))
    return trials


def values_of(experiment: Experiment, preset: Preset) -> tuple[int, ...]:
    """What is varied: frames, cameras, LiDARs or vehicles."""
    if experiment == "totals":
        return preset.totals_cameras if preset.totals_frames else ()
    return {
        "frames": preset.frames,
        "cameras": preset.cameras,
        "lidars": preset.lidars,
        "objects": preset.objects,
    }[experiment]


def programs_of(experiment: Experiment, value: int, preset: Preset) -> Sequence[Program]:
    """Who is compared in an experiment."""
    names = {
        "frames": (DISCARD, NATIVE, CARSTAGE),
        "cameras": (DISCARD, NATIVE, CARSTAGE, "native-threads", FPNG, "paper"),
        "lidars": (DISCARD, "native-ply", CARSTAGE, NUMPY),
        "objects": (DISCARD, NATIVE, CARSTAGE),
        "totals": (DISCARD, CARSTAGE),
    }[experiment]
    if experiment == "cameras" and value in preset.sides:
        names += ("native-tiff", "native-jpg", "native-async", "pillow", "paper-own-png")
    return [PROGRAMS[name] for name in names]


def estimate_s(trials: Iterable[Trial], preset: Preset) -> float:
    """Rough seconds that runs take on two cores."""
    start_s = 8.0
    total = 0.0
    for trial in trials:
        program = PROGRAMS[trial.program]
        sensors = {"frames": 7, "objects": 0.2}.get(trial.experiment, trial.value)
        share = 0.3 if trial.experiment == "lidars" and not program.slow else 1.0
        pace_s = trial.frames / 10.0 if trial.experiment == "totals" else 0.0
        total += start_s + max(pace_s, trial.frames * sensors * program.seconds * share)
    return total


def _frames(experiment: Experiment, value: int, preset: Preset, program: Program) -> int:
    frames = {
        "frames": value,
        "cameras": preset.camera_frames,
        "lidars": preset.lidar_frames,
        "objects": preset.object_frames,
        "totals": preset.totals_frames,
    }[experiment]
    # The small pictures of this experiment are cheap for everybody.
    return preset.slow(frames) if program.slow and experiment != "objects" else frames


def _rig(
    experiment: Experiment, value: int, preset: Preset
) -> tuple[list[dict[str, Any]], tuple[int, int], int]:
    """Sensors, size of pictures, and how many vehicles there are."""
    size, actors = preset.image_size, preset.actors
    if experiment == "objects":
        return [camera("CAM_1")], _OBJECT_IMAGE, value
    if experiment == "lidars":
        return [_lidar(f"LIDAR_{n}", preset) for n in range(1, value + 1)], size, actors
    if experiment == "frames":
        sensors = [
            *(camera(f"CAM_{n}") for n in range(1, 5)),
            *(camera(kind.upper(), kind) for kind in ("depth", "semantic", "instance")),
            _lidar("LIDAR", preset),
            _lidar("SEMANTIC_LIDAR", preset, "semantic_lidar"),
            roof_sensor("GNSS", "gnss"),
            roof_sensor("IMU", "imu"),
        ]
        return sensors, size, actors
    return [camera(f"CAM_{n}") for n in range(1, value + 1)], size, actors


def _lidar(name: str, preset: Preset, kind: str = "lidar") -> dict[str, Any]:
    """A LiDAR whose every ray meets the ground: 100,000 points in each frame."""
    return roof_sensor(
        name,
        kind,
        channels=64,
        points_per_second=round(POINTS * preset.fps),
        range_m=200.0,
        upper_fov_deg=-2.0,
        lower_fov_deg=-25.0,
    )
