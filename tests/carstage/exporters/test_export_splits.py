"""Exports take the splits of the dataset; none is empty without a word."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from analytic_dataset import SIZE, add_episode, make_dataset
from carstage.cli.app import app
from carstage.dataset import Dataset, FrameSamples, SplitRule, split_dataset
from carstage.dataset.splits import SPLITS
from carstage.errors import BadInputError
from carstage.exporters import ExportOptions, export_dataset
from devkits import NUSCENES_VERSION

pytestmark = pytest.mark.xdist_group("export")
FRAMES = {"0123456789abcdef": 1, "aaaaaaaaaaaaaaaa": 2, "fedcba9876543210": 3}


@pytest.fixture(scope="module")
def three(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Episodes of one, two and three frames, not divided. Do not change it."""
    work = tmp_path_factory.mktemp("raw")
    folder = make_dataset(tmp_path_factory.mktemp("three") / "out", work, size=SIZE, steps=1)
    for name, steps in list(FRAMES.items())[1:]:
        add_episode(folder, work, name, steps)
    return folder


@pytest.fixture
def divided(three: Path, tmp_path: Path) -> tuple[Path, dict[str, str]]:
    """A copy with an episode in each split; and the id of each split's."""
    folder = Path(shutil.copytree(three, tmp_path / "dataset"))
    stored = split_dataset(folder, SplitRule(val=0.3, test=0.3))
    return folder, {split: name for name, split in stored.episodes.items()}


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["export", *map(str, arguments), "--workers", "0"])


def test_coco_yolo_and_webdataset_follow_the_stored_splits(
    divided: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    folder, of_split = divided
    for name in ("coco", "yolo", "webdataset"):
        summary = export_dataset(name, folder, tmp_path / name, workers=0)
        assert summary.splits == {"train": 1, "val": 1, "test": 1}
        assert summary.warnings == ()
    shards = json.loads((tmp_path / "webdataset/shards.json").read_text())
    for split, episode in of_split.items():
        path = tmp_path / f"coco/annotations/instances_{split}.json"
        images = json.loads(path.read_text())["images"]
        assert {row["episode_id"] for row in images} == {episode}
        listed = (tmp_path / f"yolo/{split}.txt").read_text().split()
        assert {Path(line).name.split("_")[0] for line in listed} == {episode}
        assert shards[f"{split}-000000.tar"] == FRAMES[episode]
    document = yaml.safe_load((tmp_path / "yolo/data.yaml").read_text())
    for split in SPLITS:
        assert any((tmp_path / "yolo" / document[split]).iterdir())


def test_kitti_puts_test_frames_where_devkits_look_for_them(
    divided: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    folder, of_split = divided
    out = tmp_path / "object"
    export_dataset("kitti-object", folder, out, workers=0)
    lists = {name: (out / f"ImageSets/{name}.txt").read_text().split() for name in SPLITS}
    assert {name: len(rows) for name, rows in lists.items()} == {
        name: FRAMES[episode] for name, episode in of_split.items()
    }
    both = (out / "ImageSets/trainval.txt").read_text().split()
    assert sorted(both) == sorted(lists["train"] + lists["val"])
    for part, names in (("training", both), ("testing", lists["test"])):
        for kind in ("image_2", "velodyne", "calib", "label_2"):
            assert sorted(path.stem for path in (out / part / kind).iterdir()) == sorted(names)
    out = tmp_path / "tracking"
    export_dataset("kitti-tracking", folder, out, workers=0)
    for split, episode in of_split.items():
        row = (out / f"evaluate_tracking.seqmap.{split}").read_text().split()
        assert row[-1] == f"{FRAMES[episode]:06d}"
        pictures = out / ("testing" if split == "test" else "training") / "image_02" / row[0]
        assert len(list(pictures.iterdir())) == FRAMES[episode]


def test_nuscenes_names_the_scenes_of_each_split(
    divided: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    folder, of_split = divided
    export_dataset("nuscenes", folder, tmp_path / "out", workers=0)
    splits = json.loads((tmp_path / "out" / NUSCENES_VERSION / "splits.json").read_text())
    assert splits == {f"carstage_{split}": [f"scene-{name}"] for split, name in of_split.items()}


def test_shares_of_an_export_replace_the_stored_splits(
    divided: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    folder, _ = divided
    options = ExportOptions(val_share=0.3)
    summary = export_dataset("yolo", folder, tmp_path / "out", options, workers=0)
    assert summary.splits == {"train": 2, "val": 1}
    assert not (tmp_path / "out/test.txt").exists()
    kept = Dataset(folder).splits()
    assert sorted(kept.values()) == sorted(SPLITS)


@pytest.mark.parametrize("name", ["coco", "kitti-object", "kitti-tracking", "nuscenes", "yolo"])
def test_without_splits_there_is_a_warning_and_no_file_for_an_empty_split(
    three: Path, tmp_path: Path, name: str
) -> None:
    ended = run(name, three, tmp_path / "out")
    assert ended.exit_code == 0
    assert "All 3 episodes are in train; val and test are empty" in ended.stderr
    assert "carstage split" in ended.stderr
    found = [path.as_posix() for path in (tmp_path / "out").rglob("*")]
    assert found
    # `trainval` is KITTI's list of everything that has labels.
    assert not [path for path in found if "val" in Path(path).stem.replace("trainval", "")
                and not Path(path).name.startswith("evaluate_tracking.seqmap.train")]  # fmt: skip
    assert not [path for path in found if "test" in path.removeprefix(tmp_path.as_posix())]
    splits = tmp_path / "out" / NUSCENES_VERSION / "splits.json"
    if splits.exists():
        assert list(json.loads(splits.read_text())) == ["carstage_train"]


def test_formats_without_splits_do_not_warn(three: Path, tmp_path: Path) -> None:
    ended = run("mcap", three, tmp_path / "out", "--json")
    assert ended.exit_code == 0
    assert "warning" not in ended.stderr
    assert json.loads(ended.stdout.splitlines()[-1])["warnings"] == []


def test_a_share_that_would_leave_a_split_empty_is_refused(dataset: Path, tmp_path: Path) -> None:
    ended = run("coco", dataset, tmp_path / "out", "--val-share", 0.2)
    assert ended.exit_code == 2
    assert "1 episode cannot fill 2 splits (train, val)" in ended.stderr
    assert not (tmp_path / "out").exists()


def test_splits_that_do_not_fit_the_dataset_any_more_are_named(
    divided: tuple[Path, dict[str, str]], tmp_path: Path
) -> None:
    folder, of_split = divided
    (folder / f"commits/{of_split['val']}.json").unlink()
    ended = run("coco", folder, tmp_path / "out")
    assert ended.exit_code == 0
    assert of_split["val"] in ended.stderr
    assert "No episode is in val" in ended.stderr


def test_samples_come_from_one_split(divided: tuple[Path, dict[str, str]]) -> None:
    folder, of_split = divided
    for split, name in of_split.items():
        samples = FrameSamples(folder, lambda frame: frame.episode.id, split=split)  # type: ignore[arg-type]
        assert [samples[n] for n in range(len(samples))] == [name] * FRAMES[name]
    with pytest.raises(BadInputError, match="Both"):
        FrameSamples(folder, lambda frame: frame, split="val", episodes=[of_split["val"]])
