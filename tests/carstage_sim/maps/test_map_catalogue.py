"""Which map a program gets when it asks for a name."""

from __future__ import annotations

import logging
import os

import pytest

import small_maps
from carstage_sim.maps import (
    BakeOptions,
    MapCatalogue,
    MapFileError,
    UnknownTownError,
    generated_source,
)
from carstage_sim.maps.cache import prune
from carstage_sim.maps.checking import MapSamplingError


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "maps"
    place.mkdir()
    (place / "Town03.xodr").write_text(small_maps.one_road())
    (place / "Lane.xodr").write_text(small_maps.one_road())
    return place


def test_files_are_offered_under_their_names_beside_the_built_in_towns(folder):
    catalogue = MapCatalogue([folder])
    assert {"Stage01", "Town03", "Lane"} <= set(catalogue.names)
    assert MapCatalogue([folder / "Lane.xodr"]).names[-1] == "Lane"


def test_a_map_of_the_true_name_wins_over_every_alias(folder):
    catalogue = MapCatalogue([folder], {"Town03": "Stage01", "Town05": "Lane"})
    assert catalogue.resolve("Town03") == "Town03"
    assert catalogue.resolve("Town03_Opt") == "Town03"
    assert catalogue.resolve("Town05") == catalogue.resolve("Town05_Opt") == "Lane"
    assert "Town05" in catalogue.names


@pytest.mark.parametrize("name", ["Town01", "Town03", "Town04_Opt", "Town10HD", "Town10HD_Opt"])
def test_carlas_own_towns_have_a_stand_in_that_is_not_offered(name):
    catalogue = MapCatalogue()
    assert catalogue.resolve(name) in catalogue.names
    assert name in catalogue
    assert name not in catalogue.names


def test_a_stand_in_bears_the_name_that_was_asked_for_and_is_announced_once(caplog, stage01):
    catalogue = MapCatalogue()
    with caplog.at_level(logging.WARNING):
        town = catalogue.load("Town01")
        catalogue.load("Town01")
    assert town.name == "Town01"
    assert town.digest == stage01.digest
    assert [record.message for record in caplog.records] == [
        "there is no map Town01: Stage01 stands in for it"
    ]


def test_an_unknown_name_is_refused_with_the_nearest_one(folder):
    catalogue = MapCatalogue([folder])
    assert "Lan" not in catalogue
    with pytest.raises(UnknownTownError, match="did you mean 'Lane'"):
        catalogue.load("Lan")


@pytest.mark.parametrize("source", ["missing", "empty", "notes.txt"])
def test_a_source_without_a_map_is_refused_by_its_path(tmp_path, source):
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.txt").write_text("no map")
    with pytest.raises(MapFileError, match=source):
        MapCatalogue([tmp_path / source])


def test_an_alias_that_leads_nowhere_is_refused():
    with pytest.raises(MapFileError, match="alias City=Stage99"):
        MapCatalogue(aliases={"City": "Stage99"})


def test_a_broken_file_is_refused_by_its_path_and_leaves_no_cache(folder, tmp_path):
    (folder / "Broken.xodr").write_text("<OpenDRIVE/>")
    catalogue = MapCatalogue([folder], cache_folder=tmp_path / "cache")
    with pytest.raises(MapSamplingError, match=r"Broken\.xodr: .*no <road>"):
        catalogue.load("Broken")
    assert not (tmp_path / "cache").exists()


def test_a_generated_map_is_bare_and_a_broken_one_leaves_the_last(tmp_path):
    catalogue = MapCatalogue(cache_folder=tmp_path)
    walled = BakeOptions(scenery=False, wall_height_m=1.0)
    catalogue.generate(generated_source(small_maps.parking_street(), walled))
    with pytest.raises(MapSamplingError):
        catalogue.generate(generated_source("<OpenDRIVE/>", BakeOptions()))
    town = catalogue.load("OpenDriveMap")
    assert town.level_objects == ()
    assert (town.static_mesh.tag == 4).any()
    assert "OpenDriveMap" not in catalogue.names


def test_the_cache_keeps_the_newest_towns_of_a_name(tmp_path):
    for number in range(6):
        path = tmp_path / f"Town-{number}.npz"
        path.write_bytes(b"town")
        os.utime(path, (number, number))
    (tmp_path / "Other-0.npz").write_bytes(b"town")
    os.utime(tmp_path / "Other-0.npz", (0, 0))
    prune(tmp_path)
    kept = sorted(path.name for path in tmp_path.iterdir())
    assert kept == ["Other-0.npz", "Town-3.npz", "Town-4.npz", "Town-5.npz"]
