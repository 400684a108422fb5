"""The report's table of the agents beside the ego."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carstage.dataset.reading import Episode
from carstage.report import html

_MOST_SENSORS = 12
_WORDS = {"roadside": "roadside unit", "junction": "camera mast", "drone": "drone"}


def fleet_section(episode: Episode) -> str:
    """Who they are, what they carry, how near they come to the ego; empty without agents."""
    kinds = {agent.name: agent.kind for agent in episode.spec.agents}
    rows = [_row(view, kinds[str(view.agent_name)], _places(episode)) for view in episode.views[1:]]
    if not rows:
        return ""
    head = (
        "agent",
        "kind",
        "track",
        "sensors",
        "labelled objects",
        "nearest to the ego",
        "farthest",
    )
    return "<h3>Agents</h3>" + html.table(head, rows)


def _row(view: Episode, kind: str, ego: dict[int, NDArray[np.float64]]) -> tuple[str, ...]:
    sensors = [sensor.id for sensor in view.sensors]
    shown = ", ".join(sensors[:_MOST_SENSORS]) + (", …" if len(sensors) > _MOST_SENSORS else "")
    places = _places(view)
    distances = [float(np.linalg.norm(places[k] - ego[k])) for k in places if k in ego]
    return (
        str(view.agent_name),
        _WORDS.get(kind, view.spec.ego.blueprint),
        str(view.document["ego_id"]),
        shown,
        str(len(set(view.objects()["track_id"].to_pylist()))),
        f"{min(distances):.1f} m" if distances else "",
        f"{max(distances):.1f} m" if distances else "",
    )


def _places(view: Episode) -> dict[int, NDArray[np.float64]]:
    """Where the ego, or the agent, is in each frame (m)."""
    rows = view.ego().select(["k", "location"]).to_pylist()
    return {row["k"]: np.array(row["location"]) for row in rows}
