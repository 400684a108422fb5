"""Specifications of episodes that nobody planned: made by hand for a measurement or a test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from carstage.spec import (
    AutopilotSpec,
    EgoSpec,
    EpisodeSpec,
    GroundTruthSpec,
    LabelsSpec,
    PedestriansSpec,
    Seeds,
    TimingSpec,
    TrafficSpec,
    VehiclesSpec,
    WeatherSpec,
)
from carstage.spec.defaults import MAX_DISTANCE_M

_POSE = dict.fromkeys(("x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg"), 0.0)


def bare_sensor(id: str, kind: str, **fields: Any) -> dict[str, Any]:
    """The JSON form of a sensor; a pose may name some of its coordinates only."""
    pose = {**_POSE, **fields.pop("pose", {})}
    return {
        "id": id, "kind": kind, "blueprint": f"sensor.{kind}", "hidden": False, "labelled": False,
        "pose": pose, "attributes": {}, "attach_to": "ego", "attach_index": 0,
        "attachment": "rigid", "depth": None, "instance": None, **fields,
    }  # fmt: skip


def bare_spec(sensors: Sequence[dict[str, Any]], **fields: Any) -> dict[str, Any]:
    """The JSON form of an episode with these sensors; ``fields`` replace sections of it."""
    spec = EpisodeSpec(
        dialect="0.9.16",
        index=0,
        map="Bare",
        map_layers=None,
        weather=WeatherSpec("ClearNoon", {}, "auto"),
        steps=1,
        fps=10.0,
        save_every=1,
        warmup_ticks=5,
        timing=TimingSpec("sync", True, 0.01, 10, "wait"),
        vehicles=VehiclesSpec(0, "vehicle.*", None),
        pedestrians=PedestriansSpec(0, "walker.pedestrian.*", None),
        traffic=TrafficSpec(),
        ego=EgoSpec("vehicle.tesla.model3", None, 0, None),
        scenario=AutopilotSpec(),
        sensors=(),
        labels=LabelsSpec(),
        ground_truth=GroundTruthSpec(),
        max_distance_m=MAX_DISTANCE_M,
        min_lidar_points=0,
        seeds=Seeds(1, 2, 3, 4, 5, 6),
    )
    document = {**spec.to_json(), "sensors": list(sensors)}
    for name, value in fields.items():
        whole = isinstance(value, dict) and isinstance(document.get(name), dict)
        document[name] = {**document[name], **value} if whole else value
    return document
