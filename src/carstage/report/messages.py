"""The report's table of V2X messages: who was heard by which sensor, how often, how strongly."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.report import html

_MOST_SENDERS = 30


def messages_section(episode: Episode) -> str:
    """Senders by sensor, of the ego and its agents; empty without a V2X sensor."""
    rows: list[tuple[str, ...]] = []
    listened = False
    for view in episode.views:
        try:
            table = view.messages()
        except DatasetError:
            continue  # validation says what is wrong with it
        if table is None:
            continue
        listened = True
        names = ["sensor_id", "track_id", "station_type", "k", "power_dbm"]
        heard: dict[tuple[str, int, int], list[dict[str, Any]]] = defaultdict(list)
        for row in table.select(names).to_pylist():
            heard[row["sensor_id"], row["track_id"], row["station_type"]].append(row)
        who = "ego" if view.agent_name is None else view.agent_name
        rows += [
            _row(who, *sender, messages=messages) for sender, messages in sorted(heard.items())
        ]
    if not listened:
        return ""
    head = ("receiver", "sensor", "sender's track", "station", "messages", "frames", "power")
    more = f"<p>and {len(rows) - _MOST_SENDERS} more</p>" if len(rows) > _MOST_SENDERS else ""
    nothing = "" if rows else "<p>No message was received.</p>"
    table_of_all = html.table(head, rows[:_MOST_SENDERS]) if rows else ""
    return f"<h3>V2X messages</h3>{table_of_all}{more}{nothing}"


def _row(
    who: str, sensor: str, track: int, station: int, *, messages: list[dict[str, Any]]
) -> tuple[str, ...]:
    powers = [message["power_dbm"] for message in messages]
    return (
        who,
        sensor,
        str(track),
        _STATIONS.get(station, f"type {station}"),
        str(len(messages)),
        f"{min(m['k'] for m in messages)} to {max(m['k'] for m in messages)}",
        f"{min(powers):.0f} to {max(powers):.0f} dBm",
    )


_STATIONS = {
    1: "pedestrian",
    2: "cyclist",
    4: "motorcycle",
    5: "car",
    6: "bus",
    7: "lorry",
    10: "special vehicle",
    11: "tram",
    15: "roadside unit",
}
"""ETSI TS 102 894-2, as far as CARLA knows them."""
