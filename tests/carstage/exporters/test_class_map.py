"""Class maps: what each class becomes, and what is left out."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from analytic_dataset import edit_rows
from carstage.annotation.rle import encode_mask
from carstage.annotation.tracks import rider_track
from carstage.cli.app import app
from carstage.dataset import Dataset, decode_mask
from carstage.errors import BadInputError
from carstage.exporters import ClassMap, ExportOptions, export_dataset, read_class_map
from carstage.exporters.coco_categories import COCO80, COCO_CATEGORIES
from devkits import coco_marks

pytestmark = [
    pytest.mark.xdist_group("export"),
    # pycocotools 2.0.11 speaks numpy 1's protocol of arrays.
    pytest.mark.filterwarnings("ignore:__array__ implementation:DeprecationWarning"),
]
NAMED = ClassMap.of({"car": "vehicle", "truck": "vehicle", "walker_adult": "person"})
NUMBERED = ClassMap.of(
    {
        "walker_adult": {"name": "person", "id": 1},
        "car": {"name": "vehicle", "id": 0},
        "truck": {"name": "vehicle", "id": 0},
        "traffic_light": None,
    }
)
SIZE = (128, 192)
MOTORCYCLE = 50


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, ["export", *map(str, arguments), "--workers", "0"])


@pytest.fixture(scope="module")
def ridden(dataset: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The car is a motorcycle whose rider is the upper half of its pixels; the light a sign."""
    copy = Path(shutil.copytree(dataset, tmp_path_factory.mktemp("ridden") / "dataset"))

    def objects(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        made = []
        for row in rows:
            if row["class"] == "traffic_light":
                row |= {"class": "traffic_sign", "blueprint": "SM_StopSign_3"}
            if row["track_id"] == MOTORCYCLE:
                row |= {"class": "motorcycle"}
                made.append(
                    {**row, "class": "rider", "track_id": rider_track(MOTORCYCLE),
                     "parent_track_id": MOTORCYCLE}
                )  # fmt: skip
            made.append(row)
        return made

    def seen(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
        made = []
        for row in rows:
            made.append(row)
            if row["track_id"] == MOTORCYCLE and row["mask_modal"] is not None:
                mask = decode_mask(row["mask_modal"], *SIZE)
                y = np.flatnonzero(mask.any(axis=1))
                mask[(y[0] + y[-1] + 1) // 2 :] = False
                y, x = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
                made.append(
                    {**row, "track_id": rider_track(MOTORCYCLE), "bbox_amodal": None,
                     "mask_modal": encode_mask(mask, 0, 0, SIZE[1], SIZE[0]),
                     "visible_px": int(mask.sum()),
                     "bbox_modal": [float(v) for v in (x[0], y[0], x[-1] + 1, y[-1] + 1)]}
                )  # fmt: skip
        return made

    edit_rows(copy, "objects.parquet", objects)
    edit_rows(copy, "camera_objects.parquet", seen)
    return copy


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("kar: vehicle", "'kar' is no class. Did you mean 'car'"),
        ("- car", "no mapping"),
        ("car: [vehicle]", "the target of car is no name"),
        ("car: ''", "the target of car is no name"),
        ('car: "two\\nlines"', "the target of car is no name"),
        ("car: {name: a, number: 1}", "the target of car is no name"),
        ("car: {name: a, id: -1}", "the id of car"),
        ("car: {name: a, id: true}", "the id of car"),
        ("car: {name: a, id: 1}\nbus: {name: b, id: 1}", "'b' have the id 1"),
        ("car: {name: a, id: 1}\nbus: {name: a, id: 2}", "the ids 1 and 2"),
        ("car: {name: a, id: 1}\nbus: b", "'b' has no id"),
        ("car: null", "leaves out every class"),
        ("car: a\ncar: b", "stands twice"),
        ("car: [", "YAML|expected"),
        ("a" * (1 << 20) + ": b", "larger than 1 MiB"),
    ],
)
def test_a_file_that_says_nothing_clear_is_refused(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "map.yaml"
    path.write_text(text)
    with pytest.raises(BadInputError, match=words) as refused:
        read_class_map(path)
    assert "class-map: " in refused.value.message


def test_the_example_of_the_manual_is_read(tmp_path: Path) -> None:
    manual = Path(__file__).parents[3] / "docs/formats/exports.md"
    example = manual.read_text("utf-8").split("## Classes")[1].split("```yaml\n")[1].split("```")[0]
    (tmp_path / "map.yaml").write_text(example)
    assert read_class_map(tmp_path / "map.yaml").numbers(0) == {"vehicle": 1, "person": 0}


def test_the_command_refuses_a_bad_file_before_it_looks_at_the_dataset(tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("kar: vehicle\n")
    for file, words in ((tmp_path / "map.yaml", "Did you mean 'car'"), (tmp_path, "cannot be")):
        ended = run("coco", tmp_path / "none", tmp_path / "out", "--class-map", file)
        assert ended.exit_code == 2
        assert words in ended.stderr


@pytest.mark.parametrize(
    ("name", "choices", "words"),
    [
        ("coco", {"class_map": NAMED, "categories": "coco80"}, "categories and class-map"),
        ("coco", {"class_map": NAMED, "classes": ("bus",)}, "class: 'bus' has no target"),
        ("coco", {"categories": "coco80", "classes": ("pole",)}, "class: 'pole' has no target"),
        ("coco", {"categories": "voc"}, "categories: 'voc'"),
        ("yolo", {"class_map": ClassMap.of({"car": {"name": "a", "id": 1}})}, "none has the id 0"),
        ("kitti-object", {"class_map": NUMBERED}, "KITTI's types have none"),
        ("kitti-object", {"class_map": ClassMap.of({"car": "my car"})}, "no type for KITTI"),
        ("kitti-tracking", {"class_map": ClassMap.of({"rider": "Person"})}, "no 3D box"),
        ("nuscenes", {"class_map": NAMED}, "no category of nuScenes"),
        ("nuscenes", {"class_map": ClassMap.of({"rider": "animal"})}, "no 3D box"),
        (
            "nuscenes",
            {"class_map": ClassMap.of({"car": {"name": "vehicle.car", "id": 3}})},
            "numbers its own",
        ),
        ("123d", {"class_map": NAMED}, "does not use --class-map"),
    ],
)
def test_what_a_format_cannot_do_is_refused(
    dataset: Path, tmp_path: Path, name: str, choices: dict[str, Any], words: str
) -> None:
    with pytest.raises(BadInputError, match=words):
        export_dataset(name, dataset, tmp_path / "out", ExportOptions(**choices), workers=0)


@pytest.mark.parametrize(
    ("choices", "names"),
    [
        ({}, {"car", "truck", "walker_adult", "traffic_light"}),
        ({"class_map": NAMED}, {"vehicle", "person"}),
        ({"class_map": NUMBERED}, {"vehicle", "person"}),
        ({"categories": "coco80"}, {"car", "truck", "person", "traffic light"}),
    ],
)
@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_our_labels_as_detections_get_full_marks_whatever_they_are_called(
    exported, choices: dict[str, Any], names: set[str], kind: str
) -> None:
    pycocotools = pytest.importorskip("pycocotools.coco", reason="pycocotools is not installed")
    out = exported("coco", **choices)
    coco = pycocotools.COCO(str(out / "annotations/instances_train.json"))
    precision, found = coco_marks(coco, kind)
    assert precision == pytest.approx(1.0)
    assert found >= 12
    used = {row["category_id"] for row in coco.dataset["annotations"]}
    assert {row["name"] for row in coco.loadCats(sorted(used))} == names


def test_numbers_are_those_of_the_file_or_count_from_one(exported) -> None:
    def categories(**choices: Any) -> dict[int, str]:
        path = exported("coco", **choices) / "annotations/instances_train.json"
        return {row["id"]: row["name"] for row in json.loads(path.read_text())["categories"]}

    assert categories(class_map=NUMBERED) == {0: "vehicle", 1: "person"}
    assert categories(class_map=NAMED) == {1: "vehicle", 2: "person"}
    coco80 = categories(categories="coco80")
    assert len(coco80) == 80
    known = {1: "person", 3: "car", 6: "bus", 13: "stop sign", 44: "bottle", 90: "toothbrush"}
    assert {number: coco80[number] for number in known} == known
    assert not {12, 26, 29, 30, 45, 66, 68, 69, 71, 83} & set(coco80)


def test_coco_s_numbers_of_our_classes() -> None:
    numbers = COCO80.numbers_of_classes(1)
    assert numbers == {
        "car": 3, "van": 3, "truck": 8, "bus": 6, "motorcycle": 4, "bicycle": 2, "train": 7,
        "walker_adult": 1, "walker_child": 1, "walker_wheelchair": 1, "rider": 1,
        "traffic_light": 10, "traffic_sign": 13,
    }  # fmt: skip
    for name, target in COCO80.targets:
        assert COCO_CATEGORIES[numbers[name]][0] == target.name


@pytest.mark.parametrize(
    ("blueprint", "name"),
    [
        ("SM_StopSign_3", "stop sign"), ("BP_Stop_C_1", "stop sign"), ("BP_BusStop", None),
        ("SpeedLimit30", None), ("BP_Yield", None),
    ],
)  # fmt: skip
def test_of_signs_coco_has_stop_signs_alone(blueprint: str, name: str | None) -> None:
    target = COCO80.target("traffic_sign", blueprint)
    assert (target.name if target else None) == name


def test_a_rider_is_a_person_beside_the_vehicle_alone(ridden: Path, tmp_path: Path) -> None:
    options = ExportOptions(categories="coco80")
    export_dataset("coco", ridden, tmp_path / "coco", options, workers=0)
    document = json.loads((tmp_path / "coco/annotations/instances_train.json").read_text())
    by_picture: dict[int, dict[int, Any]] = {}
    for row in document["annotations"]:
        by_picture.setdefault(row["image_id"], {})[row["track_id"]] = row
    whole = {
        (row["k"], row["sensor_id"]): row
        for row in Dataset(ridden).episodes[0].camera_objects().to_pylist()
        if row["track_id"] == MOTORCYCLE
    }
    compared = 0
    for image in document["images"]:
        rows = by_picture.get(image["id"], {})
        if rider_track(MOTORCYCLE) not in rows or MOTORCYCLE not in rows:
            continue
        person, vehicle = rows[rider_track(MOTORCYCLE)], rows[MOTORCYCLE]
        assert (person["category_id"], vehicle["category_id"]) == (1, 4)
        masks = [decode_mask(row["segmentation"]["counts"], *SIZE) for row in (person, vehicle)]
        both = decode_mask(whole[image["k"], image["camera"]]["mask_modal"], *SIZE)
        assert not (masks[0] & masks[1]).any()
        np.testing.assert_array_equal(masks[0] | masks[1], both)
        assert vehicle["area"] == masks[1].sum()
        y, x = np.flatnonzero(masks[1].any(axis=1)), np.flatnonzero(masks[1].any(axis=0))
        assert vehicle["bbox"] == [x[0], y[0], x[-1] + 1 - x[0], y[-1] + 1 - y[0]]
        compared += 1
    assert compared >= 4
    assert 13 in {row["category_id"] for row in document["annotations"]}  # the stop sign


def test_a_two_wheeler_holds_its_rider_where_riders_are_not_exported(
    ridden: Path, tmp_path: Path
) -> None:
    export_dataset("coco", ridden, tmp_path / "coco", workers=0)
    document = json.loads((tmp_path / "coco/annotations/instances_train.json").read_text())
    areas = [row["area"] for row in document["annotations"] if row["track_id"] == MOTORCYCLE]
    rows = Dataset(ridden).episodes[0].camera_objects().to_pylist()
    whole = [r["visible_px"] for r in rows if r["track_id"] == MOTORCYCLE and r["visible"]]
    assert sorted(areas) == sorted(whole)


def test_what_has_no_target_is_counted(dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "map.yaml").write_text("car: vehicle\nwalker_adult: null\n")
    ended = run(
        "yolo", dataset, tmp_path / "out", "--class-map", tmp_path / "map.yaml", "--json"
    )  # fmt: skip
    assert ended.exit_code == 0, ended.stderr
    rows = Dataset(dataset).episodes[0].objects().to_pylist()
    expected = {
        name: sum(row["class"] == name for row in rows)
        for name in ("traffic_light", "truck", "walker_adult")
    }
    assert min(expected.values()) > 0
    assert json.loads(ended.stdout.splitlines()[-1])["classes_left_out"] == expected
    assert f"Left out: {expected['truck']} labels of class 'truck'" in ended.stderr
    written = json.loads((tmp_path / "out/export.json").read_text())["options"]["class_map"]
    assert written["targets"] == [["car", {"name": "vehicle", "id": None, "blueprint": ""}]]


def test_yolo_takes_names_and_numbers_of_the_map(exported) -> None:
    def names(out: Path) -> dict[int, str]:
        found: dict[int, str] = yaml.safe_load((out / "data.yaml").read_text())["names"]
        assert (out / "obj.names").read_text().splitlines() == list(found.values())
        return found

    def used(out: Path) -> set[int]:
        lines = [p.read_text().splitlines() for p in (out / "labels/train").iterdir()]
        return {int(line.split()[0]) for rows in lines for line in rows}

    out = exported("yolo", class_map=NUMBERED)
    assert names(out) == {0: "vehicle", 1: "person"}
    assert used(out) == {0, 1}
    out = exported("yolo", class_map=ClassMap.of({"truck": "no", "car": "yes: #1"}))
    assert names(out) == {0: "no", 1: "yes: #1"}
    out = exported("yolo", categories="coco80")
    found = names(out)
    assert len(found) == 80
    assert {found[number] for number in used(out)} == {"person", "car", "truck", "traffic light"}
    assert (found[0], found[2], found[9], found[79]) == (
        "person", "car", "traffic light", "toothbrush"
    )  # fmt: skip


def test_kitti_writes_the_types_of_the_map(exported) -> None:
    types = ClassMap.of({"car": "Car", "truck": "Car", "walker_adult": "DontCare"})
    for name, folder in (("kitti-object", "label_2"), ("kitti-tracking", "label_02")):
        training = exported(name, class_map=types) / "training" / folder
        rows = [line.split() for p in training.iterdir() for line in p.read_text().splitlines()]
        first = 0 if folder == "label_2" else 2
        assert {row[first] for row in rows} == {"Car", "DontCare"}
