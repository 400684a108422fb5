"""How labels compare with the truth: one row per object, and the figures of all rows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from benchmarks.framework.peer_methods import PeerDecision
from carstage.annotation.classes import WALKER_CLASSES
from carstage.annotation.pixels import occlusion_bin
from carstage.annotation.stage_vo import LEVEL_UNKNOWN
from carstage.bench.verdict import Figure
from carstage.geometry import Rectangle

MIN_VISIBLE_PX: Final = 10
"""From here on an object is visible, as ``labels.min_visible_px`` has it by default."""

BOX_PX: Final = 400
"""2D boxes are compared of objects with so many visible pixels."""

PARTLY: Final = (0.1, 0.9)
STAGE_VO: Final = "stage_vo"
METHODS: Final = ("instance", "depth and tags", "depth")
PEERS: Final = (
    "carla_2dbbox", "carla_2dbbox_as_described", "carfree", "carfree_any_size",
)  # fmt: skip
"""Methods of other tools; they have a decision and a box alone."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """The labels of an object by one method.

    Attributes:
        visible_px: pixels; None where the method counts none.
        ratio: occlusion, None where the method has none.
        level: occlusion 0, 1, 2; 3 unknown.
        visible: the decision.
        box_iou: of the modal 2D box with the true one; None where it has no such box, or the
            object too few pixels.
    """

    visible_px: int | None
    ratio: float | None
    level: int
    visible: bool
    box_iou: float | None = None


UNSEEN: Final = Estimate(0, 1.0, 2, visible=False, box_iou=0.0)
"""Stands for a missing row."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One object in one picture.

    Attributes:
        town: where.
        object_class: what.
        visible_px: its pixels, in truth.
        isolated_px: its pixels, were it the only thing there is.
        outside_px: pixels of the lone object outside the silhouette of its inflated box, or of the
            space that a walker's arms and legs reach.
        stray_px: visible pixels that the lone object does not have; the truth disagrees with
            itself by so much.
        labels: by method.
        missed_px: pixels whose depth is another without it; None: it was not taken away.
    """

    town: str
    object_class: str
    visible_px: int
    isolated_px: int
    outside_px: int
    stray_px: int
    labels: Mapping[str, Estimate]
    missed_px: int | None = None

    @property
    def ratio(self) -> float:
        """The true occlusion."""
        return max(0.0, 1.0 - self.visible_px / self.isolated_px)

    @property
    def visible(self) -> bool:
        """The true decision."""
        return self.visible_px >= MIN_VISIBLE_PX


def estimate(row: Mapping[str, Any] | None, true_box: Rectangle | None) -> Estimate:
    """The estimate of a row of ``camera_objects`` by the pixels.

    Args:
        row: None where labels have none.
        true_box: tight bounds of the visible pixels; None where they are not to be compared.
    """
    if row is None:
        return UNSEEN
    modal = row["bbox_modal"]
    overlap = None
    if true_box is not None:
        overlap = 0.0 if modal is None else iou(true_box, modal)
    return Estimate(
        row["visible_px"],
        row["occlusion_ratio"],
        row["occluded_px"],
        row["visible_pixel"],
        overlap,
    )


def estimate_by_vertices(row: Mapping[str, Any] | None) -> Estimate:
    """The estimate of a row of ``camera_objects`` by STAGE-VO."""
    if row is None:
        return Estimate(None, None, 2, visible=False)
    return Estimate(None, None, row["occluded"], row["visible_stage_vo"])


def estimate_by_peer(decision: PeerDecision, true_box: Rectangle | None) -> Estimate:
    """The estimate of a method that decides and gives a box."""
    overlap = None
    if true_box is not None:
        overlap = 0.0 if decision.box is None else iou(true_box, decision.box)
    return Estimate(None, None, LEVEL_UNKNOWN, decision.visible, overlap)


def iou(a: Sequence[float], b: Sequence[float]) -> float:
    """Intersection over union of two rectangles x0, y0, x1, y1 with an area."""
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    shared = max(0.0, width) * max(0.0, height)
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (a, b)]
    return shared / (sum(areas) - shared)


def f1(decided: Iterable[tuple[bool, bool]]) -> float:
    """F1 of decisions, given as pairs of truth and decision; NaN without any positive."""
    counts = Counter(decided)
    right, wrong = counts[True, True], counts[False, True] + counts[True, False]
    return 2.0 * right / (2.0 * right + wrong) if right + wrong else float("nan")


def figures(findings: Sequence[Finding], *, objects: int, classes: int, towns: int) -> list[Figure]:
    """Everything that was found, with its target where there is one.

    Args:
        findings: one per object and picture.
        objects: how many there have to be.
        classes: of how many classes.
        towns: in how many towns.
    """
    kinds, places = {f.object_class for f in findings}, {f.town for f in findings}
    return [
        Figure("objects", len(findings), ">=", objects),
        Figure("classes", len(kinds), ">=", classes),
        Figure("towns", len(places), ">=", towns),
        Figure("partly_hidden_objects", sum(map(_is_partly_hidden, findings))),
        Figure("objects_in_truth_visible", sum(f.visible for f in findings)),
        Figure("pixels_of_no_lone_object", sum(f.stray_px for f in findings)),
        Figure("objects_outside_their_hull", sum(f.outside_px > 0 for f in findings), "==", 0),
        Figure("instance_wrong_visible_px", _wrong_counts(findings, "instance"), "==", 0),
        Figure("objects_taken_away", sum(f.missed_px is not None for f in findings)),
        Figure("taken_away_wrong_visible_px", _wrongly_missed(findings), "==", 0),
        *_method(findings, "instance", Figure("instance_box_iou_least", _least(findings), "==", 1)),
        *_method(
            findings,
            "depth",
            Figure("depth_box_iou_median", _median(findings, "depth"), ">=", 0.95),
        ),
        *_method(
            findings,
            "depth and tags",
            Figure(
                "depth_and_tags_box_iou_median", _median(findings, "depth and tags"), ">=", 0.95
            ),
        ),
        Figure("stage_vo_f1", _f1(findings, STAGE_VO)),
        Figure("stage_vo_level_agrees", _level_agrees(findings, STAGE_VO)),
        Figure("stage_vo_free_objects_called_occluded", _free_called_occluded(findings, STAGE_VO)),
        Figure("stage_vo_level_unknown", _unknown(findings)),
        *(figure for peer in PEERS for figure in _peer(findings, peer)),
        *(
            figure
            for method in (*METHODS, STAGE_VO, *PEERS)
            for figure in _wrong_decisions(findings, method)
        ),
    ]


def table(found: Iterable[tuple[str, str]]) -> dict[str, dict[str, int]]:
    """Objects, given as class and town, counted by both."""
    counts = Counter(found)
    classes, towns = {kind for kind, _ in counts}, {town for _, town in counts}
    return {kind: {town: counts[kind, town] for town in sorted(towns)} for kind in sorted(classes)}


def _method(findings: Sequence[Finding], method: str, box: Figure) -> list[Figure]:
    name = method.replace(" ", "_")
    partly = [f for f in findings if _is_partly_hidden(f)]
    return [
        Figure(f"{name}_occlusion_error_mean", _ratio_error(findings, method), "<=", 0.03),
        Figure(f"{name}_occlusion_error_mean_partly", _ratio_error(partly, method), "<=", 0.08),
        box,
        Figure(f"{name}_f1", _f1(findings, method), ">=", 0.99),
        Figure(f"{name}_level_agrees", _level_agrees(findings, method)),
        Figure(f"{name}_free_objects_called_occluded", _free_called_occluded(findings, method)),
    ]


def _peer(findings: Sequence[Finding], method: str) -> list[Figure]:
    vehicles = [f for f in findings if f.object_class not in WALKER_CLASSES]
    return [
        Figure(f"{method}_f1", _f1(findings, method)),
        Figure(f"{method}_f1_vehicles", _f1(vehicles, method)),
        Figure(f"{method}_box_iou_median", _median(findings, method)),
    ]


def _wrong_decisions(findings: Sequence[Finding], method: str) -> list[Figure]:
    """Shares of what is visible, and of what is not, that a method has otherwise."""
    name = method.replace(" ", "_")
    hidden = (f.labels[method].visible for f in findings if not f.visible)
    missed = (not f.labels[method].visible for f in findings if f.visible)
    return [
        Figure(f"{name}_visible_called_hidden", _mean(missed)),
        Figure(f"{name}_hidden_called_visible", _mean(hidden)),
    ]


def _is_partly_hidden(finding: Finding) -> bool:
    return PARTLY[0] <= finding.ratio <= PARTLY[1]


def _mean(values: Iterable[float]) -> float:
    listed = list(values)
    return float(np.mean(listed)) if listed else float("nan")


def _ratio_error(findings: Sequence[Finding], method: str) -> float:
    """Mean absolute error; a missing ratio counts as wholly hidden."""
    found = ((f.ratio, f.labels[method].ratio) for f in findings)
    return _mean(abs(true - (1.0 if given is None else given)) for true, given in found)


def _wrong_counts(findings: Sequence[Finding], method: str) -> int:
    return sum(f.visible_px != f.labels[method].visible_px for f in findings)


def _wrongly_missed(findings: Sequence[Finding]) -> int:
    """Objects of which labels count other pixels than change when the object is taken away."""
    return sum(
        f.missed_px != f.labels["instance"].visible_px for f in findings if f.missed_px is not None
    )


def _ious(findings: Sequence[Finding], method: str) -> NDArray[np.float64]:
    found = (f.labels[method].box_iou for f in findings)
    return np.array([value for value in found if value is not None])


def _least(findings: Sequence[Finding]) -> float:
    ious = _ious(findings, "instance")
    return float(ious.min()) if len(ious) else float("nan")


def _median(findings: Sequence[Finding], method: str) -> float:
    ious = _ious(findings, method)
    return float(np.median(ious)) if len(ious) else float("nan")


def _f1(findings: Sequence[Finding], method: str) -> float:
    return f1((f.visible, f.labels[method].visible) for f in findings)


def _level_agrees(findings: Sequence[Finding], method: str) -> float:
    return _mean(occlusion_bin(f.ratio) == f.labels[method].level for f in findings)


def _free_called_occluded(findings: Sequence[Finding], method: str) -> float:
    free = [f for f in findings if occlusion_bin(f.ratio) == 0]
    return _mean(f.labels[method].level in (1, 2) for f in free)


def _unknown(findings: Sequence[Finding]) -> float:
    return _mean(f.labels[STAGE_VO].level == 3 for f in findings)
