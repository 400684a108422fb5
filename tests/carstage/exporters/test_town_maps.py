"""GeoJSON and Lanelet2 of a dataset's towns: from the command line, read back by other readers."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from lxml import etree
from typer.testing import CliRunner

import analytic_scene
import small_maps
from analytic_dataset import SIZE, add_vector_map, make_dataset
from carstage.cli.app import app
from carstage.dataset import Dataset
from carstage.exporters import export_maps
from carstage.exporters.lanelet2 import to_lanelet2
from carstage.geometry import GeoFrame
from carstage.geometry.earth import GeoPoint
from carstage.vector_map import VectorMap, vector_map
from carstage_sim.maps.writer import PLANS, opendrive_of

pytestmark = pytest.mark.xdist_group("export")


@pytest.fixture(scope="module")
def drive(tmp_path_factory) -> Path:
    text = small_maps.document(
        small_maps.road(
            1, -40.0, 0.0, 0.0, 100.0,
            lanes=(("driving", 3.5), ("sidewalk", 2.0)),
            objects='<object id="7" type="crosswalk" name="walk" s="60" t="0" length="3" '
            'width="7" hdg="0"/>',
            signals=small_maps.light(9, 57.0, (-1, -1)),
        )
    )  # fmt: skip
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(analytic_scene, "OPENDRIVE", text)
        folder = make_dataset(
            tmp_path_factory.mktemp("drive") / "out", tmp_path_factory.mktemp("raw"), size=SIZE
        )
    add_vector_map(folder, text)
    return folder


def told(*arguments: str | Path) -> tuple[int, str]:
    answer = CliRunner().invoke(app, ["dataset", "maps", *map(str, arguments)])
    return answer.exit_code, answer.output


def test_geojson_is_the_vector_map_on_the_globe(drive, tmp_path) -> None:
    code, output = told(drive, tmp_path / "out", "--json")
    assert code == 0, output
    (name,) = json.loads(output.splitlines()[-1])["files"]
    document = json.loads(Path(name).read_text())
    (episode,) = Dataset(drive).episodes
    town, frame = episode.vector_map(), episode.geo_frame
    assert town is not None
    lanes = {
        feature["properties"]["id"]: shapely.from_geojson(json.dumps(feature["geometry"]))
        for feature in document["features"]
        if feature["properties"]["kind"] == "lane"
    }
    assert set(lanes) == {lane.id for lane in town.lanes}
    for lane in town.lanes:
        place = frame.place(lane.centre_line.mean(axis=0))
        at = shapely.Point(place.longitude_deg, place.latitude_deg)
        assert [one for one, area in lanes.items() if area.contains(at)] == [lane.id]


def test_what_is_asked_for_wrongly_is_refused_with_a_way_out(drive, dataset, tmp_path) -> None:
    code, output = told(drive, tmp_path / "out", "--format", "kml")
    assert (code, "Formats: geojson, lanelet2" in output) == (2, True), output
    code, output = told(drive, tmp_path / "out", "--map", "Town99")
    assert (code, "none of 'Town99'" in output) == (2, True), output
    code, output = told(dataset, tmp_path / "out")
    assert (code, "labels.vector_map: true" in output) == (2, True), output
    assert not (tmp_path / "out").exists()
    export_maps("geojson", drive, tmp_path / "out")
    code, output = told(drive, tmp_path / "out")
    assert (code, "--overwrite" in output) == (2, True), output


def test_equal_maps_give_equal_bytes(drive, tmp_path) -> None:
    for name in ("geojson", "lanelet2"):
        (one,) = export_maps(name, drive, tmp_path / f"{name}-a")
        (two,) = export_maps(name, drive, tmp_path / f"{name}-b")
        assert one.read_bytes() == two.read_bytes()


@pytest.fixture(scope="module")
def town() -> VectorMap:
    return vector_map(opendrive_of(PLANS["Stage01"]))


@pytest.fixture(scope="module")
def osm(town, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("osm") / "Stage01.osm"
    path.write_bytes(to_lanelet2(town, GeoFrame(GeoPoint(49.0, 8.0, 0.0))))
    return path


def test_lanes_that_follow_share_their_nodes(town, osm) -> None:
    root = etree.parse(str(osm)).getroot()
    ways = {way.get("id"): [nd.get("ref") for nd in way.iter("nd")] for way in root.iter("way")}
    ends = {}
    for relation in root.iter("relation"):
        tags = {tag.get("k"): tag.get("v") for tag in relation.iter("tag")}
        if tags.get("subtype") == "road":
            members = {one.get("role"): ways[one.get("ref")] for one in relation.iter("member")
                       if one.get("type") == "way"}  # fmt: skip
            ends[tags["carstage_id"]] = members
    driven = [lane for lane in town.lanes if lane.type == "driving"]
    assert set(ends) == {lane.id for lane in driven}
    for lane in driven:
        for following in lane.successors:
            for side in ("left", "right"):
                one, other = ends[lane.id][side], ends[following][side]
                assert {one[0], one[-1]} & {other[0], other[-1]}, (lane.id, following, side)


def test_the_library_routes_as_lanes_lead(town, osm) -> None:
    lanelet2 = pytest.importorskip("lanelet2", reason="Lanelet2's library is not installed")
    from lanelet2 import routing, traffic_rules
    from lanelet2.io import Origin, loadRobust
    from lanelet2.projection import UtmProjector

    read, errors = loadRobust(str(osm), UtmProjector(Origin(49.0, 8.0)))
    assert list(errors) == []
    by_name = {one.attributes["carstage_id"]: one for one in read.laneletLayer}
    rules = traffic_rules.create(
        traffic_rules.Locations.Germany, traffic_rules.Participants.Vehicle
    )
    graph = routing.RoutingGraph(read, rules)
    compared = 0
    for lane in town.lanes:
        if lane.type != "driving":
            continue
        found = {one.attributes["carstage_id"] for one in graph.following(by_name[lane.id])}
        assert set(lane.successors) <= found
        compared += len(lane.successors)
        length = np.linalg.norm(np.diff(lane.centre_line[:, :2], axis=0), axis=1).sum()
        # The library's globe is an ellipsoid, CARLA's a sphere.
        assert lanelet2.geometry.length2d(by_name[lane.id]) == pytest.approx(
            length, rel=0.02, abs=0.1
        )
    assert compared > 50
    assert len(list(read.regulatoryElementLayer)) > 0
