"""The vector map of a recorded town: shared, where the ego drives; each kind of damage is named."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from analytic_dataset import attempt_of
from carstage.dataset import Dataset
from carstage.dataset.tables import read_table, write_table
from carstage.files.hashing import hash_of
from carstage.validation.checks.findings import Findings
from carstage.validation.checks.vector_maps import VectorMapChecks
from carstage.vector_map import to_geojson
from carstage.vector_map.table import GEO_KEY
from carstage.vector_map.wkb import from_wkb, to_wkb
from recorded_dataset import linked_copy

pytestmark = [pytest.mark.end_to_end, pytest.mark.xdist_group("recorded")]

Row = dict[str, Any]


@pytest.fixture
def drive(recorded: Path, tmp_path: Path) -> Path:
    return linked_copy(recorded, tmp_path / "out", episodes=1)


def problems(dataset: Path) -> list[tuple[str, str]]:
    (episode,) = Dataset(dataset).episodes
    findings = Findings(episode.id)
    VectorMapChecks().check(episode, findings)
    return [(problem.severity, problem.message) for problem in findings.problems()]


def edit_document(dataset: Path, **changes: object) -> None:
    path = attempt_of(dataset) / "episode.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def edit_map(dataset: Path, edit: Callable[[list[Row]], list[Row]]) -> None:
    """Replace the map by a changed one that the episode names."""
    (path,) = (dataset / "maps").glob("*.parquet")
    table = read_table(path)
    rows = edit(table.to_pylist())
    write_table(pa.Table.from_pylist(rows, schema=table.schema), path, keep=(GEO_KEY,))
    named = hash_of(path.read_bytes())
    path.rename(path.with_name(f"{named.partition(':')[2]}.parquet"))
    edit_document(dataset, vector_map=named)


def test_two_drives_in_a_town_share_its_vector_map(recorded: Path) -> None:
    (kept,) = (recorded / "maps").glob("*.parquet")
    episodes = Dataset(recorded).episodes
    assert len(episodes) == 2
    assert {episode.vector_map_file for episode in episodes} == {kept}
    assert episodes[0].document["vector_map"] == hash_of(kept.read_bytes())
    table = episodes[0].vector_map_table()
    assert table is not None
    assert len(to_geojson(table)["features"]) == table.num_rows


def test_the_ego_drives_on_a_lane_of_the_map_and_as_it_runs(recorded: Path) -> None:
    for episode in Dataset(recorded).episodes:
        town = episode.vector_map()
        assert town is not None
        driving = [lane for lane in town.lanes if lane.type == "driving"]
        for row in episode.ego().select(["location", "rotation_deg"]).to_pylist():
            place, yaw = np.array(row["location"][:2]), np.radians(row["rotation_deg"][1])
            assert any(is_driven(lane.centre_line, place, yaw) for lane in driving)


def is_driven(line: np.ndarray, place: np.ndarray, yaw: float) -> bool:
    """Whether a place lies within 1 m of a line that runs as one looks, to 20 degrees."""
    begin, way = line[:-1, :2], np.diff(line[:, :2], axis=0)
    length = np.maximum((way**2).sum(axis=1), 1e-12)
    along = np.clip(((place - begin) * way).sum(axis=1) / length, 0, 1)
    apart = np.linalg.norm(begin + along[:, None] * way - place, axis=1)
    ahead = way @ [np.cos(yaw), np.sin(yaw)] / np.sqrt(length)
    return bool(((apart < 1.0) & (ahead > 0.94)).any())


def test_what_was_recorded_is_what_the_text_says(drive: Path) -> None:
    assert problems(drive) == []


def of(kind: str, change: Callable[[Row], object]) -> Callable[[list[Row]], list[Row]]:
    """Change the first row of a kind."""

    def edit(rows: list[Row]) -> list[Row]:
        change(next(row for row in rows if row["kind"] == kind and row["lanes"] != []))
        return rows

    return edit


def moved(column: str, metres: float) -> Callable[[Row], object]:
    def change(row: Row) -> None:
        shape, places = from_wkb(row[column])
        row[column] = to_wkb(shape, places + np.array([metres, 0, 0]))

    return change


def put(**values: object) -> Callable[[Row], object]:
    return lambda row: row.update(values)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (of("lane", moved("centre_line", 0.05)), "not where the OpenDRIVE text puts it"),
        (of("lane", moved("geometry", 1e-6)), "not where the episode's geo_reference puts it"),
        (of("lane", put(type="parking")), "not what the OpenDRIVE text says"),
        (of("lane", put(right_neighbour="9/9/9")), "names lane '9/9/9', which is not there"),
        (of("lane", put(left_markings=["x"])), "names marking 'x', which is not there"),
        (of("marking", put(colour="blue")), "not what the OpenDRIVE text says"),
        (of("marking", put(lanes=["9/9/9"])), "names a lane that is not there"),
        (of("crosswalk", put(id="none")), "crosswalks are not those of the OpenDRIVE text"),
        (of("stop_line", put(signals=["none"])), "names a signal that is not there"),
        (of("signal", put(kind="tree")), "a row of kind 'tree'"),
        (lambda rows: rows[1:], "which is not there"),
        (lambda rows: [r for r in rows if r["kind"] != "junction"], "junctions are not those"),
    ],
)
def test_damage_of_the_map_is_named(
    drive: Path, edit: Callable[[list[Row]], list[Row]], said: str
) -> None:
    edit_map(drive, edit)
    ((severity, message),) = problems(drive)
    assert severity == "error"
    assert said in message


def test_a_map_that_leads_back_nowhere_is_named(drive: Path) -> None:
    def forget(rows: list[Row]) -> list[Row]:
        next(row for row in rows if row["predecessors"])["predecessors"] = []
        return rows

    edit_map(drive, forget)
    ((_, message),) = problems(drive)
    assert "leads to a lane that does not name it" in message


def test_a_map_that_is_gone_cut_or_of_no_town_is_named(drive: Path) -> None:
    (path,) = (drive / "maps").glob("*.parquet")
    content = path.read_bytes()
    path.write_bytes(content[:-100])
    assert "its hash is not in its name" in problems(drive)[0][1]
    path.unlink()
    assert "cannot be read" in problems(drive)[0][1]
    path.write_bytes(content)
    edit_document(drive, opendrive=None)
    assert "no OpenDRIVE text" in problems(drive)[0][1]
    edit_document(drive, vector_map="../../etc")
    assert "is damaged" in problems(drive)[0][1]


def test_why_there_is_no_map_is_a_warning(drive: Path) -> None:
    edit_document(drive, vector_map=None, vector_map_problem="road 3 has no length")
    assert problems(drive) == [("warning", "the town has no vector map: road 3 has no length")]
