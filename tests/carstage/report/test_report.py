"""The report is one page on its own, well-formed, and shows what validation found."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pyarrow as pa
import pytest
from PIL import Image

import analytic_dataset
from carstage.dataset import Dataset, Episode
from carstage.errors import BadInputError
from carstage.report import film, html, write_report, write_validation
from carstage.report.coverage import coverage_section
from carstage.report.episodes import _events, _summary
from carstage.report.page import _statistics
from carstage.report.statistics import bin_names, count_labels
from carstage.spec.road_users import GroupSpec
from carstage.validation import Problem, ValidationReport, validate_dataset
from carstage.validation.checks.catalogue import RULES
from carstage.validation.checks.figures import Figures
from carstage.validation.checks.findings import Findings, Severity

_VOID = {"meta", "img", "link", "br", "rect"}


class Balance(HTMLParser):
    """Checks that every element that is opened is closed in order."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.images: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag == "img":
            self.images.append(dict(attrs)["src"] or "")
        if tag not in _VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        pass

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def parse(page: str) -> Balance:
    parser = Balance()
    parser.feed(page)
    parser.close()
    assert parser.open == []
    return parser


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    return analytic_dataset.make_dataset(folder / "out", folder)


def test_the_page_is_well_formed_and_asks_for_nothing_from_outside(dataset: Path) -> None:
    path = write_report(dataset)
    assert path == dataset / "report.html"
    page = path.read_text("utf-8")
    parser = parse(page)
    # what is shown first; contact sheets, other views, from above; the map; four heat maps
    assert len(parser.images) == 2 + 1 + 2 + 2 * 2 * 6 + 2 * 3 + 2 + 1 + 4
    assert all(source.startswith("data:image/") for source in parser.images)
    assert not re.search(r"(?:src|href)=\"(?!data:)|url\(|@import|<script|https?://", page)
    text = " ".join(parser.text)
    for expected in ("valid", "CAM_FRONT", "Analytic01", "LIDAR_TOP", "walker_adult", "ClearNoon"):
        assert expected in text


def test_one_episode_is_not_told_as_many(dataset: Path) -> None:
    page = write_report(dataset).read_text("utf-8")
    assert "<b>1</b><span>episode</span>" in page
    assert "<span>sensors</span>" in page


def test_no_column_of_the_page_is_wider_than_a_phone(dataset: Path) -> None:
    page = write_report(dataset).read_text("utf-8")
    assert max(int(least) for least in re.findall(r"minmax\((\d+)px", page)) <= 320


def test_pictures_with_boxes_points_and_masks_come_before_maps_and_charts(dataset: Path) -> None:
    page = write_report(dataset).read_text("utf-8")
    captions = re.findall(r"<figcaption>(.*?)</figcaption>", page)
    assert [re.sub(r"^CAM_\w+", "CAM", caption).split(",")[0] for caption in captions[:5]] == [
        "CAM with 3D boxes", "CAM with 3D boxes", "LiDAR from above", "CAM with masks",
        "CAM with masks",
    ]  # fmt: skip
    order = [page.index(mark) for mark in ("<img", 'class="tiles"', "Where and when", "<svg")]
    assert order == sorted(order)
    masks = next(source for source, caption in zip(parse(page).images, captions, strict=True)
                 if "with masks" in caption)  # fmt: skip
    drawn = np.asarray(Image.open(io.BytesIO(base64.b64decode(masks.partition(",")[2]))))
    plain = Dataset(dataset).episodes[0].sensor("CAM_FRONT").read(0)
    assert drawn.shape[1] >= plain.shape[1]
    assert len(np.unique(drawn.reshape(-1, 3), axis=0)) > 10


def test_names_from_the_data_are_escaped(dataset: Path, tmp_path: Path) -> None:
    page = write_report(dataset, tmp_path / "other.html").read_text("utf-8")
    assert "analytic &lt;scene&gt;" in page
    assert "<scene>" not in page


def test_problems_stand_on_the_page(dataset: Path, tmp_path: Path) -> None:
    (analytic_dataset.attempt_of(dataset) / "notes.txt").write_text("mine")
    path = write_report(dataset, tmp_path / "r.html", validation=validate_dataset(dataset))
    text = " ".join(parse(path.read_text("utf-8")).text)
    assert "1 warning" in text
    assert "notes.txt lies in the folder" in text


def test_frames_that_a_sensor_lacks_are_left_out(dataset: Path, tmp_path: Path) -> None:
    """Under `on_incomplete: skip` a valid dataset may lack any of them."""
    copy = Path(shutil.copytree(dataset, tmp_path / "out"))
    sensors = analytic_dataset.attempt_of(copy) / "sensors"
    whole = parse(write_report(copy).read_text("utf-8"))
    for sensor in ("CAM_LEFT", "DEPTH_FRONT", "LIDAR_TOP"):
        for path in sorted((sensors / sensor).iterdir())[:-1]:
            path.unlink()
    some = parse(write_report(copy).read_text("utf-8"))
    assert 0 < len(some.images) < len(whole.images)
    assert any("CAM_LEFT" in text for text in some.text)


def test_a_chart_of_nothing_is_still_a_chart() -> None:
    parse(html.page("t", html.bars("Empty", []) + html.bars("Zero", [("a", 0, None)])))


def test_without_lidars_nothing_is_told_of_their_points(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    episodes = Dataset(dataset).episodes
    usual = Episode.objects
    assert "LiDAR points" in _statistics(count_labels(episodes))

    def without(episode: Episode) -> pa.Table:
        table = usual(episode)
        at = table.column_names.index("num_lidar_points")
        none = pa.array([[]] * table.num_rows, table.schema.field(at).type)
        return table.set_column(at, "num_lidar_points", none)

    monkeypatch.setattr(Episode, "objects", without)
    counted = count_labels(episodes)
    assert counted.records > 0
    assert "LiDAR points" not in _statistics(counted)


def test_bins_of_counts_end_before_the_next_and_bins_of_lengths_meet() -> None:
    assert bin_names((0, 1, 5), "") == ["0", "1–4", "5+"]
    assert bin_names((0, 10, 20), " m") == ["0–10 m", "10–20 m", "20+ m"]


def test_films_show_every_frame_with_its_boxes(dataset: Path, tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="PyAV is not installed")
    verdict = validate_dataset(dataset)
    path = write_report(dataset, tmp_path / "films.html", validation=verdict, films=True)
    sources = re.findall(r'<video src="data:video/mp4;base64,([^"]+)"', path.read_text("utf-8"))
    assert len(sources) == 2  # CAM_FRONT, CAM_LEFT
    with av.open(io.BytesIO(base64.b64decode(sources[0]))) as container:
        pictures = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
        assert container.streams.video[0].average_rate == 10
    assert len(pictures) == 6
    plain = Dataset(dataset).episodes[0].sensor("CAM_FRONT").read(3).astype(int)
    difference = np.abs(pictures[3].astype(int) - plain).max(axis=2)
    assert (difference > 60).sum() > 100  # the lines of boxes
    assert np.median(difference) < 8  # the rest is the picture


def test_films_without_the_extra_are_refused(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(film, "find_spec", lambda name: None)
    with pytest.raises(BadInputError, match="not installed"):
        write_report(dataset, films=True)


def test_the_map_shows_where_the_ego_went(dataset: Path) -> None:
    page = coverage_section(Dataset(dataset).episodes)
    (source,) = parse(page).images
    picture = Image.open(io.BytesIO(base64.b64decode(source.partition(",")[2]))).convert("RGB")
    pixels = np.asarray(picture).reshape(-1, 3)
    ego, others = (255, 200, 40), (74, 118, 190)
    assert (pixels == ego).all(axis=1).sum() > 50
    assert (pixels == others).all(axis=1).sum() > 50
    assert "Analytic01" in page
    assert "ClearNoon" in page


def test_a_verdict_is_a_page_of_its_own_that_names_every_check(
    dataset: Path, tmp_path: Path
) -> None:
    report = validate_dataset(dataset)
    out = write_validation(dataset, report, tmp_path / "verdict.html")
    page = out.read_text("utf-8")
    text = parse(page).text
    assert "analytic <scene>" in text
    assert not re.search(r"(?:src|href)=|url\(|@import|<script|https?://", page)
    assert set(RULES) <= set(text)


def test_a_verdict_lists_errors_before_warnings(dataset: Path, tmp_path: Path) -> None:
    problems = (
        Problem("exposure", "warning", "e", None, "CAM", "3 of 4 images are black"),
        Problem("hull", "error", "e", 2, "CAM", "object 7: <outside>"),
    )
    counts: dict[str, dict[Severity, int]] = {name: {"error": 0, "warning": 0} for name in RULES}
    counts["exposure"]["warning"], counts["hull"]["error"] = 1, 40
    report = ValidationReport(problems, counts, Figures().to_dict(0))
    text = parse(write_validation(dataset, report, tmp_path / "v.html").read_text("utf-8")).text
    assert text.index("object 7: <outside>") < text.index("3 of 4 images are black")
    assert "40 errors" in text
    assert "✗ not valid" in text


def test_the_documentation_names_every_check() -> None:
    page = Path(__file__).parents[3] / "docs" / "formats" / "dataset.md"
    assert [name for name in RULES if f"`{name}`" not in page.read_text("utf-8")] == []


def test_a_problem_of_no_check_is_refused() -> None:
    with pytest.raises(ValueError, match="hulk"):
        Findings("e").add("hulk", "green")


def test_vehicles_of_all_groups_were_asked_for(dataset: Path) -> None:
    (episode, *_) = Dataset(dataset).episodes
    plan = replace(episode.spec.vehicles, count=3, groups=(GroupSpec(4, "vehicle.*", None),))
    asked = SimpleNamespace(
        spec=replace(episode.spec, vehicles=plan),
        document={**episode.document, "spawned": {"vehicles": 7, "pedestrians": 0}},
        variant=None,
        frames=episode.frames,
    )
    assert "7 of 7 vehicles and" in _summary(cast("Episode", asked))


def test_events_of_a_storyboard_go_by_their_names_in_the_file() -> None:
    story = {"act": "A", "group": "G", "maneuver": "M", "event": "Cut in", "execution": 2}
    row = {
        "state": "happened", "begin_s": 1.0, "end_s": None, "actors": [7], "min_ttc": None,
        "min_distance": 3.21, "collision": False, "reason": None,
    }  # fmt: skip
    rows = [
        {**row, "kind": "storyboard_event", "parameters": json.dumps(story)},
        {
            **row,
            "kind": "storyboard_action",
            "parameters": json.dumps({**story, "action": "Left", "execution": 1}),
        },
        {**row, "kind": "cut_in", "parameters": "{}"},
    ]
    episode = SimpleNamespace(events=lambda: SimpleNamespace(to_pylist=lambda: rows))
    text = parse(_events(cast(Episode, episode))).text
    assert [one for one in text if one in {"Cut in (2)", "Cut in: Left", "cut_in"}] == [
        "Cut in (2)", "Cut in: Left", "cut_in",
    ]  # fmt: skip
    assert text.count("1.0 s to the end") == 3
    assert text.count("3.2 m") == 3
