"""The ego and the agents beside it saw one world; drones flew as they were planned."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from carstage.annotation.schema import TABLES
from carstage.dataset.ledger import saved_times_s
from carstage.dataset.reading import Episode
from carstage.errors import CarStageError
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.table_schema import require_ledger, require_rows

_SAME_M = 1e-6
"""All tables are made of the same snapshots."""
_KEYS = ("k", "track_id")
_ON_PATH_M = 0.01
"""Places have single precision: half a millimetre at 8 km from the map's origin."""


def check_fleet(episode: Episode, findings: Findings) -> None:
    """Compare what agents have with what the ego has (check ``fleet``); nothing without agents.

    Args:
        episode: as the ego's.
        findings: where problems go.
    """
    try:
        views = episode.views[1:]
        if not views:
            return
        times_s, objects = (
            saved_times_s(require_ledger(episode.ledger())),
            _places(episode.objects(), "objects.parquet"),
        )
    except CarStageError:
        return  # the checks of the ego's files say so
    for view in views:
        try:
            _check_agent(episode, view, times_s, objects, findings)
            check_flight(episode, view, findings)
        except CarStageError:
            continue  # as above, of the agent's


def _check_agent(
    episode: Episode,
    view: Episode,
    times_s: dict[int, float],
    objects: dict[tuple[int, int], Any],
    findings: Findings,
) -> None:
    name = str(view.agent_name)
    whose = f"agent {name}: "
    if view.spec != episode.spec.seen_by(name) or view.document.get("agent") != name:
        findings.add("fleet", f"{whose}its episode.json is not of this agent of the episode")
    if (
        view.id != view.document["episode_id"]
        or saved_times_s(require_ledger(view.ledger())) != times_s
    ):
        findings.add("fleet", f"{whose}it has other frames, or other times, than the ego")
    places = _places(view.objects(), "objects.parquet")
    own = _places(view.ego(), "ego.parquet", "location")
    for what, compared in (("object", places), ("agent's own track", own)):
        apart = [
            key
            for key, place in compared.items()
            if key in objects and not np.allclose(place, objects[key], rtol=0.0, atol=_SAME_M)
        ]
        if apart:
            k, track = min(apart)
            message = f"{whose}{what} {track} is elsewhere than the ego's tables say"
            findings.add("fleet", f"{message}, in {len(apart)} rows", frame=k)


def check_flight(episode: Episode, view: Episode, findings: Findings) -> None:
    """A drone is where its path is at that time, and no faster than allowed (check ``drones``).

    The place is compared on paths that do not follow the ego.

    Args:
        episode: as the ego's.
        view: as the agent's; nothing is checked where it is no drone.
        findings: where problems go.
    """
    name = str(view.agent_name)
    drone = episode.spec.agent(name).drone
    if drone is None:
        return
    spec = episode.spec
    rows = sorted(view.ego().select(["k", "location"]).to_pylist(), key=lambda row: row["k"])
    places = {row["k"]: np.array(row["location"]) for row in rows}
    apart = [
        k
        for k, place in places.items()
        if not drone.path.follows_ego
        and np.linalg.norm(place - drone.path.at(k * spec.save_every * spec.step_s).place)
        > _ON_PATH_M
    ]
    if apart:
        message = f"agent {name}: is off its path in {len(apart)} frames"
        findings.add("drones", message, frame=apart[0])
    most_m = drone.max_speed_m_s * spec.save_every * spec.step_s + _ON_PATH_M
    fast = [
        k for k in places if k + 1 in places and np.linalg.norm(places[k + 1] - places[k]) > most_m
    ]
    if fast:
        message = f"agent {name}: is faster than {drone.max_speed_m_s:g} m/s in {len(fast)} frames"
        findings.add("drones", message, frame=fast[0])


def _places(
    table: pa.Table, file: str, column: str = "actor_location"
) -> dict[tuple[int, int], Any]:
    """Places in the world (m) by frame and track."""
    require_rows(table, [c for c in TABLES[file] if c.name in (*_KEYS, column)], file)
    rows = table.select([*_KEYS, column]).to_pylist()
    return {(row["k"], row["track_id"]): row[column] for row in rows}
