"""Several episodes in one export: numbers go on, splits keep episodes whole."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from analytic_dataset import SIZE, add_episode, make_dataset
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset

pytestmark = pytest.mark.xdist_group("export")
SECOND = "fedcba9876543210"
HALF = ExportOptions(val_share=0.5)


@pytest.fixture(scope="module")
def two_episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes of two and of three frames."""
    work = tmp_path_factory.mktemp("raw")
    folder = make_dataset(tmp_path_factory.mktemp("two") / "out", work, size=SIZE, steps=2)
    add_episode(folder, work, SECOND, 3)
    return folder


def test_kitti_numbers_go_on_in_the_next_episode(two_episodes: Path, tmp_path: Path) -> None:
    export_dataset("kitti-object", two_episodes, tmp_path / "out", HALF, workers=0)
    sets = tmp_path / "out/ImageSets"
    assert (sets / "trainval.txt").read_text().split() == [f"{n:06d}" for n in range(5)]
    halves = [(sets / f"{split}.txt").read_text().split() for split in ("train", "val")]
    assert sorted(halves) == [["000000", "000001"], ["000002", "000003", "000004"]]


def test_kitti_tracking_has_a_sequence_per_episode(two_episodes: Path, tmp_path: Path) -> None:
    export_dataset("kitti-tracking", two_episodes, tmp_path / "out", workers=0)
    pictures = tmp_path / "out/training/image_02"
    assert {p.name: len(list(p.iterdir())) for p in pictures.iterdir()} == {"0000": 2, "0001": 3}
    for sequence in ("0000", "0001"):
        rows = (tmp_path / f"out/training/label_02/{sequence}.txt").read_text().splitlines()
        tracks = {int(row.split()[1]) for row in rows if "DontCare" not in row}
        assert min(tracks) == 0


def test_coco_ids_are_unique_over_both_splits(two_episodes: Path, tmp_path: Path) -> None:
    export_dataset("coco", two_episodes, tmp_path / "out", HALF, workers=0)
    ids, pictures = [], []
    for split in ("train", "val"):
        path = tmp_path / f"out/annotations/instances_{split}.json"
        document = json.loads(path.read_text())
        assert len({row["episode_id"] for row in document["images"]}) == 1
        ids += [row["id"] for row in document["annotations"]]
        pictures += [row["id"] for row in document["images"]]
        assert {row["image_id"] for row in document["annotations"]} <= {
            row["id"] for row in document["images"]
        }
    assert len(set(ids)) == len(ids)
    assert sorted(pictures) == list(range(1, 11))


def test_nuscenes_scenes_do_not_overlap_in_time(two_episodes: Path, tmp_path: Path) -> None:
    nuscenes = pytest.importorskip("nuscenes.nuscenes", reason="nuscenes-devkit is not installed")
    every_frame = replace(HALF, keyframes_hz=10.0)
    export_dataset("nuscenes", two_episodes, tmp_path / "out", every_frame, workers=0)
    nusc = nuscenes.NuScenes("v1.0-carstage", str(tmp_path / "out"), verbose=False)
    assert [scene["nbr_samples"] for scene in nusc.scene] == [2, 3]
    times = [sample["timestamp"] for sample in nusc.sample]
    assert times == sorted(times)
    # The same actor id in another episode is another instance.
    assert len(nusc.instance) == len({row["token"] for row in nusc.instance}) == 8
    assert len(nusc.map) == 1
    splits = json.loads((tmp_path / "out/v1.0-carstage/splits.json").read_text())
    assert sorted(map(len, splits.values())) == [1, 1]


def test_yolo_and_webdataset_part_the_episodes(two_episodes: Path, tmp_path: Path) -> None:
    for name in ("yolo", "webdataset"):
        export_dataset(name, two_episodes, tmp_path / name, HALF, workers=0)
    for split in ("train", "val"):
        pictures = list((tmp_path / "yolo/images" / split).iterdir())
        assert len({path.name.split("_")[0] for path in pictures}) == 1
        assert (tmp_path / "webdataset" / f"{split}-000000.tar").is_file()


def test_mcap_has_a_file_per_episode(two_episodes: Path, tmp_path: Path) -> None:
    export_dataset("mcap", two_episodes, tmp_path / "out", workers=0)
    assert sorted(path.stem for path in (tmp_path / "out").glob("*.mcap")) == [
        "0123456789abcdef", SECOND
    ]  # fmt: skip


def test_one_episode_is_exported_alone(two_episodes: Path, tmp_path: Path) -> None:
    chosen = ExportOptions(episodes=(SECOND,))
    summary = export_dataset("coco", two_episodes, tmp_path / "out", chosen, workers=0)
    assert (summary.episodes, summary.frames, summary.episodes_left_out) == (1, 3, ())


def test_an_unknown_episode_is_refused_with_those_that_there_are(
    two_episodes: Path, tmp_path: Path
) -> None:
    with pytest.raises(BadInputError, match="has no episode 00") as refused:
        export_dataset("coco", two_episodes, tmp_path / "o", ExportOptions(episodes=("00",)))
    assert SECOND in refused.value.hint
    assert not (tmp_path / "o").exists()
