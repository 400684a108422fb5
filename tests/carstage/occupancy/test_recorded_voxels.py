"""Voxels of a recording: beside the scene's own surfaces, every edit found, exported."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import analytic_scene
from analytic_dataset import VERSIONS, attempt_of, convert, recommit
from carstage.birds_eye.visibility import CAMERA, LIDAR
from carstage.conversion.encoded import LABEL_PARTS
from carstage.conversion.segment import place_voxels
from carstage.dataset import Dataset
from carstage.errors import ConversionError, DatasetError
from carstage.exporters import ExportOptions, export_dataset
from carstage.exporters.formats.occ3d import OCC3D_CLASSES
from carstage.geometry import FLU_FROM_CARLA, invert_pose
from carstage.occupancy import (
    FREE,
    Occupancy,
    grid_from_world,
    pack_occupancy,
    unpack_occupancy,
)
from carstage.rawlog.writing import write_episode_file
from carstage.report.occupancy import occupancy_picture
from carstage.storage import FolderFiles, LocalStore
from carstage.tags import TAGS_0_9_14
from carstage.validation import validate_dataset

REACH = {"ahead_m": 32.0, "behind_m": 4.0, "left_m": 14.0, "right_m": 14.0}
STEPS, FRAME = 4, 3


def recorded(folder: Path, frame: str, ticks_per_segment: int = 2) -> Path:
    """Four frames in two segments, with voxels around the ego or a sensor."""
    raw = folder / "raw"
    header = analytic_scene.write_raw_log(
        raw,
        steps=STEPS,
        ticks_per_segment=ticks_per_segment,
        size=(96, 64),
        segmentation=True,
    )
    header["spec"]["labels"] |= {
        "occupancy": {"frame": frame, **REACH},
        "level_objects": ["parked_vehicles", "traffic_lights"],
    }
    write_episode_file(str(raw), header)
    store = LocalStore(folder / "out")
    store.initialise("voxels")
    convert(raw, store.attempt_folder(header["episode_id"], "a1"))
    store.keep_map(analytic_scene.OPENDRIVE.encode())
    store.commit(header["episode_id"], "a1", frames=STEPS, versions=VERSIONS)
    return folder / "out"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("voxels"), "ego")


@pytest.fixture(scope="module")
def around_lidar(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("sweeps"), "LIDAR_TOP")


@pytest.fixture
def dataset(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole, tmp_path / "out"))


def found(dataset: Path) -> list[str]:
    checks = ("occupancy", "file_missing", "file_unlisted", "file_unexpected", "unreadable")
    problems = validate_dataset(dataset).problems
    return [f"{one.check}: {one.message}" for one in problems if one.check in checks]


def content_of(dataset: Path, k: int = FRAME) -> Occupancy:
    (episode,) = Dataset(dataset).episodes
    content = episode.occupancy(k)
    assert content is not None
    return content


def off_surface(content: Occupancy, solid: analytic_scene.Solid) -> NDArray[np.float64]:
    """``(X, Y, Z)`` metres from the voxels' centres to the surface of a box."""
    rotation, center = solid.pose(FRAME * 0.1)
    centres = content.centres().reshape(-1, 3)
    world = (
        np.c_[centres, np.ones(len(centres))]
        @ invert_pose(grid_from_world(content.world_from_frame))[:3].T
    )
    local = np.abs((world - center) @ rotation) - np.array(solid.extent)
    outside = np.linalg.norm(np.maximum(local, 0.0), axis=1)
    inside = np.abs(np.minimum(local.max(axis=1), 0.0))
    return (outside + inside).reshape(content.grid.shape)


def test_voxels_are_where_the_scene_s_surfaces_are(whole: Path) -> None:
    content = content_of(whole)
    diagonal = 0.4 * np.sqrt(3.0)
    assert content.grid.shape == (90, 70, 16)
    road = np.abs(content.centres()[..., 2])
    tags = {solid.tag for solid in analytic_scene.SOLIDS} | {analytic_scene.ROAD}
    assert set(np.unique(content.semantic)) <= {*tags, FREE}
    assert (road[content.semantic == analytic_scene.ROAD] <= diagonal / 2.0).all()
    for tag in (analytic_scene.CAR, analytic_scene.TRUCK, analytic_scene.WALKER):
        near = np.min(
            [off_surface(content, one) for one in analytic_scene.SOLIDS if one.tag == tag], axis=0
        )
        here = content.semantic == tag
        assert here.sum() > 5
        assert (near[here] <= diagonal / 2.0 + 0.05).all()


def test_instances_are_boxes_and_move_as_they_do(whole: Path) -> None:
    content = content_of(whole)
    (episode,) = Dataset(whole).episodes
    rows = {row["track_id"]: row for row in episode.objects().to_pylist() if row["k"] == FRAME}
    tracks = content.voxels.track_id.tolist()
    assert {50, 51, 60} <= set(tracks)
    assert any(rows[track]["is_static"] for track in tracks)  # the parked car
    for track in tracks:
        there = content.tracks == track
        middle = content.centres()[there].mean(axis=0)
        box = FLU_FROM_CARLA @ np.array(rows[track]["box_center_ego"])
        assert middle == pytest.approx(box, abs=2.5)
        velocity = FLU_FROM_CARLA @ np.array(rows[track]["velocity_ego"])
        assert content.flow_m_s[there].mean(axis=0) == pytest.approx(velocity, abs=1e-4)


def test_other_frames_fill_what_one_frame_does_not_see(whole: Path) -> None:
    content = content_of(whole)
    assert (content.occupied & (content.seen == 0)).any()
    assert (content.visible_by_camera & ~content.visible_by_lidar).any()
    assert (content.visible_by_lidar & ~content.visible_by_camera).any()
    behind_truck = off_surface(content, analytic_scene.SOLIDS[1])
    assert content.seen[behind_truck < 0.2].any()


def test_segments_of_any_length_give_the_same_voxels(whole: Path, tmp_path: Path) -> None:
    other = recorded(tmp_path, "ego", ticks_per_segment=STEPS)
    for k in range(STEPS):
        files = [attempt_of(one) / f"occupancy/{k:06d}.npz" for one in (whole, other)]
        assert files[0].read_bytes() == files[1].read_bytes()


def test_a_part_that_is_gone_or_damaged_is_told(tmp_path: Path) -> None:
    recorded(tmp_path, "ego")
    raw, files = tmp_path / "raw", FolderFiles(tmp_path / "again")
    part = raw / LABEL_PARTS / "000001.occupancy.npz"
    assert len(place_voxels(raw, files, 0, 2).files) == 2
    part.write_bytes(part.read_bytes()[:1000])
    with pytest.raises(ConversionError, match="label part"):
        place_voxels(raw, files, 0, 2)
    part.unlink()
    with pytest.raises(ConversionError, match="label part"):
        place_voxels(raw, files, 0, 2)


def test_an_undamaged_dataset_has_the_voxels_that_follow(whole: Path, around_lidar: Path) -> None:
    assert found(whole) == []
    assert found(around_lidar) == []


def changed_class(content: Occupancy) -> None:
    content.semantic[tuple(np.argwhere(content.semantic == analytic_scene.ROAD)[0])] = 77


def class_of_a_car(content: Occupancy) -> None:
    content.semantic[tuple(np.argwhere(content.semantic == analytic_scene.ROAD)[0])] = 14


def car_that_is_a_truck(content: Occupancy) -> None:
    content.semantic[content.tracks == 50] = analytic_scene.TRUCK


def far_from_its_box(content: Occupancy) -> None:
    content.semantic[0, 0, 15] = 14
    content.voxels.instance[0, 0, 15] = 1


def other_track(content: Occupancy) -> None:
    content.voxels.track_id[-1] += 1


def faster(content: Occupancy) -> None:
    content.voxels.velocity_m_s[0, 0] += 0.1


def nothing_there(content: Occupancy) -> None:
    content.semantic[content.voxels.instance == 0] = FREE


def seen_behind(content: Occupancy) -> None:
    content.seen[tuple(np.argwhere(content.seen == 0)[0])] |= LIDAR


def not_seen(content: Occupancy) -> None:
    content.seen[content.seen & CAMERA > 0] ^= CAMERA


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (changed_class, "the class is no tag in 1 voxels"),
        (class_of_a_car, "class and instance do not go together in 1 voxels"),
        (car_that_is_a_truck, "voxels of road user 50 are not of class 14"),
        (far_from_its_box, "1 voxels of road user 50 are outside of its box"),
        (other_track, "has no box in this frame"),
        (faster, "velocity_m_s is not that of the boxes"),
        (nothing_there, "voxels explain"),
        (seen_behind, "visibility by LiDAR is wrong in 1 voxels"),
        (not_seen, "visibility by camera is wrong in"),
    ],
)
def test_every_edit_is_found(
    dataset: Path, edit: Callable[[Occupancy], None], message: str
) -> None:
    path = attempt_of(dataset) / f"occupancy/{FRAME:06d}.npz"
    content = unpack_occupancy(path.read_bytes())
    edit(content)
    path.write_bytes(pack_occupancy(content))
    recommit(dataset)
    assert any(message in one for one in found(dataset)), found(dataset)


def test_voxels_that_are_elsewhere_damaged_or_missing_are_found(dataset: Path) -> None:
    folder = attempt_of(dataset) / "occupancy"
    content = unpack_occupancy((folder / "000000.npz").read_bytes())
    content.world_from_frame[0, 3] += 0.01
    (folder / "000000.npz").write_bytes(pack_occupancy(content))
    (folder / "000001.npz").write_bytes(b"no voxels")
    (folder / "000002.npz").unlink()
    recommit(dataset)
    messages = found(dataset)
    assert "occupancy: occupancy/000000.npz: the voxels are not around ego" in messages
    assert any("000001.npz: the file does not decode" in one for one in messages)
    assert any(one.startswith("file_unlisted: occupancy/000002.npz") for one in messages)
    (episode,) = Dataset(dataset).episodes
    with pytest.raises(DatasetError, match=r"000001\.npz cannot be read"):
        episode.occupancy(1)


def test_the_picture_shows_road_users_in_their_colour_and_darkens_what_is_not_seen(
    whole: Path,
) -> None:
    content = content_of(whole)
    colours = np.asarray(occupancy_picture(content))
    vehicles = (TAGS_0_9_14[analytic_scene.TRUCK].rgb, TAGS_0_9_14[analytic_scene.CAR].rgb)
    assert all(rgb[:2] == (0, 0) for rgb in vehicles)  # blue alone
    blue = (colours[..., :2] == 0).all(axis=-1) & (colours[..., 2] > 20)
    assert blue.any()
    content.semantic[content.voxels.instance > 0] = FREE
    colours = np.asarray(occupancy_picture(content))
    assert not ((colours[..., :2] == 0).all(axis=-1) & (colours[..., 2] > 20)).any()
    content.seen[:] = 0
    assert np.asarray(occupancy_picture(content)).mean() < 0.8 * colours.mean()


def test_occ3d_reads_the_voxels_of_key_frames(whole: Path, tmp_path: Path) -> None:
    export_dataset("nuscenes", whole, tmp_path / "out", ExportOptions())
    files = sorted((tmp_path / "out/gts").glob("scene-*/*/labels.npz"))
    samples = {path.parent.name for path in files}
    assert len(samples) == len(files) == 1  # two key frames a second
    content = content_of(whole, 0)
    with np.load(files[0]) as labels:
        names = np.array(OCC3D_CLASSES)[labels["semantics"]]
        assert (names == "free").sum() == (content.semantic == FREE).sum()
        assert ((names == "truck") == (content.semantic == analytic_scene.TRUCK)).all()
        assert ((names == "driveable_surface") == (content.semantic == analytic_scene.ROAD)).all()
        assert (labels["mask_camera"] == content.visible_by_camera).all()
        assert (labels["mask_lidar"] == content.visible_by_lidar).all()
        assert labels["mask_camera"].dtype == labels["semantics"].dtype == np.uint8
        assert labels["flow"].shape == (*content.grid.shape, 2)
    assert not (tmp_path / "out/sequences").exists()


def unpacked(path: Path) -> NDArray[Any]:
    """As semantic-kitti-api does it."""
    compressed = np.fromfile(path, np.uint8)
    bits = np.zeros(compressed.shape[0] * 8, np.uint8)
    for place in range(8):
        bits[place::8] = compressed >> (7 - place) & 1
    return bits


def test_semantic_kitti_reads_voxels_around_the_lidar(around_lidar: Path, tmp_path: Path) -> None:
    export_dataset("semantickitti", around_lidar, tmp_path / "out", ExportOptions())
    folder = tmp_path / "out/sequences/00"
    content = content_of(around_lidar)
    shape, stem = content.grid.shape, folder / "voxels" / f"{FRAME:06d}"
    labels = np.fromfile(stem.with_suffix(".label"), np.uint16).reshape(shape)
    assert ((labels == 40) == (content.semantic == analytic_scene.ROAD)).all()
    assert (labels[content.semantic == analytic_scene.TRUCK] == 258).all()  # moving-truck
    assert ((labels > 0) <= content.occupied).all()
    hit = unpacked(stem.with_suffix(".bin")).reshape(shape)
    points = np.fromfile(folder / "velodyne" / f"{FRAME:06d}.bin", "<f4").reshape(-1, 4)
    cells = np.floor((points[:, :3] - np.array(content.grid.low_m)) / 0.4).astype(int)
    inside = ((cells >= 0) & (cells < shape)).all(axis=1)
    assert {tuple(cell) for cell in cells[inside].tolist()} == {
        tuple(cell) for cell in np.argwhere(hit).tolist()
    }
    occluded = unpacked(stem.with_suffix(".occluded")).reshape(shape)
    assert ((occluded == 0) == content.visible_by_lidar).all()
    invalid = unpacked(stem.with_suffix(".invalid")).reshape(shape)
    assert ((invalid == 1) == ((content.seen == 0) & ~content.occupied)).all()
