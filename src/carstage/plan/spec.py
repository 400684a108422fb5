"""The episode specification, version 1: all that decides the raw truth and the labels.

The JSON form is fixed in ``docs/formats/run-folder.md``; its hash is the episode's id. Nothing that
changes neither truth nor labels (paths, codecs, machine, time) may enter.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

SPEC_VERSION = 1
_ID_DIGITS = 16


@dataclass(frozen=True, slots=True)
class PoseSpec:
    """Pose of a sensor on its carrier, or on the map: CARLA's left-handed axes, m and degrees."""

    x_m: float
    y_m: float
    z_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float


@dataclass(frozen=True, slots=True)
class SensorSpec:
    """A sensor to spawn.

    Attributes:
        kind: short name such as ``rgb``.
        blueprint: CARLA's id.
        hidden: recorded for the labels only, not part of the dataset.
        labelled: a camera that gets labels.
        attributes: CARLA's attribute strings.
        attach_to: ``ego``, ``world`` or a pattern of actor types.
        attach_index: which actor of that pattern, by distance from the ego at the start.
        attachment: ``rigid``, ``follow``, ``spring_arm`` or ``spring_arm_ghost``.
        depth, instance: of a labelled camera: ids of the sensors with its pose and intrinsics.
    """

    id: str
    kind: str
    blueprint: str
    hidden: bool
    labelled: bool
    pose: PoseSpec
    attributes: Mapping[str, str]
    attach_to: str = "ego"
    attach_index: int = 0
    attachment: str = "rigid"
    depth: str | None = None
    instance: str | None = None


@dataclass(frozen=True, slots=True)
class EpisodeSpec:
    """One episode; attributes are the keys of the JSON form.

    Attributes:
        map_layers: layers of an ``_Opt`` map to load; None: all.
        steps: recorded ticks after ``warmup_ticks``; every ``save_every``-th of them is saved.
        seeds: one integer per consumer of randomness.
    """

    dialect: str
    index: int
    map: str
    map_layers: tuple[str, ...] | None
    weather: Mapping[str, Any]
    steps: int
    fps: float
    save_every: int
    warmup_ticks: int
    timing: Mapping[str, Any]
    vehicles: Mapping[str, Any]
    pedestrians: Mapping[str, Any]
    traffic: Mapping[str, Any]
    ego: Mapping[str, Any]
    scenario: Mapping[str, Any]
    sensors: tuple[SensorSpec, ...]
    labels: Mapping[str, Any]
    ground_truth: Mapping[str, bool]
    max_distance_m: float
    min_lidar_points: int
    seeds: Mapping[str, int]
    spec_version: int = SPEC_VERSION

    def to_json(self) -> dict[str, Any]:
        """The JSON form: plain dictionaries, lists, numbers and words."""
        return _plain(asdict(self))  # type: ignore[no-any-return]

    def canonical_json(self) -> bytes:
        """Sorted keys, no spaces, UTF-8, floats as Python's ``repr``: equal specs, equal bytes."""
        text = json.dumps(
            self.to_json(),
            sort_keys=True,
            separators=(",", ":"),
            ensure_ascii=False,
            allow_nan=False,
        )
        return text.encode()

    @property
    def episode_id(self) -> str:
        """First 16 hex digits of the SHA-256 of the canonical JSON."""
        return hashlib.sha256(self.canonical_json()).hexdigest()[:_ID_DIGITS]

    @property
    def saved_frames(self) -> int:
        """Number of saved frames: steps 0, n, 2n, …."""
        return -(-self.steps // self.save_every)


def _plain(value: Any) -> Any:
    """The value with lists for tuples, as it comes back from JSON."""
    if isinstance(value, Mapping):
        return {key: _plain(below) for key, below in value.items()}
    return [_plain(below) for below in value] if isinstance(value, tuple | list) else value
