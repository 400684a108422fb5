"""What happens in an episode and when: tracks, lights, weather, faults, moments to jump to."""

from __future__ import annotations

import threading
from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from carstage.web.datasets.catalogue import Catalogue
from carstage.web.messages import EpisodeHistory, Moment, TrackSpan
from carstage.web.messages.datasets import Span

if TYPE_CHECKING:
    from carstage.dataset import Episode
    from carstage.storage import CommitMarker

NEAR_M = 20.0
_MOST_KEPT = 4
_MOST_MOMENTS = 8
"""Of one sort: a list that nobody reads helps nobody."""
_FINE = ("ok", "off")
_BRAKING_M_S2 = -2.0
#: Bits of ``carla.VehicleLightState`` that say what a vehicle does; position lights are not among
#: them.
_SIGNALS = {
    8: "brake",
    16: "right blinker",
    32: "left blinker",
    64: "reverse",
    512: "special 1",
    1024: "special 2",
}
Row = dict[str, Any]


class HistoryService:
    """Histories of episodes; keeps the last few.

    Args:
        catalogue: finds the episodes.
    """

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._lock = threading.Lock()
        self._kept: OrderedDict[tuple[str, str, float], tuple[CommitMarker, EpisodeHistory]] = (
            OrderedDict()
        )

    def history(self, dataset: str, episode_id: str, near_m: float = NEAR_M) -> EpisodeHistory:
        """The history of an episode.

        Args:
            dataset: its dataset.
            episode_id: which episode.
            near_m: from where on a pedestrian is near, from the ego's pivot (m).

        Raises:
            WebError: there is no such episode.
            DatasetError: a table is missing or damaged.
        """
        episode = self._catalogue.episode(dataset, episode_id)
        key = str(episode.folder), episode.marker.attempt, near_m
        with self._lock:
            marker, kept = self._kept.get(key, (None, None))
            if kept is not None and marker == episode.marker:
                self._kept.move_to_end(key)
                return kept
        made = _history(episode, near_m)
        with self._lock:
            self._kept[key] = episode.marker, made
            self._kept.move_to_end(key)
            while len(self._kept) > _MOST_KEPT:
                self._kept.popitem(last=False)
        return made


def _history(episode: Episode, near_m: float) -> EpisodeHistory:
    columns = ["k", "track_id", "class", "is_ego", "distance_ego", "light_state"]
    rows = [r for r in episode.objects().select(columns).to_pylist() if not r["is_ego"]]
    tracks: dict[int, list[Row]] = defaultdict(list)
    for row in rows:
        tracks[row["track_id"]].append(row)
    ego = episode.ego().select(
        ["k", "traffic_light_state", "weather_preset", "weather", "acceleration_ego"]
    )
    driven = ego.to_pylist()
    faults = _faults(episode)
    return EpisodeHistory(
        near_m=near_m,
        tracks=[_track(track_id, of_track) for track_id, of_track in tracks.items()],
        lights=_spans(driven, lambda row: row["traffic_light_state"]),
        weather=_spans(driven, lambda row: row["weather_preset"] or "own values"),
        faults=faults,
        moments=[
            *_near_pedestrians(tracks, near_m),
            *_most_occluded(episode, tracks),
            *_nearest(tracks),
            *_braking(driven),
            *_first_faults(faults),
        ],
    )


def _track(track_id: int, rows: Sequence[Row]) -> TrackSpan:
    from carstage.report.drawing import class_colour

    known = [row for row in rows if row["distance_ego"] is not None]
    nearest = min(known, key=lambda row: row["distance_ego"], default=None)
    return TrackSpan(
        track_id=track_id,
        class_name=rows[0]["class"],
        colour=list(class_colour(rows[0]["class"])),
        spans=_runs(row["k"] for row in rows),
        nearest_m=None if nearest is None else nearest["distance_ego"],
        nearest_k=None if nearest is None else nearest["k"],
        signals=_spans(rows, lambda row: _signals(row["light_state"])),
    )


def _signals(bits: int | None) -> str | None:
    shown = [name for bit, name in _SIGNALS.items() if bits is not None and bits & bit]
    return ", ".join(shown) or None


def _runs(frames: Iterable[int]) -> list[list[int]]:
    """First and last frame of each stretch without a gap."""
    found: list[list[int]] = []
    for k in frames:
        if found and k == found[-1][1] + 1:
            found[-1][1] = k
        else:
            found.append([k, k])
    return found


def _spans(rows: Iterable[Row], value_of: Callable[[Row], str | None]) -> list[Span]:
    """Stretches of frames of one value; where there is none, there is no stretch."""
    found: list[Span] = []
    for row in rows:
        value, k = value_of(row), row["k"]
        if value is None:
            continue
        if found and (found[-1].value, found[-1].last) == (value, k - 1):
            found[-1].last = k
        else:
            found.append(Span(value=value, first=k, last=k))
    return found


def _faults(episode: Episode) -> dict[str, list[Span]]:
    """By sensor, where its data is missing, late or of another frame.

    A step that is not saved counts as the saved frame after it.
    """
    ledger = episode.ledger()
    ks: list[int | None] = ledger["k"].to_pylist()
    after, following = episode.frames - 1, []
    for k in reversed(ks):
        after = after if k is None else k
        following.append(after)
    following.reverse()
    found = {}
    for sensor in episode.calibration.sensors:
        rows: dict[int, Row] = {}
        for k, state in zip(following, ledger[f"{sensor}.state"].to_pylist(), strict=True):
            if state not in _FINE:
                rows[k] = {"k": k, "state": state}
        if rows:
            found[sensor] = _spans(rows.values(), lambda row: str(row["state"]))
    return found


def _near_pedestrians(tracks: dict[int, list[Row]], near_m: float) -> list[Moment]:
    """Where pedestrians come near, each time."""
    found = []
    for track_id, rows in tracks.items():
        if not rows[0]["class"].startswith("walker"):
            continue
        near = False
        for row in rows:
            distance = row["distance_ego"]
            is_near = distance is not None and distance < near_m
            if is_near and not near:
                found.append(
                    Moment(
                        kind=f"Pedestrian under {near_m:g} m",
                        text=f"{distance:.1f} m from the ego",
                        k=row["k"],
                        track_id=track_id,
                    )
                )
            near = is_near
    return sorted(found, key=lambda moment: moment.k)[: 3 * _MOST_MOMENTS]


def _most_occluded(episode: Episode, tracks: dict[int, list[Row]]) -> list[Moment]:
    """Of the objects that are visible, those that are hidden most, each once."""
    table = episode.camera_objects()
    seen = table.filter(table["visible"]).select(["k", "track_id", "sensor_id", "occlusion_ratio"])
    rows = [row for row in seen.to_pylist() if row["occlusion_ratio"]]
    found: dict[int, Moment] = {}
    for row in sorted(rows, key=lambda row: -row["occlusion_ratio"]):
        track_id = row["track_id"]
        if track_id in found:
            continue
        name = tracks[track_id][0]["class"] if track_id in tracks else "object"
        found[track_id] = Moment(
            kind="Most occluded",
            text=f"{name.replace('_', ' ')}, {row['occlusion_ratio']:.0%} hidden",
            k=row["k"],
            track_id=track_id,
            sensor_id=row["sensor_id"],
        )
        if len(found) == _MOST_MOMENTS:
            break
    return list(found.values())


def _nearest(tracks: dict[int, list[Row]]) -> list[Moment]:
    known = [
        min((r for r in rows if r["distance_ego"] is not None), key=lambda r: r["distance_ego"])
        for rows in tracks.values()
        if any(r["distance_ego"] is not None for r in rows)
    ]
    known.sort(key=lambda row: row["distance_ego"])
    return [
        Moment(
            kind="Nearest to the ego",
            text=f"{row['class'].replace('_', ' ')}, {row['distance_ego']:.1f} m",
            k=row["k"],
            track_id=row["track_id"],
        )
        for row in known[:_MOST_MOMENTS]
    ]


def _braking(driven: Sequence[Row]) -> list[Moment]:
    """Where the ego brakes hardest, each stretch once."""
    hard = [
        (row["k"], row["acceleration_ego"][0])
        for row in driven
        if row["acceleration_ego"] is not None and row["acceleration_ego"][0] < _BRAKING_M_S2
    ]
    found = []
    by_k = dict(hard)
    for first, last in _runs(k for k, _ in hard):
        k = min(range(first, last + 1), key=by_k.__getitem__)
        found.append((by_k[k], k))
    return [
        Moment(kind="Ego brakes hard", text=f"{value:.1f} m/s²", k=k)
        for value, k in sorted(found)[:_MOST_MOMENTS]
    ]


def _first_faults(faults: dict[str, list[Span]]) -> list[Moment]:
    return [
        Moment(kind="Fault", text=f"{sensor}: {span.value}", k=span.first, sensor_id=sensor)
        for sensor, spans in faults.items()
        for span in spans[:_MOST_MOMENTS]
    ]
