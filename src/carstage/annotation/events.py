"""Rows of ``events.parquet``: what the world's record says of the planned events.

When they began and who took part is the collector's word, in each tick of the record. How near they
came is computed here from places, boxes and velocities of the record, on the ground plane.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.boxes import LabelBox, label_box
from carstage.annotation.classes import object_class
from carstage.geometry import length, rotate, rotation_matrix
from carstage.geometry.ground_rectangles import Rectangles, distance_m, overlap, time_to_collision_s
from carstage.rawlog.reader import ActorInfo, WorldFrame
from carstage.spec import EpisodeSpec, EventSpec
from carstage.spec.story_parts import StoryPart

HAPPENED: Final = "happened"
NEVER_BEGAN: Final = "did not happen"
NOT_PLACED: Final = "not placed"


@dataclass(slots=True)
class _Story:
    """How an event went, tick by tick."""

    placed_tick: int | None = None
    begin_tick: int | None = None
    end_tick: int | None = None
    was_placed: bool = False
    reason: str = ""
    actors: tuple[int, ...] = ()
    running: list[WorldFrame] = field(default_factory=list)

    def again(self) -> _Story:
        """How it goes the next time; this time ends where it ran last."""
        if self.running:
            self.end_tick = self.running[-1].tick
        return _Story(placed_tick=self.placed_tick, was_placed=True, actors=self.actors)

    def add(self, world: WorldFrame, state: Mapping[str, Any]) -> None:
        """Take note of a tick."""
        now = state["state"]
        self.reason = state["reason"]
        if now == "waiting":
            self.placed_tick = self.begin_tick = None
            self.running.clear()
            return
        if self.placed_tick is None:
            self.placed_tick = world.tick
        self.was_placed = True
        if now in ("placed", "running"):
            self.actors = tuple(state["actors"])
        if now == "running":
            if self.begin_tick is None:
                self.begin_tick = world.tick
            self.running.append(world)
        elif now == "ended" and self.end_tick is None and self.running:
            self.end_tick = self.running[-1].tick


def event_rows(
    spec: EpisodeSpec, frames: Iterable[WorldFrame], actors: Mapping[int, ActorInfo], ego_id: int
) -> list[dict[str, Any]]:
    """One row for each planned event, in the order of the configuration or the file.

    What a storyboard has happen several times has as many rows, one after the other.

    Args:
        spec: the episode.
        frames: its ticks in order, saved or not.
        actors: everybody that the record names.
        ego_id: actor id of the ego.
    """
    planned = spec.scenario.planned_events()
    stories = [[_Story()] for _ in planned]
    for world in frames:
        for executions, state in zip(stories, world.meta["events"], strict=True):
            if state.get("execution", 1) > len(executions):
                executions.append(executions[-1].again())
            executions[-1].add(world, state)
    rows = []
    for number, execution, event, story in _executions(planned, stories):
        if story.begin_tick is not None:
            state = HAPPENED
        else:
            state = NEVER_BEGAN if story.was_placed else NOT_PLACED
        began = state == HAPPENED
        rows.append(
            {
                "event": number,
                "episode_id": spec.episode_id,
                "kind": event.kind,
                "state": state,
                "reason": None if began else story.reason,
                "placed_tick": story.placed_tick,
                "begin_tick": story.begin_tick,
                "end_tick": story.end_tick,
                "begin_s": _seconds(story.begin_tick, spec.fps),
                "end_s": _seconds(story.end_tick, spec.fps),
                "actors": list(story.actors) if began else [],
                "parameters": json.dumps(
                    {**event.parameters(), **execution}, sort_keys=True, separators=(",", ":")
                ),
                **_outcome(story, actors, ego_id, event.nearest_counts),
            }
        )
    return rows


def _executions(
    planned: Sequence[EventSpec | StoryPart], stories: Sequence[Sequence[_Story]]
) -> Iterator[tuple[int, dict[str, int], EventSpec | StoryPart, _Story]]:
    """Number and further parameters of each time that an event happened, or did not."""
    for number, (event, executions) in enumerate(zip(planned, stories, strict=True)):
        for execution, story in enumerate(executions, 1):
            counted = {"execution": execution} if isinstance(event, StoryPart) else {}
            yield number, counted, event, story


def _seconds(tick: int | None, fps: float) -> float | None:
    return None if tick is None else tick / fps


def _outcome(
    story: _Story, actors: Mapping[int, ActorInfo], ego_id: int, nearest_counts: bool
) -> dict[str, float | int | bool | None]:
    """How near the ego came to the first actor while it went on, or to the nearest of all."""
    outcome: dict[str, float | int | bool | None] = dict.fromkeys(
        ("min_distance", "min_distance_tick", "min_ttc", "min_ttc_tick", "collision",
         "ego_speed_begin", "ego_deceleration")
    )  # fmt: skip
    if not story.running:
        return outcome
    ego_row = [world.row(ego_id) for world in story.running]
    pairs = list(zip(story.running, ego_row, strict=True))
    outcome["ego_speed_begin"] = float(length(pairs[0][0].velocity[pairs[0][1]]))
    acceleration = np.array([world.acceleration[row] for world, row in pairs])
    turned = rotation_matrix(np.array([world.rotation_deg[row] for world, row in pairs]))
    along = rotate(np.swapaxes(turned, 1, 2), acceleration)[:, 0]
    outcome["ego_deceleration"] = float(max(-along.min(), 0.0))
    others = [one for one in story.actors if one != ego_id]
    counted = others if nearest_counts else others[:1]
    nearness = [_nearness(story.running, actors[ego_id], actors[one]) for one in counted]
    known = [one for one in nearness if one is not None]
    if not known:
        return outcome
    outcome["collision"] = any(one.touched for one in known)
    nearest = min(known, key=lambda one: one.distance_m)
    outcome["min_distance"], outcome["min_distance_tick"] = nearest.distance_m, nearest.tick
    soonest = min(known, key=lambda one: one.ttc_s)
    if np.isfinite(soonest.ttc_s):
        outcome["min_ttc"], outcome["min_ttc_tick"] = soonest.ttc_s, soonest.ttc_tick
    return outcome


@dataclass(frozen=True, slots=True)
class _Nearness:
    """How near the ego and another one came: the first ticks in which they were nearest."""

    distance_m: float
    tick: int
    touched: bool
    ttc_s: float
    ttc_tick: int


def _nearness(running: Sequence[WorldFrame], ego: ActorInfo, other: ActorInfo) -> _Nearness | None:
    """None where the other one was never there, or a box is not known."""
    there = [world for world in running if _is_there(world, other.id)]
    boxes = [label_box(one, object_class(one) or "") for one in (ego, other)]
    if not there or not all(box.valid for box in boxes):
        return None
    one, two = (
        rectangles(there, actor.id, box) for actor, box in zip((ego, other), boxes, strict=True)
    )
    distance, ttc = distance_m(one, two), time_to_collision_s(one, two)
    nearest, soonest = int(np.argmin(distance)), int(np.argmin(ttc))
    return _Nearness(
        float(distance[nearest]),
        there[nearest].tick,
        bool(overlap(one, two).any()),
        float(ttc[soonest]),
        there[soonest].tick,
    )


def rectangles(frames: Sequence[WorldFrame], actor_id: int, box: LabelBox) -> Rectangles:
    """Where an actor's box stood on the ground in some ticks, and how it moved.

    Args:
        frames: ticks in which it was there.
        actor_id: the actor.
        box: in its frame.
    """
    rows = [(world, world.row(actor_id)) for world in frames]
    location = np.array([world.location[row] for world, row in rows])
    rotation = rotation_matrix(np.array([world.rotation_deg[row] for world, row in rows]))
    center = location + rotate(rotation, np.broadcast_to(box.location, location.shape))
    ahead = rotation_matrix(box.rotation_deg)[:, 0]
    heading = rotate(rotation, np.broadcast_to(ahead, location.shape))[:, :2]
    return Rectangles(
        center=center[:, :2],
        heading=heading / np.sqrt(heading[:, :1] ** 2 + heading[:, 1:] ** 2),
        half=np.broadcast_to(box.extent[:2], (len(rows), 2)),
        velocity=np.array([world.velocity[row][:2] for world, row in rows]),
    )


def _is_there(world: WorldFrame, actor_id: int) -> bool:
    found: NDArray[np.bool_] = world.actor_id == actor_id
    return bool(found.any())
