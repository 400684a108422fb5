"""What may not change along a track, and how it moves from frame to frame."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import Any

import numpy as np
import pyarrow as pa

from carstage.dataset.reading import Episode
from carstage.dataset.tracks import may_come_back
from carstage.spec import EpisodeSpec, OpenScenarioSpec, RecordedSpec, ScenicSpec
from carstage.tags import TAGS_0_9_14, server_release
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.recomputing import Recomputed, entries, numbers, rows_at

_CONSTANT = ("class", "blueprint", "base_type", "special_type", "role_name", "is_static", "is_ego")
_EXTENT_M = 1e-3
_OFF_M_S, _OFF_SHARE = 0.5, 0.25
_OFF_M_S2, _OFF_SHARE_OF_ACCELERATION = 2.0, 0.3
_OFF_RAD_S = 0.1
_JUMP_M_S = 60.0
_LIGHT_STEPS = {("Red", "Yellow"), ("Yellow", "Green"), ("Green", "Red")}
"""Changes that no traffic light makes from one frame to the next."""
_CLASS_TAGS = {
    "car": {"Car"}, "van": {"Car", "Truck", "Bus"}, "truck": {"Truck", "Car"},
    "bus": {"Bus", "Truck", "Car"}, "motorcycle": {"Motorcycle", "Rider"},
    "bicycle": {"Bicycle", "Rider"}, "rider": {"Rider", "Pedestrian"},
    "walker_adult": {"Pedestrian"}, "walker_child": {"Pedestrian"},
    "walker_wheelchair": {"Pedestrian"}, "traffic_light": {"TrafficLight"},
    "traffic_sign": {"TrafficSign"},
}  # fmt: skip
_TAGS_SINCE = (0, 9, 14)
_OLD_TAGS = {"Car", "Pedestrian"}
"""Of all vehicles, and of riders too, on servers before that release."""


def check_tracks(episode: Episode, tables: LabelTables, findings: Findings) -> None:
    """Check that an object stays what it is (check ``tracks``) and that its motion is whole.

    From frame to frame velocities are the changes of places, accelerations those of velocities,
    yaw rates those of headings (check ``motion_rows``). Saved steps that were not recorded leave
    gaps in which all can have changed: then only places are compared, by the check ``motion``.
    """
    _check_constant(tables.objects, findings)
    _check_parents(tables.objects, findings)
    _check_classes(episode, tables.objects, findings)
    _check_lights(episode.spec, tables.objects, findings)
    if episode.spec.save_every == 1 and episode.spec.timing.synchronous:
        actors = tables.objects.filter(~may_come_back(tables.objects))
        _check_rates("objects.parquet", actors, ("actor_location", "actor_rotation_deg"), findings)
        _check_rates("ego.parquet", tables.ego, ("location", "rotation_deg"), findings)


def _check_constant(objects: pa.Table, findings: Findings) -> None:
    tracks = entries(objects, "track_id")
    for column in _CONSTANT:
        if column not in objects.column_names:
            continue
        values = entries(objects, column)
        _compare_with_first(column, objects, tracks, values, findings)
    tags = [tuple(sorted(value)) for value in entries(objects, "semantic_tags")]
    _compare_with_first("semantic_tags", objects, tracks, tags, findings)
    extents = entries(objects, "box_extent")
    sizes = [None if e is None else tuple(round(v / _EXTENT_M / 2) for v in e) for e in extents]
    _compare_with_first("box_extent", objects, tracks, sizes, findings)


def _check_parents(objects: pa.Table, findings: Findings) -> None:
    """Riders and lights belong to the same actor in all frames."""
    rows = objects.filter(may_come_back(objects))
    tracks, parents = entries(rows, "track_id"), entries(rows, "parent_track_id")
    first: dict[int, Any] = {}
    wanted = [first.setdefault(track, own) for track, own in zip(tracks, parents, strict=True)]
    wrong = np.array([a != b for a, b in zip(parents, wanted, strict=True)], np.bool_)
    same = Recomputed("tracks", "objects.parquet", rows, findings)
    same.rows("parent_track_id", wrong, parents, wanted)


def _compare_with_first(
    column: str, objects: pa.Table, tracks: list[int], values: list[Any], findings: Findings
) -> None:
    first: dict[int, Any] = {}
    wanted = [first.setdefault(track, value) for track, value in zip(tracks, values, strict=True)]
    wrong = np.array(
        [value is not None and want is not None and value != want
         for value, want in zip(values, wanted, strict=True)], dtype=np.bool_
    )  # fmt: skip
    Recomputed("tracks", "objects.parquet", objects, findings).rows(column, wrong, values, wanted)


def _check_classes(episode: Episode, objects: pa.Table, findings: Findings) -> None:
    """Class and blueprint are those of the actor, and the tags are those of the class."""
    old = server_release(episode.document["server_version"]) < _TAGS_SINCE
    names = {number: tag.name for number, tag in TAGS_0_9_14.items()}
    actors = episode.document["actors"]
    rows = objects.select(["track_id", "class", "blueprint", "semantic_tags"]).to_pylist()
    seen_by_class = [row["class"] for row in rows]
    wrong, wanted = [], []
    for row in rows:
        tags = {names.get(tag, "") for tag in row["semantic_tags"]}
        allowed = _CLASS_TAGS.get(row["class"])
        if allowed is not None and old:
            allowed = allowed | _OLD_TAGS
        wrong.append(allowed is not None and bool(tags) and not tags <= allowed)
        wanted.append(f"a class of {sorted(tags)}")
    same = Recomputed("tracks", "objects.parquet", objects, findings)
    same.rows("class", np.array(wrong, dtype=np.bool_), seen_by_class, wanted)
    types = [actors.get(str(row["track_id"]), {}).get("type_id") for row in rows]
    blueprints = [row["blueprint"] for row in rows]
    other = np.array(
        [t is not None and t != b for t, b in zip(types, blueprints, strict=True)], dtype=np.bool_
    )
    same.rows("blueprint", other, blueprints, types)
    base = [actors.get(str(row["track_id"]), {}).get("attributes", {}).get("base_type")
            for row in rows]  # fmt: skip
    pairs = zip(base, seen_by_class, strict=True)
    differs = np.array(
        [bool(b) and b.lower() in _CLASS_TAGS and b.lower() != c for b, c in pairs], dtype=np.bool_
    )
    same.rows("class", differs, seen_by_class, base)


def _check_lights(spec: EpisodeSpec, objects: pa.Table, findings: Findings) -> None:
    """Heads of one traffic light agree, and turn in the order of a traffic light."""
    lit = [i for i, s in enumerate(entries(objects, "traffic_light_state")) if s is not None]
    lights = rows_at(objects, lit).sort_by([("track_id", "ascending"), ("k", "ascending")])
    ks, tracks = entries(lights, "k"), entries(lights, "track_id")
    states = entries(lights, "traffic_light_state")
    owners = [
        own or track for own, track in zip(entries(lights, "parent_track_id"), tracks, strict=True)
    ]
    heads: dict[tuple[int, int], Counter[str]] = defaultdict(Counter)
    for k, owner, state in zip(ks, owners, states, strict=True):
        heads[k, owner][state] += 1
    usual = [heads[key].most_common(1)[0][0] for key in zip(ks, owners, strict=True)]
    same = Recomputed("lights", "objects.parquet", lights, findings)
    apart = [state != other for state, other in zip(states, usual, strict=True)]
    same.rows("traffic_light_state", np.array(apart, dtype=np.bool_), states, usual)
    if not _shows_whole_cycles(spec):
        return
    jumps = [
        i > 0
        and (tracks[i - 1], ks[i - 1]) == (tracks[i], ks[i] - 1)
        and (states[i - 1], states[i]) in _LIGHT_STEPS
        for i in range(len(states))
    ]
    after = [f"what follows {states[i - 1]}" for i in range(len(states))]
    same.rows("traffic_light_state", np.array(jumps, dtype=np.bool_), states, after)


def _shows_whole_cycles(spec: EpisodeSpec) -> bool:
    """Whether the server alone turns the lights, and no step between two frames is left out."""
    scenario = spec.scenario
    return (
        spec.save_every == 1
        and spec.timing.synchronous
        and not isinstance(scenario, (ScenicSpec, OpenScenarioSpec, RecordedSpec))
        and not any(event.sets_lights for event in scenario.events or ())
    )


def _check_rates(name: str, table: pa.Table, columns: tuple[str, str], findings: Findings) -> None:
    """Velocities, accelerations and yaw rates, row by row."""
    ks, tracks = table["k"].to_numpy(), table["track_id"].to_numpy()
    order = np.lexsort((ks, tracks))
    table = rows_at(table, order.tolist())
    ks, tracks = ks[order], tracks[order]
    place, rotation = numbers(table, columns[0], 3), numbers(table, columns[1], 3)
    velocity = numbers(table, "velocity", 3)
    turning = numbers(table, "angular_velocity", 3)[:, 2]
    step_s = np.diff(table["timestamp_s"].to_numpy())
    follows = (np.diff(tracks) == 0) & (np.diff(ks) == 1) & (step_s > 0.0)
    if not follows.any():
        return
    per_s = 1.0 / np.where(follows, step_s, 1.0)[:, None]
    moved = np.diff(place, axis=0) * per_s
    changed = np.diff(velocity, axis=0) * per_s
    turned = np.radians((np.diff(rotation[:, 1]) + 180.0) % 360.0 - 180.0) * per_s[:, 0]
    later = table.slice(1)
    same = Recomputed("motion_rows", name, later, findings)
    # A server may move actors by setting their places; what jumps has no velocity to compare.
    size = np.linalg.norm(moved, axis=1)
    walks = follows & (size < _JUMP_M_S)
    same.column("velocity", moved, _OFF_M_S + _OFF_SHARE * size, where=walks)
    size = np.linalg.norm(changed, axis=1)
    same.column("acceleration", changed, _OFF_M_S2 + _OFF_SHARE_OF_ACCELERATION * size, where=walks)
    same.column(
        "angular_velocity", turned, _OFF_RAD_S + _OFF_SHARE * np.abs(turned),
        recorded=np.where(np.isnan(turning[1:]), turned, turning[1:]), where=walks,
    )  # fmt: skip
