"""Maps baked ahead: what is told, what fails, what is left to do at a load."""

from __future__ import annotations

import itertools

import pytest

from carstage_sim.cli import parse_bake
from carstage_sim.maps import MapCatalogue, UnknownTownError
from carstage_sim.prebake import prebake

pytestmark = pytest.mark.xdist_group("kernels")

_ROAD = (
    '<OpenDRIVE><header revMajor="1" revMinor="4"/><road id="1" junction="-1" length="{length}" '
    'name=""><link/><planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/>'
    '</geometry></planView><lanes><laneSection s="0"><center><lane id="0" type="none" '
    'level="false"/></center><right><lane id="-1" type="driving" level="false"><link/><width '
    'sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>'
    "</OpenDRIVE>"
)


@pytest.fixture
def maps(tmp_path) -> MapCatalogue:
    folder = tmp_path / "maps"
    folder.mkdir()
    for name, length in (("One", 100), ("Two", 120)):
        (folder / f"{name}.xodr").write_text(_ROAD.format(length=length))
    (folder / "Broken.xodr").write_text("<OpenDRIVE/>")
    return MapCatalogue([folder], {"Uno": "One"}, cache_folder=tmp_path / "towns")


def test_maps_are_baked_once_and_the_time_left_is_told(maps):
    told: list[str] = []
    seconds = itertools.count(0, 30)
    assert prebake(maps, ["One", "Uno", "Two"], told.append, lambda: float(next(seconds)))
    assert told[0] == "[1/2] One: baking"
    assert told[1].startswith("[1/2] One: ")
    assert told[1].endswith(", 30 s; about 30 s left")
    assert told[2].startswith("machine code and the shapes")
    assert told[3] == "[2/2] Two: baking; about 30 s left"
    assert told[4].endswith(", 30 s")
    assert len(told) == 5
    assert all(maps.is_baked(maps.source(name)) for name in ("One", "Two"))
    told.clear()
    assert prebake(maps, ["Two"], told.append)
    assert told[0] == "[1/1] Two: was baked before"


def test_a_map_that_fails_is_told_and_the_others_are_baked(maps):
    told: list[str] = []
    assert not prebake(maps, ["Broken", "One"], told.append)
    assert any("Broken.xodr" in line and "no <road>" in line for line in told)
    assert maps.is_baked(maps.source("One"))


def test_an_unknown_name_is_refused_before_anything_is_baked(maps, tmp_path):
    with pytest.raises(UnknownTownError, match="did you mean 'One'"):
        prebake(maps, ["Two", "Ones"], [].append)
    assert not (tmp_path / "towns").exists()


def test_names_may_be_spelled_as_clients_spell_them():
    task = parse_bake(["/Game/Carla/Maps/Town03", "--alias", "Mine=Town03"])
    assert task.names == ("Town03",)
    assert task.aliases == {"Mine": "Town03"}
    with pytest.raises(SystemExit):
        parse_bake(["--map", "Town03"])
