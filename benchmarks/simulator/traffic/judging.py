"""From a recording to figures beside their targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.simulator.traffic.collisions import (
    collision_pairs,
    inside_buildings,
    walkers_hit,
)
from benchmarks.simulator.traffic.passages import Passage, passages, red_lights_run
from benchmarks.simulator.traffic.recording import Partner, Recording
from benchmarks.simulator.traffic.standing import STOOD_S, longest_stand_s
from carstage.bench.verdict import Figure, Verdict

OFF_ROAD_M = 0.25
"""A vehicle that changes lanes is half a lane from both middles, and a bit more in a bend."""
_MAX_NOTES = 40


def judge(recording: Recording) -> Verdict:
    """The figures of one town.

    Free flow is the mean speed of vehicles of the same Traffic Manager in the same town that meet
    neither red lights nor each other. The share of it that is reached is measured over all vehicles
    and the whole drive, with all waiting at red lights in it.

    A vehicle is stuck if the Traffic Manager removed it (which it does after 90 s) or it stood for
    over 60 s without a red light at the head of its queue. It is off the road when its middle is
    more than :data:`OFF_ROAD_M` outside the driving lane that is nearest to it.
    """
    present = recording.present
    count = present.shape[1]
    removed = ~present[-1]
    stood_s = longest_stand_s(recording)
    stuck = removed | (stood_s > STOOD_S)
    mean_speed = float(recording.speed[present].mean(dtype=np.float64) * 3.6)
    limit_kmh = float(recording.speed_limit_kmh[present].mean(dtype=np.float64))
    free_flow = 3.6 * recording.free_flow
    minutes = recording.vehicle_minutes
    found = _find(recording)
    driven = passages(recording)
    run = red_lights_run(driven)
    offset, outside = recording.lane_offset_m, ~recording.in_junction
    over = offset > recording.lane_half_width_m + OFF_ROAD_M
    off_road = np.asarray(over.any(axis=0))
    return Verdict(
        f"traffic in {recording.town}",
        (
            Figure("vehicles", count),
            Figure("walkers", recording.walker_location.shape[1]),
            Figure("simulated_s", recording.seconds),
            Figure("vehicle_minutes", minutes),
            Figure("removed_as_stuck", int(removed.sum())),
            Figure("stood_over_60_s_without_red_light", int((stood_s > STOOD_S).sum())),
            Figure("stuck_percent", 100.0 * float(stuck.mean()), "<=", 2.0),
            Figure("mean_speed_kmh", mean_speed),
            Figure("free_flow_kmh", free_flow),
            Figure("alone_with_lights_kmh", 3.6 * recording.free_flow_with_lights),
            Figure("mean_speed_limit_kmh", limit_kmh),
            Figure("mean_speed_percent_of_free_flow", 100.0 * mean_speed / free_flow, ">=", 50.0),
            Figure("collisions_between_vehicles", len(found.vehicles)),
            Figure("collisions_with_scenery", len(found.scenery)),
            Figure(
                "collisions_per_100_vehicle_minutes",
                100.0 * (len(found.vehicles) + len(found.scenery)) / minutes,
                "<=",
                1.0,
            ),
            Figure("collisions_with_walkers", len(found.walkers)),
            Figure(
                "collisions_with_walkers_per_1000_vehicle_minutes",
                1000.0 * len(found.walkers) / minutes,
                "<=",
                1.0,
            ),
            Figure("mean_lateral_error_m", float(np.nanmean(offset[outside])), "<=", 0.3),
            Figure("mean_lateral_error_in_junctions_m", _mean(offset[recording.in_junction])),
            Figure("vehicles_off_the_road", int(off_road.sum()), "==", 0),
            Figure("vehicles_inside_buildings", len(found.buildings), "==", 0),
            Figure("stop_lines_passed", len(driven)),
            Figure("red_lights_run", len(run)),
            Figure("red_lights_run_per_200", 200.0 * len(run) / max(len(driven), 1), "<=", 1.0),
            Figure("ticks_per_s", recording.ticks_per_s),
            Figure("lost_wake_ups_of_the_client", recording.wake_ups),
        ),
        _notes(recording, found, run, stuck, stood_s, off_road)[:_MAX_NOTES],
    )


@dataclass(frozen=True, slots=True)
class _Found:
    """Collisions and intrusions, as ``collisions`` lists them."""

    vehicles: list[tuple[int, int, int]]
    scenery: list[tuple[int, int, int]]
    walkers: list[tuple[int, int, int]]
    buildings: list[tuple[int, int]]


def _find(recording: Recording) -> _Found:
    return _Found(
        collision_pairs(recording, Partner.VEHICLE),
        collision_pairs(recording, Partner.SCENERY),
        walkers_hit(recording),
        inside_buildings(recording),
    )


def _mean(values: np.ndarray) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else 0.0


def _notes(
    recording: Recording,
    found: _Found,
    run: list[Passage],
    stuck: np.ndarray,
    stood_s: np.ndarray,
    off_road: np.ndarray,
) -> list[str]:
    """Where and when it went wrong, for whoever has to mend it."""
    row_of = {int(actor): row for row, actor in enumerate(recording.vehicle_id)}
    present = recording.present

    def name(row: int) -> str:
        return f"{recording.vehicle_type[row]}#{recording.vehicle_id[row]}"

    def place(tick: int, row: int) -> str:
        x, y, z = recording.location[tick, row].tolist()
        return f"({x:.1f}, {y:.1f}, {z:.1f}) at {tick * recording.delta_s:.1f} s"

    notes = []
    for row in np.flatnonzero(stuck).tolist():
        last = int(np.flatnonzero(present[:, row])[-1])
        what = "stood" if present[-1, row] else "was removed after it stood"
        notes.append(f"{name(row)} {what} {stood_s[row]:.0f} s; last seen {place(last, row)}")
    for what, pairs in (("vehicle", found.vehicles), ("scenery", found.scenery)):
        for tick, one, other in pairs:
            row, partner = (row_of[other], one) if one not in row_of else (row_of[one], other)
            notes.append(f"{name(row)} hit {what} {partner}; {place(max(tick, 0), row)}")
    notes += [f"{name(v)} hit walker {walker}; {place(t, v)}" for t, v, walker in found.walkers]
    notes += [
        f"{name(p.vehicle)} passed light {recording.signal_id[p.signal]} under red; "
        f"{place(p.tick, p.vehicle)}"
        for p in run
    ]
    over = recording.lane_offset_m > recording.lane_half_width_m + OFF_ROAD_M
    for row in np.flatnonzero(off_road).tolist():
        tick = int(recording.lane_tick[np.flatnonzero(over[:, row])[0]])
        notes.append(f"{name(row)} left its lane; {place(tick, row)}")
    notes += [f"{name(row)} was inside a building; {place(t, row)}" for t, row in found.buildings]
    return notes
