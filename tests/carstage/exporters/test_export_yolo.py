"""YOLO exports, read as Darknet and Ultralytics do."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from analytic_dataset import SIZE
from carstage.dataset import Dataset
from carstage.exporters import export_dataset

pytestmark = pytest.mark.xdist_group("export")


@pytest.mark.parametrize(
    ("choices", "column"), [({}, "bbox_modal"), ({"boxes": "amodal"}, "bbox_amodal")]
)
def test_boxes_come_back_from_shares_of_the_picture(
    exported, dataset, choices: dict[str, str], column: str
) -> None:
    out = exported("yolo", **choices)
    names = (out / "obj.names").read_text().split()
    width, height = SIZE
    rows = Dataset(dataset).episodes[0].camera_objects().to_pylist()
    compared = 0
    for line in (out / "train.txt").read_text().split():
        picture = out / line
        assert picture.is_file()
        # Both tools find the labels by replacing "images" in the path.
        labels = out / line.replace("images", "labels").replace(".png", ".txt")
        _, camera, frame = (
            picture.stem.split("_", 1)[0],
            *picture.stem.split("_", 1)[1].rsplit("_", 1),
        )
        seen = [r for r in rows if r["k"] == int(frame) and r["sensor_id"] == camera]
        for row in labels.read_text().splitlines():
            number, x, y, w, h = (float(value) for value in row.split())
            assert names[int(number)] in ("car", "truck", "walker_adult", "traffic_light")
            box = [(x - w / 2) * width, (y - h / 2) * height,
                   (x + w / 2) * width, (y + h / 2) * height]  # fmt: skip
            assert min(np.abs(np.subtract(box, r[column])).max() for r in seen) < 1e-3
            compared += 1
    assert compared >= 12


def test_both_tools_get_their_description(exported) -> None:
    out = exported("yolo")
    document = yaml.safe_load((out / "data.yaml").read_text())
    names = (out / "obj.names").read_text().split()
    assert list(document["names"].values()) == names
    assert list(document["names"]) == list(range(len(names)))
    assert (out / document["train"]).is_dir()
    assert any((out / document["val"]).iterdir())
    description = dict(line.split(" = ") for line in (out / "obj.data").read_text().splitlines())
    assert int(description["classes"]) == len(names)
    assert (out / description["train"]).is_file()


def test_chosen_classes_are_numbered_without_a_gap(exported) -> None:
    out = exported("yolo", classes=("traffic_light", "truck"))
    assert (out / "obj.names").read_text().split() == ["truck", "traffic_light"]
    files = (out / "labels/train").iterdir()
    numbers = {line.split()[0] for path in files for line in path.read_text().splitlines()}
    assert numbers == {"0", "1"}


def test_cameras_beside_the_ego_show_it_as_one_of_the_cars(watched, tmp_path: Path) -> None:
    export_dataset("yolo", watched, tmp_path / "out", workers=0)
    episode = Dataset(watched).episodes[0]
    width, height = SIZE
    (seen,) = [
        row
        for row in episode.camera_objects().to_pylist()
        if (row["k"], row["track_id"]) == (1, episode.document["ego_id"])
    ]
    x0, y0, x1, y1 = seen["bbox_modal"]
    box = [(x0 + x1) / 2 / width, (y0 + y1) / 2 / height, (x1 - x0) / width, (y1 - y0) / height]
    (path,) = (tmp_path / "out/labels/train").glob("*_CAM_FRONT_000001.txt")
    lines = [[float(value) for value in line.split()] for line in path.read_text().splitlines()]
    assert any(np.allclose(line, [0, *box], atol=1e-5) for line in lines)


def test_alexeyab_s_darknet_finds_the_labels(exported) -> None:
    out = exported("yolo")
    pictures = [out / line for line in (out / "train.txt").read_text().split()]
    assert pictures
    for picture in pictures:
        # As src/utils.c, replace_image_to_label: it knows COCO's and PASCAL VOC's folders only.
        path = str(picture).replace("/JPEGImages/", "/labels/")
        for part in ("train2017", "val2017", "train2014", "val2014"):
            path = path.replace(f"/images/{part}/", f"/labels/{part}/")
        found = Path(path).with_suffix(".txt").read_text()
        assert found == (out / "labels/train" / f"{picture.stem}.txt").read_text()


@pytest.mark.parametrize("split", ["val", "test"])
def test_without_training_ultralytics_gets_folders_that_are_there(
    dataset, tmp_path: Path, split: str
) -> None:
    copy = Path(shutil.copytree(dataset, tmp_path / "dataset"))
    shares = {"val": 0.2, "test": 0.2}
    document = {"format_version": 1, "seed": 0, "shares": shares, "stratify": []}
    episodes = {Dataset(copy).episodes[0].id: split}
    (copy / "splits.json").write_text(json.dumps({**document, "episodes": episodes}))
    export_dataset("yolo", copy, tmp_path / "out", workers=0)
    text = (tmp_path / "out/data.yaml").read_text()
    named = yaml.safe_load(text)
    assert named["train"] == named["val"] == f"images/{split}"
    assert (tmp_path / "out" / named["train"]).is_dir()
    assert f"# No episode is for training.\ntrain: images/{split}\n" in text
