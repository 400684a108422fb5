"""The ego and the agents beside it saw one world: the same frames, everybody at the same places."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from carstage.dataset.ledger import saved_times_s
from carstage.dataset.reading import Episode
from carstage.errors import CarStageError
from carstage.validation.checks.findings import Findings

_SAME_M = 1e-6
"""All tables are made of the same snapshots."""
_KEYS = ("k", "track_id")


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
        times_s, objects = saved_times_s(episode.ledger()), _places(episode.objects())
    except CarStageError:
        return  # the checks of the ego's files say so
    for view in views:
        try:
            _check_agent(episode, view, times_s, objects, findings)
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
    if view.id != view.document["episode_id"] or saved_times_s(view.ledger()) != times_s:
        findings.add("fleet", f"{whose}it has other frames, or other times, than the ego")
    places = _places(view.objects())
    own = _places(view.ego(), "location")
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


def _places(table: pa.Table, column: str = "actor_location") -> dict[tuple[int, int], Any]:
    """Places in the world (m) by frame and track."""
    rows = table.select([*_KEYS, column]).to_pylist()
    return {(row["k"], row["track_id"]): row[column] for row in rows}
