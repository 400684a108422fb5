"""Do events happen as they are asked for? Judged by the world's record, not by who drives them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.campaign import Campaign
from benchmarks.simulator.client_process import run_trial
from carstage.annotation.events import HAPPENED, event_rows
from carstage.bench.episodes import Progress, client_plan, events_of
from carstage.bench.verdict import Figure, Verdict
from carstage.config import check_config
from carstage.execution import CollectorProcess
from carstage.geometry import FloatArray, invert_pose, pose_matrix, transform_points
from carstage.plan import plan_episodes
from carstage.rawlog.format import WORLD
from carstage.rawlog.reader import EpisodeLog, WorldFrame
from carstage.runs.servers import ServerSetup
from carstage.server import EmbeddedServer, Endpoint, allot_ports
from carstage.spec import EpisodeSpec

SHARE = 0.9
"""Of the episodes in which an event has to happen."""
TOWNS = {
    "pedestrian_crosses": ("Stage01", "Stage02"),
    "hard_braking_leader": ("Stage01", "Stage02"),
    "cut_in": ("Stage01", "Stage03"),
    "stopped_vehicle": ("Stage01", "Stage02"),
}
"""Two towns for each kind; a car cuts in where there are two lanes in one direction."""
PARAMETERS: dict[str, dict[str, Any]] = {
    "pedestrian_crosses": {
        "distance_m": {"range": [25.0, 45.0]},
        "trigger_m": {"range": [12.0, 22.0]},
        "speed_m_s": {"range": [1.0, 2.5]},
        "side": {"choice": ["right", "left"]},
        "parked_car": {"choice": [False, True]},
    },
    "hard_braking_leader": {
        "gap_m": {"range": [8.0, 16.0]},
        "deceleration_m_s2": {"range": [3.0, 8.0]},
    },
    "cut_in": {
        "gap_m": {"range": [4.0, 12.0]},
        "change_s": {"range": [1.5, 3.5]},
        "slower_m_s": {"range": [0.0, 4.0]},
    },
    "stopped_vehicle": {
        "distance_m": {"range": [35.0, 60.0]},
        "trigger_m": {"range": [15.0, 30.0]},
        "stand_s": {"range": [2.0, 6.0]},
    },
}
"""What is sampled for each kind."""
_LOOK_S = 200.0
_STRAIGHT_M = 70.0
"""An ego that is to be cut in on begins with so much road of two lanes before it."""
_MOST_STARTS = 1000
"""As many as a configuration may choose among."""
AHEAD_M = 2.5
"""Half the width of what is straight ahead of the ego."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """An event of one episode.

    Attributes:
        row: of the events' table.
        wrong: what the world's record says against it; empty: it is as asked for.
    """

    row: Mapping[str, Any]
    wrong: tuple[str, ...]


def measure_events(
    kinds: Sequence[str] = tuple(TOWNS),
    *,
    towns: Sequence[str] = (),
    seeds: int = 20,
    seconds: float = 60.0,
    progress: Progress = lambda *_: None,
) -> Campaign:
    """A verdict for each kind and town.

    Args:
        kinds: of events.
        towns: for all kinds; none: two for each.
        seeds: episodes of each kind in each town.
        seconds: simulated, of each episode.
        progress: called with how many episodes are done, of how many.

    Raises:
        CollectorError: an episode could not be recorded.
        ServerError: the simulator did not start.
    """
    pairs = [(kind, town) for kind in kinds for town in (towns or TOWNS[kind])]
    verdicts: dict[str, Verdict] = {}
    total = len(pairs) * seeds
    with (
        EmbeddedServer(port=allot_ports().rpc) as server,
        tempfile.TemporaryDirectory(prefix="carstage-events-") as folder,
    ):
        for number, (kind, town) in enumerate(pairs):
            outcomes: list[Outcome] = []
            starts = run_trial(starts_for, server.endpoint.port, kind, town, timeout_s=_LOOK_S)
            specs = planned(kind, town, seeds, seconds, starts)
            for log in recorded(specs, server.endpoint, Path(folder) / f"{kind}-{town}"):
                outcomes.append(judged(log))
                progress(number * seeds + len(outcomes), total)
            verdicts[f"{kind} in {town}"] = verdict_on(kind, town, outcomes)
    return Campaign("events", verdicts)


def starts_for(port: int, kind: str, town: str) -> list[int]:
    """Spawn points of the ego from which an event can happen soon; in a client's process.

    Args:
        port: of the server.
        kind: of the event; ``cut_in`` needs a lane beside.
        town: is loaded.
    """
    import carla

    from carstage.collector.maps import spawn_points
    from carstage.collector.scenario.events.cut_in import lanes_beside

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_LOOK_S)
    world_map = client.load_world(town).get_map()
    starts = [world_map.get_waypoint(point.location) for point in spawn_points(world_map)]

    def has_lanes(start: carla.Waypoint) -> bool:
        later = start.next(_STRAIGHT_M)
        return all(lanes_beside(place) and not place.is_junction for place in (start, *later))

    return [index for index, start in enumerate(starts) if kind != "cut_in" or has_lanes(start)]


def planned(
    kind: str, town: str, seeds: int, seconds: float, starts: Sequence[int]
) -> list[EpisodeSpec]:
    """One episode for each seed, with parameters and the ego's start drawn for each."""
    document = {
        "name": kind,
        "episodes": seeds,
        "duration_s": seconds,
        "map": town,
        "vehicles": {"count": 20, "radius_m": None},
        "pedestrians": {"count": 10},
        "labels": {"cameras": []},
        "rig": {"sensors": [{"id": "GNSS", "kind": "gnss"}]},
        "ego": {"spawn": {"choice": list(starts)[:_MOST_STARTS]}},
        "scenario": {"kind": "autopilot", "events": [{"kind": kind, **PARAMETERS[kind]}]},
    }
    config = check_config(document)
    with ServerSetup(config).facts() as facts:
        return list(plan_episodes(config, facts))


def recorded(
    specs: Sequence[EpisodeSpec], endpoint: Endpoint, folder: Path
) -> Iterator[EpisodeLog]:
    """Record episodes one after the other with one collector; each log once it is whole."""
    folder.mkdir()
    plan = client_plan(specs[0], endpoint, folder)
    plan["episodes"] = [
        {
            "episode_id": spec.episode_id,
            "attempt": "a1",
            "folder": str(folder / spec.episode_id),
            "spec": spec.to_json(),
        }
        for spec in specs
    ]
    client = CollectorProcess(
        plan, plan_path=folder / "plan.json", log_path=folder / "collector.log"
    )
    with client:
        for event in events_of(client):
            if event["event"] == "episode_recorded":
                yield EpisodeLog(folder / event["episode_id"])


def judged(log: EpisodeLog, asked: Mapping[str, Any] | None = None) -> Outcome:
    """The only event of an episode, compared with the world's record.

    Args:
        log: the episode's.
        asked: parameters; None: those of its specification.
    """
    frames = [one for index in log.sealed_segments(WORLD) for one in log.world_frames(index)]
    ego_id = int(log.header["ego_id"])
    (row,) = event_rows(log.spec, frames, log.actors(), ego_id)
    (event,) = log.spec.scenario.events or ()
    if row["state"] != HAPPENED:
        return Outcome(row, ())
    end = len(frames) if row["end_tick"] is None else row["end_tick"] + 1
    running = frames[row["begin_tick"] : end]
    view = _View(running, ego_id, row["actors"][0], log.spec.fps)
    asked = event.parameters() if asked is None else asked
    return Outcome(row, tuple(_RULES[row["kind"]](view, asked, row)))


class _View:
    """An event's first actor as the ego saw it, tick by tick, from poses of the record.

    Args:
        frames: while the event went on.
        ego_id: the ego.
        actor_id: the actor.
        fps: ticks in a second.
    """

    def __init__(
        self, frames: Sequence[WorldFrame], ego_id: int, actor_id: int, fps: float
    ) -> None:
        self.fps = fps
        self.places = np.array([one.location[one.row(actor_id)] for one in frames])
        moved = np.diff(self.places[:, :2], axis=0)
        self.speeds: FloatArray = np.hypot(moved[:, 0], moved[:, 1]) * fps
        self._ego = [
            invert_pose(pose_matrix(one.location[i], one.rotation_deg[i]))
            for one in frames
            for i in [one.row(ego_id)]
        ]

    def seen_m(self, tick: int, by: int | None = None) -> FloatArray:
        """``(3,)`` where the actor is, forward and right of the ego, or of where the ego was."""
        seen = transform_points(self._ego[tick if by is None else by], self.places[tick])
        return np.asarray(seen)


def _crossing(view: _View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if not asked["trigger_m"] - 4.0 <= ahead_m <= asked["trigger_m"] + 2.0:
        yield f"it stepped out {ahead_m:.1f} m ahead"
    if (right_m > 0.0) != (asked["side"] == "right"):
        yield "it came from the other side"
    if row["end_tick"] is None:
        return
    if view.seen_m(-1, by=0)[1] * right_m > 0.0:
        yield "it did not come to the other side"
    speed_m_s = float(np.median(view.speeds))
    if abs(speed_m_s - asked["speed_m_s"]) > 0.15 * asked["speed_m_s"]:
        yield f"it walked at {speed_m_s:.2f} m/s"


def _leading(view: _View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if abs(right_m) > AHEAD_M or not 0.5 * asked["gap_m"] < ahead_m - 4.5 < 2.0 * asked["gap_m"]:
        yield f"it was {ahead_m:.1f} m ahead and {right_m:.1f} m to the right"
    slower = -np.diff(view.speeds) * view.fps
    braking = slower[slower > 0.5]
    if row["end_tick"] is not None and not len(braking):
        yield "it did not brake"
    wanted = asked["deceleration_m_s2"]
    if len(braking) > 2 and abs(np.median(braking) - wanted) > 0.15 * wanted:
        yield f"it braked at {np.median(braking):.1f} m/s²"
    if row["end_tick"] is not None and view.speeds[-2] > 0.1:
        yield "it did not stop"


def _cutting_in(view: _View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m, right_m = view.seen_m(0)[:2]
    if abs(right_m) < 1.5:
        yield f"it began {right_m:.1f} m to the right"
    if not 0.5 * asked["gap_m"] < ahead_m - 4.5 < 2.0 * asked["gap_m"] + 1.0:
        yield f"it began {ahead_m:.1f} m ahead"
    moved_over = round(asked["change_s"] * view.fps) + 1
    if moved_over < len(view.places):
        after_m = abs(view.seen_m(moved_over)[1])
        if after_m > AHEAD_M:
            yield f"it ended {after_m:.1f} m beside"


def _standing(view: _View, asked: Mapping[str, Any], row: Mapping[str, Any]) -> Iterator[str]:
    ahead_m = view.seen_m(0)[0]
    if not 0.0 < ahead_m <= asked["trigger_m"] + 1.0:
        yield f"it began {ahead_m:.1f} m ahead"
    # Where the road bends, it is straight ahead only once the ego is near.
    seen = [view.seen_m(tick) for tick in range(len(view.places))]
    nearest = min(seen, key=lambda one: float(np.hypot(one[0], one[1])))
    if abs(nearest[1]) > AHEAD_M:
        yield f"it stood {nearest[1]:.1f} m to the right of the ego"
    if view.speeds.max(initial=0.0) > 0.05:
        yield "it moved"
    if row["end_tick"] is not None and abs(row["end_s"] - row["begin_s"] - asked["stand_s"]) > 0.21:
        yield f"it stood {row['end_s'] - row['begin_s']:.1f} s"


_Rule = Callable[[_View, Mapping[str, Any], Mapping[str, Any]], Iterator[str]]
_RULES: dict[str, _Rule] = {
    "pedestrian_crosses": _crossing,
    "hard_braking_leader": _leading,
    "cut_in": _cutting_in,
    "stopped_vehicle": _standing,
}


def verdict_on(kind: str, town: str, outcomes: Sequence[Outcome]) -> Verdict:
    """How many happened, and how.

    Args:
        kind: of the events.
        town: where.
        outcomes: one for each episode.
    """
    happened = [one for one in outcomes if one.row["state"] == HAPPENED]
    distances = [one.row["min_distance"] for one in happened]
    braking = [one.row["ego_deceleration"] for one in happened]
    begins = [one.row["begin_s"] for one in happened]
    notes = [
        *(f"{one.row['state']}: {one.row['reason']}" for one in outcomes if one not in happened),
        *("; ".join(one.wrong) for one in happened if one.wrong),
    ]
    return Verdict(
        f"{kind} in {town}",
        (
            Figure("episodes", len(outcomes)),
            Figure("happened", len(happened), ">=", int(np.ceil(SHARE * len(outcomes)))),
            Figure("otherwise_than_asked", sum(bool(one.wrong) for one in happened), "==", 0),
            Figure("ended", sum(one.row["end_tick"] is not None for one in happened)),
            Figure("collisions", sum(bool(one.row["collision"]) for one in happened)),
            Figure("begin_s_median", _median(begins)),
            Figure("min_distance_m_median", _median(distances)),
            Figure("ego_deceleration_m_s2_median", _median(braking)),
        ),
        notes,
    )  # fmt: skip


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")
