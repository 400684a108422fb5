"""Drones and cameras at junctions, from configuration to labels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aerial_dataset import FRAMES
from carstage.dataset import Dataset, Episode
from carstage.dataset.masks import decode_mask
from carstage.validation import validate_dataset
from damage import edit_all, moved, put
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("aerial")]

STEP_S = 0.1
SINGLE_M = 1e-4
"""Places in the log have single precision."""


@pytest.fixture(scope="module")
def episode(aerial: Path) -> Episode:
    (only,) = Dataset(aerial).episodes
    return only


def places(view: Episode, column: str = "location") -> np.ndarray:
    """``(F, 3)`` by frame."""
    rows = sorted(view.ego().select(["k", column]).to_pylist(), key=lambda row: row["k"])
    return np.array([row[column] for row in rows])


def test_the_dataset_is_valid(aerial: Path) -> None:
    report = validate_dataset(aerial)
    assert report.problems == ()
    assert report.figures["frames"] == FRAMES


def test_a_drone_is_on_its_path_in_every_frame(episode: Episode) -> None:
    drone = episode.spec.agent("legs").drone
    assert drone is not None
    wanted = [drone.path.at(k * STEP_S).place for k in range(FRAMES)]
    assert np.allclose(places(episode.agent("legs")), wanted, atol=SINGLE_M)


def test_what_is_seen_is_seen_from_where_the_drone_is_said_to_be(episode: Episode) -> None:
    poses = episode.agent("legs").sensor_poses().to_pylist()
    own = places(episode.agent("legs"))
    for row in poses:
        assert np.allclose(row["location"], own[row["k"]], atol=SINGLE_M)


def test_velocities_of_drones_are_those_of_their_places(episode: Episode) -> None:
    for name in ("legs", "circle"):
        view = episode.agent(name)
        moved_m = np.diff(places(view), axis=0)
        assert np.allclose(places(view, "velocity")[1:], moved_m / STEP_S, atol=2e-2)
        speeds = [row["speed"] for row in view.ego().to_pylist()]
        assert max(speeds) <= 20.0 + 1e-3
        assert min(speeds[1:]) > 1.0


def test_a_gimbal_keeps_the_ego_in_the_middle(episode: Episode) -> None:
    view = episode.agent("circle")
    ego = episode.document["ego_id"]
    for frame in view.iter_frames():
        (box,) = (row for row in frame.camera_objects["CAM"] if row["track_id"] == ego)
        x0, y0, x1, y1 = box["bbox_amodal"]
        assert abs((x0 + x1) / 2 - 160) < 16
        assert abs((y0 + y1) / 2 - 120) < 16


def test_boxes_from_above_fit_the_pixels_of_their_objects(episode: Episode) -> None:
    fits = []
    for name in ("legs", "circle", "mast"):
        for frame in episode.agent(name).iter_frames():
            for row in frame.camera_objects["CAM"]:
                if row["mask_modal"] is None or row["instance_ambiguous"]:
                    continue
                rows, columns = np.nonzero(decode_mask(row["mask_modal"], 240, 320))
                extent = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
                assert row["bbox_modal"] == extent
                if row["outside_px"] or row["bbox_amodal"] is None:
                    continue  # a limb leaves its walker's capsule; riders have no box of their own
                x0, y0, x1, y1 = row["bbox_amodal"]
                assert x0 - 1 <= extent[0]
                assert y0 - 1 <= extent[1]
                assert x1 + 1 >= extent[2]
                assert y1 + 1 >= extent[3]
                vehicle = frame.objects[row["track_id"]]["class"] in ("car", "van", "truck", "bus")
                if vehicle and row["occluded_px"] == 0 and row["truncated"] == 0.0:
                    fits.append(
                        (extent[2] - extent[0]) * (extent[3] - extent[1]) / ((x1 - x0) * (y1 - y0))
                    )
    assert len(fits) > 10
    assert np.median(fits) > 0.7


def test_from_above_there_are_vehicles_pedestrians_and_crosswalks(episode: Episode) -> None:
    kinds: set[str] = set()
    lines: set[str] = set()
    for name in ("legs", "circle", "mast"):
        view = episode.agent(name)
        for frame in view.iter_frames():
            kinds.update(
                frame.objects[row["track_id"]]["class"]
                for row in frame.camera_objects["CAM"]
                if row["visible"]
            )
        table = view.lane_lines()
        assert table is not None
        lines.update(table["kind"].to_pylist())
    assert "car" in kinds
    assert any(kind.startswith("walker") for kind in kinds)
    assert {"crosswalk", "marking"} <= lines


def test_a_mast_stands_still_and_looks_down_at_the_junction(episode: Episode) -> None:
    view = episode.agent("mast")
    assert np.ptp(places(view), axis=0).max() == 0.0
    pitch_deg = places(view, "rotation_deg")[:, 0]
    assert np.all((pitch_deg > -60.0) & (pitch_deg < -5.0))


def test_a_drone_off_its_path_or_too_fast_is_found(aerial: Path, tmp_path: Path) -> None:
    off = linked_copy(aerial, tmp_path / "off")
    edit_all("agents/legs/ego", put("location", moved(0.05)))(off)
    assert "off its path" in " ".join(
        problem.message for problem in validate_dataset(off).problems if problem.check == "drones"
    )
    fast = linked_copy(aerial, tmp_path / "fast")

    def leap(row: dict[str, object]) -> None:
        if row["k"] == FRAMES - 1:
            row["location"] = moved(30.0)(row["location"])

    edit_all("agents/circle/ego", leap)(fast)
    assert "faster than 20 m/s" in " ".join(
        problem.message for problem in validate_dataset(fast).problems if problem.check == "drones"
    )
