"""The report's table of V2X messages: who was heard by which sensor, how often, how strongly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

import pyarrow as pa

from carstage.dataset.reading import Episode
from carstage.errors import DatasetError
from carstage.report import html

_MOST_ROWS = 30
_COLUMNS = ["sensor_id", "track_id", "station_type", "k", "power_dbm"]
_TITLE = "<h3>V2X messages</h3>"
_MEANING = (
    '<p class="soft">Awareness messages by receiver and sender: how many arrived, in which frames '
    "the first and the last, and the weakest and strongest signal.</p>"
)


def messages_section(episode: Episode) -> str:
    """Senders by sensor, of the ego and its agents; empty without a V2X sensor."""
    senders: dict[int, str] = {}
    tables: list[tuple[str, pa.Table]] = []
    for view in episode.views:
        name = "ego" if view.agent_name is None else view.agent_name
        try:
            senders[view.document["ego_id"]] = name
            table = view.messages()
        except DatasetError:
            continue  # validation says what is wrong with it
        if table is not None:
            tables.append((name, table))
    if not tables:
        return ""
    rows = [row for receiver, table in tables for row in _rows(receiver, table, senders)]
    if not rows:
        return f"{_TITLE}<p>No message was received.</p>"
    head = ("receiver", "sensor", "sender", "station", "messages", "frames", "power")
    more = f"<p>and {len(rows) - _MOST_ROWS} more</p>" if len(rows) > _MOST_ROWS else ""
    return f"{_TITLE}{_MEANING}{html.table(head, rows[:_MOST_ROWS])}{more}"


def _rows(receiver: str, table: pa.Table, senders: Mapping[int, str]) -> Iterator[tuple[str, ...]]:
    """A row for each sensor and sender."""
    heard: dict[tuple[str, int], list[dict[str, Any]]] = defaultdict(list)
    for message in table.select(_COLUMNS).to_pylist():
        if message["track_id"] is not None and message["power_dbm"] is not None:
            heard[message["sensor_id"], message["track_id"]].append(message)
    for (sensor, track), messages in sorted(heard.items()):
        name = senders.get(track)
        powers = [message["power_dbm"] for message in messages]
        frames = [message["k"] for message in messages]
        station = messages[0]["station_type"]
        yield (
            receiver,
            sensor,
            f"track {track}" if name is None else f"{name} (track {track})",
            _STATIONS.get(station, f"type {station}"),
            str(len(messages)),
            f"{min(frames)} to {max(frames)}",
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
