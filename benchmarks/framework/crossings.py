"""Do pedestrians cross near the ego, on crosswalks and with the lights, and do they look first?

Judged by the world's record of short episodes, not by who moves the pedestrians.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import carla
import numpy as np
import shapely
from numpy.typing import NDArray

from benchmarks.campaign import Campaign
from benchmarks.framework.events import recorded
from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.walkers import crosswalk_polygons
from carstage.bench.episodes import Progress
from carstage.bench.verdict import Figure, Verdict
from carstage.config import check_config
from carstage.plan import plan_episodes
from carstage.rawlog.format import WORLD
from carstage.rawlog.reader import EpisodeLog, WorldFrame
from carstage.runs.servers import ServerSetup
from carstage.server import EmbeddedServer, allot_ports

TOWNS = ("Stage01", "Stage02", "Stage03")
START_M = (15.0, 40.0)
"""The ego begins that far before a crosswalk, as the demo's does."""
START_DEG = 30.0
VIEW_M = 50.0
"""As far as a pedestrian of some twenty pixels' height."""
VIEW_DEG = 45.0
"""Half the width of a front camera's view."""
HORIZON_S = 6.0
LEAST_TTC_S = 2.0
"""A vehicle that is nearer in time when somebody steps out has to brake hard."""
LIGHT_M = 15.0
"""From a crosswalk to the stop line of its own arm."""
_SIDE_M = 0.4
_ACROSS_M = 4.0
"""Who leaves the road that far from where it was entered has crossed it."""
REACTION_S = 0.5
"""Who has begun to step out does so, though the light changes."""
_LOOK_S = 200.0
_SIGNAL_TYPE = "1000001"


@dataclass(frozen=True, slots=True)
class Crossing:
    """A way over a road.

    Attributes:
        walker: actor id.
        begin, end: first tick on the road and first one off it.
        on_crosswalk: it began there.
        light: state of the arm's light :data:`REACTION_S` before; empty: there is none.
        ttc_s: seconds until the first vehicle that goes on as it does would touch the pedestrian,
            who goes on, too; at most :data:`HORIZON_S`.
        in_view: before the ego, no farther than :data:`VIEW_M`.
        whole: it went from one side to the other.
    """

    walker: int
    begin: int
    end: int
    on_crosswalk: bool
    light: str
    ttc_s: float
    in_view: bool
    whole: bool


class Streets:
    """What of a map the judgement needs.

    Args:
        town: ``carla.Map``.
    """

    def __init__(self, town: carla.Map) -> None:
        self._town = town
        self._crosswalks = crosswalk_polygons(town.get_crosswalks())
        self._signals = town.get_all_landmarks_of_type(_SIGNAL_TYPE)

    def is_on_road(self, place: NDArray[np.float64]) -> bool:
        """Whether a place ``(3,)`` is on a driving lane, at its height."""
        at = carla.Location(*place.tolist())
        lane = self._town.get_waypoint(at)
        there = lane.transform.location
        aside_m = np.hypot(at.x - there.x, at.y - there.y)
        return bool(aside_m < 0.5 * lane.lane_width and abs(at.z - there.z) < 3.0)

    def crosswalk(self, place: NDArray[np.float64]) -> shapely.Polygon | None:
        """The crosswalk at a place, with half a metre around it."""
        point = shapely.Point(*place[:2])
        return next((one for one in self._crosswalks if one.distance(point) < 0.5), None)

    def signal_places(self, crosswalk: shapely.Polygon) -> NDArray[np.float64]:
        """``(N, 2)`` m: where the lights of vehicles that come to a crosswalk stand."""
        middle = crosswalk.centroid
        lane = self._town.get_waypoint(carla.Location(middle.x, middle.y, 0.0))
        found = [
            (signal.transform.location.x, signal.transform.location.y)
            for signal in self._signals
            if signal.road_id == lane.road_id and abs(signal.s - lane.s) < LIGHT_M
        ]
        return np.array(found).reshape(-1, 2)


class Judge:
    """Finds the crossings of an episode.

    Args:
        log: its record.
    """

    def __init__(self, log: EpisodeLog) -> None:
        self._frames = [one for i in log.sealed_segments(WORLD) for one in log.world_frames(i)]
        self._actors = log.actors()
        self._ego_id = int(log.header["ego_id"])
        self._fps = log.spec.fps
        text = (log.folder / "map.xodr").read_text(encoding="utf-8")
        self._streets = Streets(carla.Map("judged", text))

    def crossings(self) -> list[Crossing]:
        """All that begin within the episode."""
        walkers = [one for one, row in self._actors.items() if row.type_id.startswith("walker.")]
        return [crossing for walker in walkers for crossing in self._of(walker)]

    def _of(self, walker: int) -> Iterator[Crossing]:
        places = [_place(frame, walker) for frame in self._frames]
        on_road = [place is not None and self._streets.is_on_road(place) for place in places]
        for begin in range(1, len(places)):
            if not on_road[begin] or on_road[begin - 1] or places[begin - 1] is None:
                continue
            end = next((k for k in range(begin, len(places)) if not on_road[k]), len(places))
            if end - begin < 0.5 * self._fps:
                continue
            yield self._crossing(walker, begin, end, places)

    def _crossing(self, walker: int, begin: int, end: int, places: Sequence[Any]) -> Crossing:
        here = places[begin]
        crosswalk = self._streets.crosswalk(here)
        decided = max(begin - round(REACTION_S * self._fps), 0)
        last = places[end] if end < len(places) else None
        across_m = 0.0 if last is None else float(np.hypot(*(last - here)[:2]))
        return Crossing(
            walker,
            begin,
            end,
            crosswalk is not None,
            "" if crosswalk is None else self._light(decided, crosswalk),
            self._ttc_s(begin, walker),
            any(self._sees(k, places[k]) for k in range(begin, end) if places[k] is not None),
            across_m > _ACROSS_M,
        )

    def _light(self, tick: int, crosswalk: shapely.Polygon) -> str:
        frame = self._frames[tick]
        states: Mapping[str, str] = frame.meta["traffic_lights"]
        lights = [int(light) for light in states]
        shown = []
        for place in self._streets.signal_places(crosswalk):
            at = np.array([frame.location[frame.row(light)][:2] for light in lights])
            shown.append(states[str(lights[int(np.linalg.norm(at - place, axis=1).argmin())])])
        return next((one for one in shown if one != "Red"), "Red" if shown else "")

    def _ttc_s(self, tick: int, walker: int) -> float:
        frame = self._frames[tick]
        row = frame.row(walker)
        times = np.arange(0.0, HORIZON_S, 0.1)
        path = frame.location[row][:2] + times[:, None] * frame.velocity[row][:2]
        least_s = HORIZON_S
        for actor_id in frame.actor_id.tolist():
            actor = self._actors[actor_id]
            other = frame.row(actor_id)
            if not actor.type_id.startswith("vehicle."):
                continue
            if np.linalg.norm(frame.velocity[other]) < 0.5:
                continue
            yaw = np.radians(frame.rotation_deg[other][1])
            relative = path - frame.location[other][:2] - times[:, None] * frame.velocity[other][:2]
            ahead = relative @ [np.cos(yaw), np.sin(yaw)]
            aside = relative @ [-np.sin(yaw), np.cos(yaw)]
            extent = actor.box_extent
            hits = (np.abs(ahead) < extent[0] + _SIDE_M) & (np.abs(aside) < extent[1] + _SIDE_M)
            if hits.any():
                least_s = min(least_s, float(times[hits.argmax()]))
        return least_s

    def _sees(self, tick: int, place: NDArray[np.float64]) -> bool:
        frame = self._frames[tick]
        ego = frame.row(self._ego_id)
        away = (place - frame.location[ego])[:2]
        bearing = np.degrees(np.arctan2(away[1], away[0])) - frame.rotation_deg[ego][1]
        within = abs((bearing + 180.0) % 360.0 - 180.0) < VIEW_DEG
        return bool(within and np.hypot(*away) < VIEW_M)


def _place(frame: WorldFrame, actor_id: int) -> NDArray[np.float64] | None:
    try:
        place: NDArray[np.float64] = frame.location[frame.row(actor_id)]
    except KeyError:
        return None
    return place


def starts_in(port: int, town: str) -> list[int]:
    """Spawn points that have a crosswalk ahead; in a client's process.

    Args:
        port: of the server.
        town: is loaded.
    """
    client = carla.Client("127.0.0.1", port)
    client.set_timeout(_LOOK_S)
    world_map = client.load_world(town).get_map()
    middles = [one.centroid for one in crosswalk_polygons(world_map.get_crosswalks())]
    found = []
    for index, point in enumerate(world_map.get_spawn_points()):
        here, yaw = point.location, np.radians(point.rotation.yaw)
        away = np.array([(middle.x - here.x, middle.y - here.y) for middle in middles])
        ahead = away @ [np.cos(yaw), np.sin(yaw)]
        distance = np.linalg.norm(away, axis=1)
        before = ahead > np.cos(np.radians(START_DEG)) * distance
        if (before & (distance > START_M[0]) & (distance < START_M[1])).any():
            found.append(index)
    return found


def measure_crossings(
    towns: Sequence[str] = TOWNS,
    *,
    seeds: int = 3,
    seconds: float = 10.0,
    crossing_percent: float = 100.0,
    progress: Progress = lambda *_: None,
) -> Campaign:
    """A verdict for each town.

    Args:
        towns: stage towns.
        seeds: episodes in each, as crowded as the demo.
        seconds: simulated, of each episode.
        crossing_percent: of the pedestrians.
        progress: called with how many episodes are done, of how many.

    Raises:
        CollectorError: an episode could not be recorded.
        ServerError: the simulator did not start.
    """
    verdicts = {}
    with (
        EmbeddedServer(port=allot_ports().rpc) as server,
        tempfile.TemporaryDirectory(prefix="carstage-crossings-") as folder,
    ):
        for number, town in enumerate(towns):
            starts = run_trial(starts_in, server.endpoint.port, town, timeout_s=_LOOK_S)
            config = check_config(
                {
                    "name": "crossings",
                    "episodes": seeds,
                    "duration_s": seconds,
                    "seed": 7,
                    "map": town,
                    "vehicles": {"count": 50, "radius_m": 60},
                    "pedestrians": {
                        "count": 50, "radius_m": 40, "crossing_percent": crossing_percent,
                    },
                    "labels": {"cameras": []},
                    "rig": {"sensors": [{"id": "GNSS", "kind": "gnss"}]},
                    "ego": {"spawn": {"choice": starts}},
                }
            )  # fmt: skip
            with ServerSetup(config).facts() as facts:
                specs = list(plan_episodes(config, facts))
            episodes = []
            for log in recorded(specs, server.endpoint, Path(folder) / town):
                episodes.append(Judge(log).crossings())
                progress(number * seeds + len(episodes), len(towns) * seeds)
            verdicts[f"crossings in {town}"] = verdict_on(town, episodes)
    return Campaign("crossings", verdicts)


def verdict_on(town: str, episodes: Sequence[Sequence[Crossing]]) -> Verdict:
    """The figures of a town's episodes beside their targets."""
    found = [one for episode in episodes for one in episode]
    seen = [sum(one.in_view for one in episode) for episode in episodes]
    with_lights = [one for one in found if one.light]
    against = sum(one.light != "Red" for one in with_lights)
    hasty = sum(one.ttc_s < LEAST_TTC_S for one in found)
    return Verdict(
        f"crossings in {town}",
        (
            Figure("episodes", len(episodes)),
            Figure("crossings_begun", len(found)),
            Figure("whole", sum(one.whole for one in found)),
            Figure("least_in_view_of_the_ego", min(seen, default=0), ">=", 1),
            Figure("off_crosswalks", sum(not one.on_crosswalk for one in found)),
            Figure("at_lights", len(with_lights)),
            Figure("against_the_light", against, "==", 0),
            Figure("less_than_2_s_before_a_vehicle", hasty, "==", 0),
            Figure("least_ttc_s", min((one.ttc_s for one in found), default=HORIZON_S)),
        ),
        [],
    )
