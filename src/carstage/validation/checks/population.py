"""Label statistics that make a set suspicious: nobody there, nobody seen, nobody moving."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow.compute as pc

from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables

MIN_SPAWNED_SHARE = 0.8
MOVED_M = 0.5
MIN_DURATION_S = 2.0
MIN_VEHICLES = 3
MIN_VISIBLE_ROWS = 20
MOST_OCCLUDED_SHARE = 0.95
_LARGELY = 2


@dataclass(slots=True)
class Population:
    """Who is in the episodes so far, and who of them is seen.

    Attributes:
        wanted: episodes that asked for vehicles, for pedestrians, and for their labels.
        seen: rows of visible objects, likewise.
        visible: rows of visible objects whose occlusion by pixels is known.
        largely_occluded: those of them that are largely occluded.
        seconds: simulated time of episodes in which the ego should drive.
        ego_moved: whether it moved in one of them.
        cameras: number of labelled cameras, over the episodes.
    """

    wanted: dict[str, int]
    seen: dict[str, int]
    visible: int = 0
    largely_occluded: int = 0
    seconds: float = 0.0
    ego_moved: bool = False
    cameras: int = 0

    @classmethod
    def empty(cls) -> Population:
        """Before the first episode."""
        return cls({"vehicles": 0, "pedestrians": 0}, {"vehicles": 0, "pedestrians": 0})

    def add(self, other: Population) -> None:
        """Add the counts of other episodes."""
        for group in self.wanted:
            self.wanted[group] += other.wanted[group]
            self.seen[group] += other.seen[group]
        self.visible += other.visible
        self.largely_occluded += other.largely_occluded
        self.seconds += other.seconds
        self.ego_moved |= other.ego_moved
        self.cameras += other.cameras

    def to_dict(self) -> dict[str, Any]:
        """For the report."""
        return {
            "visible_vehicle_labels": self.seen["vehicles"],
            "visible_pedestrian_labels": self.seen["pedestrians"],
            "largely_occluded_share": (
                round(self.largely_occluded / self.visible, 4) if self.visible else None
            ),
        }


def check_episode_population(
    episode: Episode, tables: LabelTables, population: Population, findings: Findings
) -> None:
    """Count an episode, and warn of what is suspicious in it alone.

    Args:
        episode: the episode.
        tables: its label tables.
        population: counts over the dataset, added to.
        findings: checks ``population``, ``no_objects``, ``frozen_traffic``; warnings.
    """
    spec, document = episode.spec, episode.document
    cameras = sum(sensor.calibration.labelled for sensor in episode.sensors)
    for group in ("vehicles", "pedestrians"):
        asked, spawned = int(document["requested"][group]), int(document["spawned"][group])
        population.wanted[group] += bool(asked and getattr(spec.ground_truth, group) and cameras)
        if spawned < MIN_SPAWNED_SHARE * asked:
            _warn(findings, "population", f"{spawned} of {asked} {group} could be placed")
    actors = tables.objects.filter(~may_come_back(tables.objects))
    tracks: list[Any] = actors["track_id"].to_pylist()
    names: list[Any] = actors["class"].to_pylist()
    classes: dict[int, str] = dict(zip(tracks, names, strict=True))
    table = tables.camera_objects
    chosen = pc.is_in(table["track_id"], value_set=actors["track_id"].combine_chunks())
    visible = table.filter(pc.and_(table["visible"], chosen))
    seen: list[Any] = visible["track_id"].to_pylist()
    for track in seen:
        walks = classes.get(track, "").startswith("walker")
        population.seen["pedestrians" if walks else "vehicles"] += 1
    levels = visible["occluded_px"].drop_null().to_numpy()
    population.visible += len(levels)
    population.largely_occluded += int((levels >= _LARGELY).sum())
    population.cameras += cameras
    others = sum(int(document["spawned"][group]) for group in ("vehicles", "pedestrians")
                 if getattr(spec.ground_truth, group))  # fmt: skip
    if cameras and others and not visible.num_rows:
        _warn(findings, "no_objects", f"none of {others} road users is ever seen")
    _check_traffic(episode, tables, population, findings)


def _check_traffic(
    episode: Episode, tables: LabelTables, population: Population, findings: Findings
) -> None:
    seconds = episode.frames / episode.spec.saved_fps
    objects = tables.objects.filter(~may_come_back(tables.objects))
    columns = (objects[name].to_pylist() for name in ("track_id", "class", "is_ego"))
    places = np.array(objects["actor_location"].to_pylist(), np.float64).reshape(-1, 3)
    first: dict[int, Any] = {}
    moved: dict[int, bool] = {}
    ego_moved = False
    for track, kind, is_ego, place in zip(*columns, places, strict=True):
        far = bool(np.abs(place - first.setdefault(track, place)).max() > MOVED_M)
        if is_ego:
            ego_moved |= far
        elif not kind.startswith("walker"):
            moved[track] = moved.get(track, False) or far
    if seconds >= MIN_DURATION_S and len(moved) >= MIN_VEHICLES and not any(moved.values()):
        _warn(
            findings,
            "frozen_traffic",
            f"none of {len(moved)} vehicles moves by {MOVED_M} m in {seconds:g} s",
        )
    if episode.spec.ground_truth.vehicles:
        population.seconds += seconds
        population.ego_moved |= ego_moved


def check_population(population: Population, findings: Findings) -> None:
    """Warn of what is suspicious over all episodes.

    Checks ``no_vehicles``, ``no_pedestrians``, ``all_occluded``, ``ego_still``.
    """
    for group in ("vehicles", "pedestrians"):
        if population.wanted[group] and not population.seen[group]:
            _warn(
                findings,
                f"no_{group}",
                f"{population.wanted[group]} episodes asked for {group}, and none is ever seen",
            )
    if (
        population.visible >= MIN_VISIBLE_ROWS
        and population.largely_occluded > MOST_OCCLUDED_SHARE * population.visible
    ):
        _warn(
            findings,
            "all_occluded",
            f"{population.largely_occluded} of {population.visible} labels of visible objects are "
            "largely occluded",
        )
    if population.seconds >= MIN_DURATION_S and not population.ego_moved:
        _warn(
            findings, "ego_still", f"the ego moves in no episode, {population.seconds:g} s in all"
        )


def _warn(findings: Findings, check: str, message: str) -> None:
    findings.add(check, message, severity="warning")
