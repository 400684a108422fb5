"""Good traffic passes, and each fault fails the figure that is there to show it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.simulator.traffic import campaign
from benchmarks.simulator.traffic.campaign import check_traffic, judge_saved
from benchmarks.simulator.traffic.judging import judge
from benchmarks.simulator.traffic.recording import Recording
from carstage.bench.verdict import Verdict
from traffic_recordings import collisions, recording

TICKS = 240


def flowing(**columns: Any) -> Recording:
    """Two vehicles at 6 m/s where free flow is 7 m/s."""
    x = np.arange(TICKS)[:, None] * 3.0 + np.array([0.0, 40.0])
    return recording(x, **columns)


def failed(verdict: Verdict) -> list[str]:
    return [figure.name for figure in verdict.figures if not figure.ok]


def test_good_traffic_passes() -> None:
    verdict = judge(flowing())
    assert verdict.ok, verdict.text()


def test_the_mean_speed_is_held_against_free_flow_not_the_limit() -> None:
    figures = {figure.name: figure.value for figure in judge(flowing()).figures}
    assert figures["mean_speed_limit_kmh"] == pytest.approx(36.0)
    assert figures["mean_speed_percent_of_free_flow"] == pytest.approx(100 * 6 / 7, rel=0.01)


def test_speed_without_a_known_free_flow_does_not_pass() -> None:
    assert failed(judge(flowing(free_flow=float("nan")))) == ["mean_speed_percent_of_free_flow"]


def test_a_removed_vehicle_counts_as_stuck() -> None:
    gone = flowing()
    for column in (gone.location, gone.yaw_deg, gone.speed, gone.speed_limit_kmh):
        column[-10:, 0] = np.nan
    verdict = judge(gone)
    assert failed(verdict) == ["stuck_percent"]
    assert "was removed" in verdict.notes[0]


def test_changing_lanes_is_not_leaving_the_road() -> None:
    between = np.where(np.arange(TICKS)[:, None] == 9, [[1.8, 0.0]], 0.0)
    assert judge(flowing(lane_offset_m=between)).ok


def test_a_jam_is_stuck_and_slow() -> None:
    assert failed(judge(recording(np.zeros((TICKS, 1))))) == [
        "stuck_percent",
        "mean_speed_percent_of_free_flow",
    ]


@pytest.mark.parametrize(
    ("columns", "figure"),
    [
        (collisions((5, 10, 11, 0)), "collisions_per_100_vehicle_minutes"),
        (collisions((5, 10, 0, 2)), "collisions_per_100_vehicle_minutes"),
        (
            {"walker_location": np.tile([90.0, 0.5, 1.0], (TICKS, 1, 1))},
            "collisions_with_walkers_per_1000_vehicle_minutes",
        ),
        ({"lane_offset_m": np.full((TICKS, 2), 0.4)}, "mean_lateral_error_m"),
        (
            {"lane_offset_m": np.where(np.arange(TICKS)[:, None] == 9, [[2.1, 0.0]], 0.0)},
            "vehicles_off_the_road",
        ),
        (
            {
                "building_center": np.array([[90.0, 0.0, 5.0]]),
                "building_extent": np.array([[5.0, 5.0, 5.0]]),
                "building_yaw_deg": np.zeros(1),
            },
            "vehicles_inside_buildings",
        ),
        (
            {
                "signal_id": np.array([5]),
                "signal_state": np.zeros((TICKS, 1), np.uint8),
                "stop_signal": np.array([0]),
                "stop_pose": np.array([[90.0, 0.0, 0.0, 0.0]]),
                "stop_width_m": np.array([3.5]),
            },
            "red_lights_run_per_200",
        ),
    ],
)
def test_each_fault_fails_its_figure(columns: dict[str, Any], figure: str) -> None:
    verdict = judge(flowing(**columns))
    assert failed(verdict) == [figure]
    assert len(verdict.notes) >= 1 or figure == "mean_lateral_error_m"


def test_saved_recordings_are_judged_alike(tmp_path: Path) -> None:
    kept = [replace(flowing(), town=town) for town in ("Kept", "Alike")]
    for recording_of_town in kept:
        recording_of_town.save(tmp_path / f"{recording_of_town.town}.npz")
    assert judge_saved(tmp_path).verdicts == {one.town: judge(one) for one in kept}


def test_the_folder_for_recordings_is_there_before_the_first_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drive(_town: str, *, save_to: Path, **_options: object) -> Recording:
        assert save_to.parent.is_dir()
        return flowing()

    monkeypatch.setattr(campaign, "drive", drive)
    assert check_traffic(["Stage01"], save_in=tmp_path / "new" / "drives").verdicts
