"""Labels against truth: what is compared, and one town in short with the real client."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.framework import label_scores
from benchmarks.framework.clients.scene_setup import LIFT_M, on_grid
from benchmarks.framework.label_scores import Estimate, Finding, estimate, f1, figures, iou
from benchmarks.framework.labels import measure_labels
from benchmarks.framework.level_truth import LevelFinding, level_figures
from benchmarks.framework.masks import inside_polygon, tight_box
from carstage.bench.verdict import Verdict

RIGHT = Estimate(visible_px=600, ratio=0.4, level=1, visible=True, box_iou=1.0)
FINDING = Finding(
    town="Stage01",
    object_class="car",
    visible_px=600,
    isolated_px=1000,
    outside_px=0,
    stray_px=0,
    labels=dict.fromkeys(
        (*label_scores.METHODS, label_scores.STAGE_VO, *label_scores.PEERS), RIGHT
    ),
)


def judged(*findings: Finding) -> Verdict:
    found = figures(findings, objects=1, classes=1, towns=1)
    return Verdict("labels", tuple(found))


def with_instance(**changes: Any) -> Finding:
    return replace(FINDING, labels={**FINDING.labels, "instance": replace(RIGHT, **changes)})


def failed(verdict: Verdict) -> set[str]:
    return {figure.name for figure in verdict.figures if not figure.ok}


def test_labels_that_say_the_truth_pass() -> None:
    assert judged(FINDING).ok


@pytest.mark.parametrize(
    ("finding", "red"),
    [
        (with_instance(visible_px=599), {"instance_wrong_visible_px"}),
        (with_instance(box_iou=0.99), {"instance_box_iou_least"}),
        (with_instance(visible=False), {"instance_f1"}),
        (
            with_instance(ratio=0.5),
            {"instance_occlusion_error_mean", "instance_occlusion_error_mean_partly"},
        ),
        (replace(FINDING, outside_px=1), {"objects_outside_their_hull"}),
        (replace(FINDING, missed_px=599), {"taken_away_wrong_visible_px"}),
    ],
)
def test_each_kind_of_error_fails_its_own_figure(finding: Finding, red: set[str]) -> None:
    assert failed(judged(finding)) == red


LEVEL_FINDING = LevelFinding(
    town="Stage01",
    object_class="traffic_light",
    visible_px=100,
    labelled_px=100,
    visible=True,
    outside_px=0,
    box_iou=1.0,
)


@pytest.mark.parametrize(
    ("finding", "red"),
    [
        (LEVEL_FINDING, set()),
        (replace(LEVEL_FINDING, labelled_px=90), {"level_wrong_pixels_share"}),
        (replace(LEVEL_FINDING, outside_px=1), {"level_objects_outside_their_box"}),
        (replace(LEVEL_FINDING, box_iou=0.9), {"level_box_iou_median"}),
        (replace(LEVEL_FINDING, visible=False), {"level_f1"}),
    ],
)
def test_each_kind_of_error_about_the_level_fails_its_own_figure(
    finding: LevelFinding, red: set[str]
) -> None:
    assert {figure.name for figure in level_figures([finding]) if not figure.ok} == red


def test_too_few_objects_classes_or_towns_prove_nothing() -> None:
    found = figures([FINDING], objects=2, classes=2, towns=2)
    assert {figure.name for figure in found if not figure.ok} == {"objects", "classes", "towns"}


def test_an_object_without_a_row_counts_as_called_hidden() -> None:
    missing = estimate(None, (0.0, 0.0, 1.0, 1.0))
    assert (missing.visible_px, missing.ratio, missing.visible, missing.box_iou) == (0, 1, False, 0)


def test_a_row_without_a_modal_box_has_no_overlap_with_the_true_one() -> None:
    row = {
        "visible_px": 3,
        "occlusion_ratio": 0.9,
        "occluded_px": 2,
        "visible_pixel": False,
        "bbox_modal": None,
    }
    assert estimate(row, (0.0, 0.0, 20.0, 20.0)).box_iou == 0.0
    assert estimate(row, None).box_iou is None


def test_overlap_of_rectangles() -> None:
    assert iou((0, 0, 2, 2), (0, 0, 2, 2)) == 1.0
    assert iou((0, 0, 2, 2), (1, 0, 3, 2)) == pytest.approx(1 / 3)
    assert iou((0, 0, 2, 2), (2, 0, 3, 2)) == 0.0


def test_f1_counts_both_kinds_of_wrong_decisions() -> None:
    assert f1([(True, True), (False, False)]) == 1.0
    assert f1([(True, True), (False, True), (True, False)]) == 0.5
    assert np.isnan(f1([(False, False)]))


def test_the_tight_box_is_half_open() -> None:
    mask = np.zeros((10, 20), dtype=np.bool_)
    mask[3, 5] = mask[7, 6] = True
    assert tight_box(mask) == (5.0, 3.0, 7.0, 8.0)


def test_pixels_are_inside_a_polygon_by_their_centres() -> None:
    mask = np.ones((2, 2), dtype=np.bool_)
    triangle = [(0.0, 0.0), (2.0, 0.0), (0.0, 2.0)]
    assert inside_polygon(mask, triangle).tolist() == [True, True, True, False]
    assert not inside_polygon(mask, []).any()


@given(st.floats(-500.0, 900.0))
def test_a_lifted_height_is_exact_in_the_clients_floats(height_m: float) -> None:
    """So that camera and object keep their places to each other high above the town."""
    placed = on_grid(height_m)
    lifted = np.float32(placed + LIFT_M)
    assert float(lifted) - LIFT_M == placed == float(np.float32(placed))


@pytest.mark.end_to_end
@pytest.mark.xdist_group("bench")
def test_labels_of_a_town_are_true(tmp_path: Path) -> None:
    reported: list[int] = []
    verdict, objects = measure_labels(
        towns=["Stage01"],
        scenes=8,  # fewer than 50 visible objects bear no single pixel at the threshold
        size=(320, 180),
        taken_away=2,
        scratch=tmp_path,
        progress=lambda done, total: reported.append(done),
    )
    found = {figure.name: figure.value for figure in verdict.figures}
    assert reported == [1, 2, 3, 4, 5, 6, 7, 8]
    of_actors = [count["Stage01"] for name, count in objects.items() if "level" not in name]
    assert sum(of_actors) == found["objects"] >= 30
    assert {"car", "walker_adult", "traffic_light of the level"} <= set(objects)
    # At this size few signs and lights have the pixels from which boxes are compared.
    assert failed(verdict) <= {"objects", "towns", "level_box_iou_median"}, verdict.text()
    assert float(found["objects_taken_away"]) >= 3
    assert float(found["level_objects_seen"]) >= 3
    assert float(found["partly_hidden_objects"]) >= 3
    assert float(found["pixels_of_no_lone_object"]) <= 3
