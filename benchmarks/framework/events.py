"""Do events happen as they are asked for? Judged by the world's record, not by who drives them."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.campaign import Campaign
from benchmarks.framework.event_rules import RULES, View
from benchmarks.simulator.client_process import run_trial
from carstage.annotation.events import HAPPENED, event_rows
from carstage.bench.episodes import Progress, client_plan, events_of
from carstage.bench.verdict import Figure, Verdict
from carstage.config import check_config
from carstage.execution import CollectorProcess
from carstage.plan import plan_episodes
from carstage.rawlog.format import WORLD
from carstage.rawlog.reader import EpisodeLog
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
    "oncoming_overtaker": ("Stage01", "Stage02"),
    "emergency_vehicle": ("Stage01", "Stage03"),
    "wrong_way_cyclist": ("Stage01", "Stage02"),
    "red_light_runner": ("Stage01", "Stage02"),
    "works_zone": ("Stage01", "Stage02"),
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
    "oncoming_overtaker": {
        "distance_m": {"range": [62.0, 72.0]},
        "speed_m_s": {"range": [12.0, 14.0]},
        "slower_m_s": {"range": [9.5, 10.5]},
        "change_s": {"range": [1.0, 1.2]},
    },
    "emergency_vehicle": {
        "distance_m": {"range": [12.0, 18.0]},
        "faster_m_s": {"range": [8.0, 11.0]},
        "manner": {"choice": ["pass", "follow"]},
        "gap_m": {"range": [4.0, 9.0]},
        "follow_s": {"range": [2.0, 5.0]},
    },
    "wrong_way_cyclist": {
        "distance_m": {"range": [35.0, 60.0]},
        "trigger_m": {"range": [15.0, 30.0]},
        "speed_m_s": {"range": [3.0, 6.0]},
        "kerb_m": {"range": [0.0, 0.2]},
    },
    "red_light_runner": {
        "trigger_m": {"range": [20.0, 30.0]},
        "speed_m_s": {"range": [9.0, 14.0]},
        "before_s": {"range": [0.0, 2.0]},
    },
    "works_zone": {
        "distance_m": {"range": [30.0, 45.0]},
        "trigger_m": {"range": [15.0, 25.0]},
        "length_m": {"range": [4.0, 12.0]},
        "extent": {"choice": ["narrow", "close"]},
        "width_m": {"range": [0.4, 0.9]},
        "speed_m_s": {"range": [4.0, 7.0]},
    },
}
"""What is sampled for each kind."""
_LOOK_S = 200.0
_ROAD_M = {"cut_in": 70, "oncoming_overtaker": 90, "emergency_vehicle": 100}
"""So much road with the lanes that it takes the ego begins with before it."""
_MOST_STARTS = 1000
"""As many as a configuration may choose among."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """An event of one episode.

    Attributes:
        row: of the events' table.
        wrong: what the world's record says against it; empty: it is as asked for.
        asked: its parameters.
    """

    row: Mapping[str, Any]
    wrong: tuple[str, ...]
    asked: Mapping[str, Any]


def measure_events(
    kinds: Sequence[str] = tuple(TOWNS),
    *,
    towns: Sequence[str] = (),
    seeds: int = 20,
    seconds: float = 120.0,
    comfort: bool = False,
    progress: Progress = lambda *_: None,
) -> Campaign:
    """A verdict for each kind and town.

    Args:
        kinds: of events.
        towns: for all kinds; none: two for each.
        seeds: episodes of each kind in each town.
        seconds: simulated, of each episode.
        comfort: whether the ego drives gently; else as the Traffic Manager does by itself.
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
            specs = planned(kind, town, seeds, seconds, starts, comfort=comfort)
            for log in recorded(specs, server.endpoint, Path(folder) / f"{kind}-{town}"):
                outcomes.append(judged(log))
                progress(number * seeds + len(outcomes), total)
            verdicts[f"{kind} in {town}"] = verdict_on(kind, town, outcomes)
    return Campaign("events", verdicts)


def starts_for(port: int, kind: str, town: str) -> list[int]:
    """Spawn points of the ego from which an event can happen soon; in a client's process.

    Args:
        port: of the server.
        kind: of the event; some need lanes beside the ego's.
        town: is loaded.
    """
    import carla

    from carstage.collector.maps import spawn_points
    from carstage.collector.scenario.events.lanes import lanes_beside, oncoming_lane

    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_LOOK_S)
    world_map = client.load_world(town).get_map()
    starts = [world_map.get_waypoint(point.location) for point in spawn_points(world_map)]

    if kind not in _ROAD_M:
        return list(range(len(starts)))

    def has_lanes(start: Any) -> bool:
        road = road_before(start, _ROAD_M[kind])
        same_way = kind != "oncoming_overtaker" and all(lanes_beside(place) for place in road)
        return same_way or (kind != "cut_in" and all(oncoming_lane(place) for place in road))

    return [
        index
        for index, start in enumerate(starts)
        if len(road_before(start, _ROAD_M[kind])) > _ROAD_M[kind] and has_lanes(start)
    ]


def road_before(place: Any, longest_m: int) -> list[Any]:
    """Waypoints a metre apart up to the next junction or fork, at most so far."""
    road: list[Any] = []
    following = [place]
    while len(following) == 1 and not following[0].is_junction and len(road) <= longest_m:
        road.append(following[0])
        following = following[0].next(1.0)
    return road


def planned(
    kind: str,
    town: str,
    seeds: int,
    seconds: float,
    starts: Sequence[int],
    *,
    comfort: bool = False,
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
        "ego": {
            "spawn": {"choice": list(starts)[:_MOST_STARTS]},
            "driver": {"kind": "autopilot", "comfort": comfort},
        },
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
    asked = event.parameters() if asked is None else asked
    if row["state"] != HAPPENED:
        return Outcome(row, (), asked)
    view = View(frames, ego_id, row, log.spec.fps)
    return Outcome(row, tuple(RULES[row["kind"]](view, asked, row)), asked)


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
        *(f"{'; '.join(one.wrong)}, of {_told(one.asked)}" for one in happened if one.wrong),
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


def _told(asked: Mapping[str, Any]) -> str:
    parts = {
        name: f"{value:.2f}" if isinstance(value, float) else value for name, value in asked.items()
    }
    return ", ".join(f"{name} {value}" for name, value in parts.items())


def _median(values: Sequence[float]) -> float:
    return float(np.median(values)) if values else float("nan")
