"""The arithmetic below the checks."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import analytic_scene
from carstage.annotation.rle import encode_mask
from carstage.annotation.schema import TABLES
from carstage.conversion.segment import label_schema
from carstage.dataset import Episode
from carstage.dataset.calibration import SensorCalibration
from carstage.dataset.masks import decode_mask
from carstage.dataset.tables import RowSensor, arrow_type, read_table, row_sensor, write_table
from carstage.errors import DatasetError
from carstage.geometry import convex_hull
from carstage.spec import EpisodeSpec
from carstage.validation.checks.edges import (
    WINDOW,
    FrameFit,
    boundaries,
    check_windows,
    compare_edges,
    steepness,
)
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.labels import LabelTables
from carstage.validation.checks.ranging import RangingFigures, check_share
from carstage.validation.checks.silhouettes import check_hull_px, distance_outside
from carstage.validation.checks.tracks import check_tracks

coordinates = st.floats(-50.0, 50.0, width=32)
points = st.lists(st.tuples(coordinates, coordinates), min_size=3, max_size=12)


@settings(deadline=None)  # on a busy machine a call takes what it takes
@given(corners=points, tested=points)
def test_distance_to_a_hull_is_shapelys(
    corners: list[tuple[float, float]], tested: list[tuple[float, float]]
) -> None:
    hull = convex_hull(corners)
    polygon = shapely.Polygon(hull) if len(hull) >= 3 else None
    if polygon is None or polygon.area < 1.0:
        return
    found = distance_outside(hull, np.array(tested))
    expected = [polygon.distance(shapely.Point(point)) for point in tested]
    np.testing.assert_allclose(found, expected, atol=1e-6)


@settings(deadline=None)  # the first call loads compiled code
@given(mask=arrays.arrays(np.bool_, arrays.array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_a_mask_decodes_to_what_was_encoded(mask: np.ndarray) -> None:
    height, width = mask.shape
    counts = encode_mask(mask, 0, 0, width, height)
    np.testing.assert_array_equal(decode_mask(counts, height, width), mask)


def test_edges_are_steeper_where_labels_change_only_in_the_right_image() -> None:
    labels = np.zeros((60, 160), np.uint8)
    labels[10:50, 30:70] = 1
    labels[20:60, 90:150] = 2
    rgb = np.stack([labels * 90] * 3, axis=-1).astype(np.uint8)
    figures = compare_edges(rgb, steepness(rgb), boundaries(labels))
    for _ in range(4):
        figures.add(compare_edges(rgb, steepness(rgb), boundaries(labels)))
    ratio = figures.ratio
    assert ratio is not None
    assert ratio > 10.0
    mirrored = rgb[:, ::-1]
    wrong = compare_edges(mirrored, steepness(mirrored), boundaries(labels))
    for _ in range(4):
        wrong.add(compare_edges(mirrored, steepness(mirrored), boundaries(labels)))
    assert wrong.ratio is None or wrong.ratio < 1.1


def test_a_black_image_says_nothing() -> None:
    labels = np.zeros((200, 40), np.uint8)
    labels[:, ::8] = 1
    black = np.zeros((200, 40, 3), np.uint8)
    figures = compare_edges(black, steepness(black), boundaries(labels))
    assert figures.ratio is None


@pytest.mark.parametrize("name", sorted(TABLES))
def test_every_label_column_survives_parquet(name: str, tmp_path: object) -> None:
    schema = label_schema(TABLES[name])
    path = tmp_path / name  # type: ignore[operator]
    write_table(pa.Table.from_pylist([], schema=schema), path)
    assert read_table(path).schema.equals(schema)


def table_of(kind: str) -> RowSensor:
    table = row_sensor(kind)
    assert table is not None
    return table


def test_equal_tables_are_equal_bytes_whatever_metadata_and_chunks_they_have(tmp_path) -> None:
    schema = table_of("imu").schema
    payloads = [memoryview(np.full(7, 0.5 * k).tobytes()) for k in range(40)]
    rows = [table_of("imu").row(k, k / 10, payload) for k, payload in enumerate(payloads)]
    whole = pa.Table.from_pylist(rows, schema=schema)
    parts = pa.concat_tables(
        pa.Table.from_pylist(rows[i : i + 7], schema=schema) for i in range(0, 40, 7)
    ).replace_schema_metadata({"pandas": "index", "written": "now"})
    write_table(whole, tmp_path / "whole.parquet")
    write_table(parts, tmp_path / "parts.parquet")
    assert (tmp_path / "whole.parquet").read_bytes() == (tmp_path / "parts.parquet").read_bytes()
    assert read_table(tmp_path / "whole.parquet").equals(whole)


def test_a_vector_that_may_be_null_is_no_fixed_size_list() -> None:
    # Arrow 25 and other readers cannot read null fixed-size lists back from Parquet.
    assert pa.types.is_fixed_size_list(arrow_type("f64[3]", nullable=False))
    for name in ("f64[3]", "f64[8][2]"):
        assert pa.types.is_list(arrow_type(name, nullable=True))


def test_an_unknown_type_name_is_refused() -> None:
    with pytest.raises(ValueError, match="f128"):
        arrow_type("f128", nullable=False)


def test_a_missing_or_damaged_table_is_a_dataset_error(tmp_path) -> None:
    with pytest.raises(DatasetError, match="missing"):
        read_table(tmp_path / "x.parquet")
    (tmp_path / "x.parquet").write_bytes(b"PAR1 this is none PAR1")
    with pytest.raises(DatasetError, match="damaged"):
        read_table(tmp_path / "x.parquet")


def test_a_radar_frame_is_a_row_of_lists_and_comes_back_as_it_was() -> None:
    radar = table_of("radar")
    detections = np.array([[-2.5, 0.1, 0.05, 30.0], [1.0, -0.2, 0.0, 12.0]], "<f4")
    row = radar.row(3, 0.3, memoryview(detections.tobytes()))
    assert row["range_rate_m_s"] == [-2.5, 1.0]
    table = pa.Table.from_pylist([row, radar.row(4, 0.4, memoryview(b""))], schema=radar.schema)
    np.testing.assert_array_equal(radar.array(table.to_pylist()[0]), detections)
    assert radar.array(table.to_pylist()[1]).shape == (0, 4)
    with pytest.raises(ValueError, match="no whole number of detections"):
        radar.row(0, 0.0, memoryview(bytes(20)))
    with pytest.raises(ValueError, match="not finite"):
        radar.row(0, 0.0, memoryview(np.full(4, np.nan, "<f4").tobytes()))


@pytest.mark.parametrize(
    ("comparable", "agreeing", "frame", "right"),
    [
        (1000, 990, None, True),
        (1000, 989, None, False),
        (527, 521, None, True),
        (527, 500, None, False),
        (200, 190, 3, True),
        (200, 189, 3, False),
        (199, 0, 3, True),
    ],
)
def test_few_points_may_agree_less(
    comparable: int, agreeing: int, frame: int | None, right: bool
) -> None:
    findings = Findings("e")
    figures = RangingFigures(comparable, comparable, agreeing)
    check_share(figures, "LIDAR", "DEPTH", findings, frame=frame)
    assert (not findings.problems()) is right


@pytest.mark.parametrize(("deviation", "reported"), [(26.0, False), (6.0, True)])
def test_pictures_are_late_only_where_chance_does_not_explain_it(
    deviation: float, reported: bool
) -> None:
    pixels = 51
    fit = FrameFit(
        *(value for mean in (21.4, 24.9) for value in (
            mean * pixels, (mean**2 + deviation**2) * pixels, pixels
        ))
    )  # fmt: skip
    findings = Findings("episode")
    check_windows("CAM", [(k, fit) for k in range(WINDOW)], findings)
    assert bool(findings.problems()) is reported


@pytest.mark.parametrize(("hull_px", "reported"), [(6075, False), (6120, False), (6030, True)])
def test_an_edge_along_a_column_of_pixels_may_count_it_or_not(hull_px: int, reported: bool) -> None:
    camera = cast("SensorCalibration", SimpleNamespace(bent=None, width=240, height=136))
    hull = [(10.2, 20.2), (145.49975, 20.2), (145.49975, 65.2), (10.2, 65.2)]
    findings = Findings("episode")
    check_hull_px(camera, "object 57", {"hull_px": hull_px}, hull, findings, {"frame": 0})
    assert bool(findings.problems()) is reported


RUNNER = {"kind": "red_light_runner", "at_s": 0.0, "trigger_m": 25.0, "speed_m_s": 11.0,
          "before_s": 1.0}  # fmt: skip
SCENIC = {"kind": "scenic", "program": "0.scenic", "version": "3.0.0", "parameters": {},
          "mode_2d": True}  # fmt: skip


def light_problems(heads: list[list[str]], **changes: Any) -> list[str]:
    """What is found about the heads of a light with these states by frame, in a changed spec."""
    spec = EpisodeSpec.from_json({**analytic_scene.spec(), **changes})
    episode = SimpleNamespace(spec=spec, document={"server_version": "0.9.16", "actors": {}})
    rows = [
        {
            "k": k, "timestamp_s": 0.1 * k, "track_id": 2**52 + head, "parent_track_id": 30,
            "class": "traffic_light", "is_static": True, "semantic_tags": [7],
            "traffic_light_state": state,
        }
        for head, states in enumerate(heads)
        for k, state in enumerate(states)
    ]  # fmt: skip
    tables = LabelTables(
        *(
            pa.Table.from_pylist(content, schema=label_schema(TABLES[f"{name}.parquet"]))
            for name, content in (("objects", rows), ("camera_objects", []), ("ego", []))
        )
    )
    findings = Findings("e")
    check_tracks(cast(Episode, episode), tables, findings)
    return [problem.message for problem in findings.problems() if problem.check == "lights"]


@pytest.mark.parametrize("skipped", ["Red Yellow", "Yellow Green", "Green Red"])
def test_a_light_skips_no_state(skipped: str) -> None:
    (problem,) = light_problems([skipped.split()])
    assert "traffic_light_state" in problem
    assert light_problems([["Green", "Yellow", "Red", "Green"]]) == []


@pytest.mark.parametrize(
    "changes",
    [
        {"save_every": 10},
        {"timing": {**analytic_scene.spec()["timing"], "mode": "async"}},
        {"scenario": {"kind": "autopilot", "events": [RUNNER]}},
        {"scenario": SCENIC},
    ],
    ids=["saved seldom", "asynchronous", "set by an event", "set by a program"],
)
def test_a_light_may_skip_what_no_frame_shows_and_what_it_is_told_to(
    changes: dict[str, Any],
) -> None:
    assert light_problems([["Green", "Red", "Yellow", "Green"]], **changes) == []
    (problem, *_) = light_problems([["Green"], ["Green"], ["Red"]], **changes)
    assert "traffic_light_state" in problem
