"""The table of events against the plan, the ledger and the labels of those who took part."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from carstage.annotation.events import HAPPENED, NEVER_BEGAN, NOT_PLACED
from carstage.annotation.schema import EVENT_COLUMNS, EVENTS
from carstage.dataset.reading import Episode
from carstage.geometry import FloatArray, rotation_matrix
from carstage.geometry.ground_rectangles import (
    Rectangles,
    distance_m,
    overlap,
    time_to_collision_s,
)
from carstage.spec import EventSpec
from carstage.spec.story_parts import StoryPart
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.recomputing import entries, numbers, rows_at
from carstage.validation.checks.table_schema import require_rows

_SMALL = 1e-6
_DISTANCE_M = 0.02
_TTC_S, _TTC_SHARE = 0.02, 0.02


def check_events(
    episode: Episode, ledger: pa.Table, tables: LabelTables, findings: Findings
) -> None:
    """Recompute ``events.parquet`` as far as the labels tell (check ``events``).

    Args:
        episode: the episode.
        ledger: its ticks.
        tables: its labels.
        findings: where differences go.
    """
    planned = episode.spec.scenario.planned_events()
    table = episode.events()
    if table is None:
        return
    require_rows(table, EVENT_COLUMNS, EVENTS)
    rows = table.to_pylist()
    if set(entries(table, "episode_id")) - {episode.id}:
        findings.add("events", "episode_id of events.parquet is not the episode's")
    if not _are_planned(rows, planned):
        findings.add("events", "events.parquet does not list the events that were planned")
        return
    saved = {
        tick: k
        for tick, k in zip(entries(ledger, "tick"), entries(ledger, "k"), strict=True)
        if k is not None
    }
    for row in rows:
        for problem in _times(row, episode):
            findings.add("events", f"event {row['event']}: {problem}")
        if row["begin_tick"] is not None:
            last = episode.spec.steps - 1 if row["end_tick"] is None else row["end_tick"]
            frames = [saved[tick] for tick in range(row["begin_tick"], last + 1) if tick in saved]
            every_tick = len(frames) == last + 1 - row["begin_tick"]
            nearest_counts = planned[row["event"]].nearest_counts
            for problem in _outcome(row, nearest_counts, frames, every_tick, tables):
                findings.add("events", f"event {row['event']}: {problem}")


def _are_planned(
    rows: Sequence[Mapping[str, Any]], planned: Sequence[EventSpec | StoryPart]
) -> bool:
    """Whether rows are those of the planned events; those of a storyboard may happen again."""
    found: list[list[dict[str, Any]]] = [[] for _ in planned]
    for row in rows:
        if not 0 <= row["event"] < len(planned) or row["kind"] != planned[row["event"]].kind:
            return False
        found[row["event"]].append(json.loads(row["parameters"]))
    if [row["event"] for row in rows] != sorted(row["event"] for row in rows):
        return False
    for event, given in zip(planned, found, strict=True):
        asked = [event.parameters()]
        if isinstance(event, StoryPart):
            count = min(max(len(given), 1), event.most)
            asked = [{**event.parameters(), "execution": number} for number in range(1, count + 1)]
        if given != asked:
            return False
    return True


def _times(row: Mapping[str, Any], episode: Episode) -> list[str]:
    """What is wrong with when it was."""
    placed, begin, end = row["placed_tick"], row["begin_tick"], row["end_tick"]
    states: tuple[str, ...] = (HAPPENED,)
    if begin is None:
        states = (NEVER_BEGAN,) if placed is not None else (NEVER_BEGAN, NOT_PLACED)
    if row["state"] not in states:
        return [f"its state is {row['state']}, it was placed at {placed} and began at {begin}"]
    if (row["reason"] is None) != (begin is not None):
        return ["it has a reason though it happened, or none though it did not"]
    given = [tick for tick in (placed, begin, end) if tick is not None]
    if given != sorted(given) or any(not 0 <= tick < episode.spec.steps for tick in given):
        return [f"its ticks {given} are no order of ticks of the episode"]
    return [
        f"{name} is {seconds} s at tick {tick}"
        for name, tick, seconds in (("begin", begin, row["begin_s"]), ("end", end, row["end_s"]))
        if (tick is None) != (seconds is None)
        or (tick is not None and abs(seconds - tick / episode.spec.fps) > _SMALL)
    ]


def _outcome(
    row: Mapping[str, Any],
    nearest_counts: bool,
    frames: Sequence[int],
    every_tick: bool,
    tables: LabelTables,
) -> list[str]:
    """What is wrong with how near they came, by the boxes of the saved frames."""
    objects = tables.objects.filter(pc.is_valid(tables.objects["box_center"]))
    if not row["actors"]:
        return ["nobody took part"]
    of_ego = objects.filter(objects["is_ego"])
    actors = [one for one in row["actors"] if one not in set(entries(of_ego, "track_id"))]
    if not actors:
        return [] if row["min_distance"] is None else ["a distance, though only the ego took part"]
    ego = _boxes(of_ego, frames)
    least_m, soonest_s, touched, complete = np.inf, np.inf, False, every_tick
    for actor_id in actors if nearest_counts else actors[:1]:
        actor = _boxes(objects.filter(pc.equal(objects["track_id"], pa.scalar(actor_id))), frames)
        shared = sorted(ego.keys() & actor.keys())
        if not shared:
            return []  # labels of other road users, or of that box, were not asked for
        one, other = (_stacked([boxes[k] for k in shared]) for boxes in (ego, actor))
        least_m = min(least_m, float(distance_m(one, other).min()))
        soonest_s = min(soonest_s, float(time_to_collision_s(one, other).min()))
        touched = touched or bool(overlap(one, other).any())
        complete = complete and len(shared) == len(frames)
    wrong = []
    if row["min_distance"] is None:
        return [f"no smallest distance; by the labels it is {least_m:.3f} m"]
    if row["min_distance"] > least_m + _DISTANCE_M or (
        complete and row["min_distance"] < least_m - _DISTANCE_M
    ):
        wrong.append(f"smallest distance {row['min_distance']:.3f} m; by labels {least_m:.3f} m")
    clear = abs(least_m) > _DISTANCE_M or touched
    if clear and ((touched and not row["collision"]) or (complete and row["collision"] != touched)):
        wrong.append(f"collision is {row['collision']}; by the boxes of the labels {touched}")
    recorded_s = np.inf if row["min_ttc"] is None else row["min_ttc"]
    allowed_s = _TTC_S + _TTC_SHARE * min(soonest_s, 1e6)
    if recorded_s > soonest_s + allowed_s or (complete and recorded_s < soonest_s - allowed_s):
        wrong.append(f"smallest time to collision {recorded_s:.3f} s; by labels {soonest_s:.3f} s")
    return wrong


_Box = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


def _boxes(objects: pa.Table, frames: Sequence[int]) -> dict[int, _Box]:
    """Centre, heading, half sizes and velocity on the ground of one object, by frame."""
    wanted = set(frames)
    kept = rows_at(objects, [i for i, k in enumerate(entries(objects, "k")) if k in wanted])
    ahead = rotation_matrix(numbers(kept, "box_rotation_deg", 3))[:, :2, 0]
    heading = ahead / np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    columns = (
        numbers(kept, "box_center", 3)[:, :2],
        heading,
        numbers(kept, "box_extent", 3)[:, :2],
        numbers(kept, "velocity", 3)[:, :2],
    )
    return {k: (a, b, c, d) for k, a, b, c, d in zip(entries(kept, "k"), *columns, strict=True)}


def _stacked(boxes: Sequence[_Box]) -> Rectangles:
    return Rectangles(*(np.stack(parts) for parts in zip(*boxes, strict=True)))
