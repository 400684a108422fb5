"""The gallery shows every vehicle and pedestrian, and streets with somebody in them."""

from __future__ import annotations

import re

import numpy as np
import pytest
from PIL import Image

from benchmarks.simulator.render.gallery_page import (
    PAGE,
    GalleryPicture,
    busy_places,
    write_page,
)
from benchmarks.simulator.render.people_sheet import every_pedestrian, people_shots, person_mesh
from benchmarks.simulator.render.vehicle_sheet import every_vehicle
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind
from sensor_worlds import state

pytestmark = pytest.mark.xdist_group("kernels")


def test_the_page_names_every_picture_below_its_section(tmp_path):
    grey = np.full((8, 12, 3), 90, np.uint8)
    pictures = [
        GalleryPicture("Cars & vans", "one", grey),
        GalleryPicture("People", "two", grey + np.uint8(90)),
        GalleryPicture("Cars & vans", "three", grey),
    ]
    seen = []
    names = write_page(tmp_path / "new", iter(pictures), seen.append)
    text = (tmp_path / "new" / PAGE).read_text("utf-8")
    assert names == ["000.jpg", "001.jpg", "002.jpg"]
    assert re.findall('src="([^"]+)"', text) == ["000.jpg", "002.jpg", "001.jpg"]
    assert re.findall("<h2>(.*?)</h2>", text) == ["Cars &amp; vans", "People"]
    assert not re.search(r"https?://", text)
    assert [line.split()[0] for line in seen] == names
    with Image.open(tmp_path / "new" / "001.jpg") as picture:
        assert np.abs(np.asarray(picture).astype(int) - 180).max() < 4


def test_streets_are_looked_at_where_most_people_are():
    # Three look along x; somebody walks before the second, two before the third.
    places = np.array([[0.0, 0, 0, 0, 0, 0], [0, 100, 0, 0, 0, 0], [0, 200, 0, 0, 0, 0]])
    people = [(1, (15.0, 102.0, 1.0), 0.0), (2, (15.0, 198.0, 1.0), 0.0), (3, (20.0, 203.0, 1), 0)]
    assert busy_places(state(walkers=people), places, 2) == [2, 1]
    # A vehicle right before the eye hides all.
    parked = state(walkers=people, vehicles=[(9, (6.5, 200.0, 0.0), 0.0)])
    assert busy_places(parked, places, 1) == [1]
    # Places beside each other show the same.
    assert busy_places(state(walkers=people), np.repeat(places[2:], 2, axis=0), 2) == [0]


@pytest.mark.parametrize(
    ("shown", "kind", "sides"),
    [(every_vehicle, ActorKind.VEHICLE, 4), (every_pedestrian, ActorKind.WALKER, 3)],
)
def test_every_vehicle_and_pedestrian_is_shown_from_its_sides(shown, kind, sides):
    pictures = dict(shown(24, 16))
    assert list(pictures) == [b.id for b in catalogue().values() if b.kind == kind]
    for views in pictures.values():
        assert {view.shape for view in views} == {(16, 24, 3)}
        assert len(views) == sides
        assert not np.array_equal(views[0], views[-1])


def test_everybody_on_the_sheet_of_people_has_a_mesh():
    shots = list(people_shots())
    assert len({shot.name for shot in shots}) == len(shots) == 42
    for model in {one.model for shot in shots for one in shot.placements}:
        assert len(person_mesh(model).triangles) > 500
