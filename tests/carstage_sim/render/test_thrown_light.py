"""Light that streets and houses throw back, and that of farther lamps."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.kernels import kernel
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.street_lamps import StreetLamps
from carstage_sim.mesh import Material, build_mesh
from carstage_sim.render.lamps import lamps_of, lamps_switched
from carstage_sim.render.scene import SceneStore
from carstage_sim.render.thrown_light import NEAR_M, STEP_M, ThrownLight, thrown_light
from carstage_sim.world.town_changes import TownChanges
from ray_scenes import turned_box

pytestmark = pytest.mark.xdist_group("kernels")

UP, DOWN, EAST, WEST = (0, 0, 1), (0, 0, -1), (1, 0, 0), (-1, 0, 0)


@kernel
def thrown(lamps, places, normals, out):
    for i in range(places.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = thrown_light(
            lamps, places[i, 0], places[i, 1], places[i, 2], normals[i, 0], normals[i, 1],
            normals[i, 2],
        )  # fmt: skip


def light(lamp_places, power, places, normals):
    """``(N, 3)`` irradiance of places on surfaces."""
    where = np.array(lamp_places, np.float64).reshape(-1, 3)
    lamps = lamps_switched(
        lamps_of(StreetLamps(where, np.zeros(len(where), np.uint32))),
        np.array(power, np.float32).reshape(-1, 3),
        ThrownLight(where),
    )
    out = np.empty((len(places), 3), np.float32)
    thrown(lamps, np.array(places, np.float32), np.array(normals, np.float32), out)
    return out


def test_it_has_the_colour_of_the_lamps_and_grows_with_their_power():
    amber = np.array([1.0, 0.5, 0.1])
    one = light([(3.0, 5.0, 8.0)], amber, [(9.0, 5.0, 2.0)], [WEST])
    two = light([(3.0, 5.0, 8.0)], 2 * amber, [(9.0, 5.0, 2.0)], [WEST])
    assert one[0] / one[0, 0] == pytest.approx(amber, rel=1e-5)
    assert two == pytest.approx(2 * one, rel=1e-5)
    assert not light([(3.0, 5.0, 8.0)], 0 * amber, [(9.0, 5.0, 2.0)], [WEST]).any()


def test_a_wall_in_a_street_gets_a_tenth_or_so_of_what_the_lamps_give_the_ground():
    lamps = [(16.0 * k, 4.0 * (-1) ** k, 8.0) for k in range(-12, 13)]
    walls = [(x, 8.0, 2.0) for x in np.linspace(-16.0, 16.0, 33)]
    # A lamp gives pi times its intensity to the ground, 25 m wide from house to house.
    ground = np.pi * 40.0 / (16.0 * 25.0)
    back = light(lamps, np.ones((25, 3)), walls, [UP] * 33).mean() / 0.3
    assert 0.05 * ground < back < 0.2 * ground


def test_what_faces_the_ground_gets_more_than_what_faces_the_sky():
    place = (4.0, 4.0, 3.0)
    down, wall, up = light([(0, 0, 8)], np.ones(3), [place] * 3, [DOWN, EAST, UP])[:, 0]
    assert down > 1.5 * wall > 3.0 * up > 0.0


def test_beyond_the_reach_of_single_lamps_a_wall_that_faces_one_is_lit_below_it():
    away = NEAR_M + 4.0
    facing, behind, high = light(
        [(0, 0, 8)], np.ones(3), [(away, 0, 2), (away, 0, 2), (away, 0, 9)], [WEST, EAST, WEST]
    )[:, 0]
    # Lambert's law: intensity by the cosines at the lamp and at the wall, over the square.
    square = away**2 + 6.0**2
    direct = 40.0 * 6.0 * away / square**2
    assert 0.2 * direct < facing - behind < direct
    assert 0.0 < high <= behind


def test_it_ends_softly_and_changes_little_between_places_beside_each_other():
    x = np.arange(-90.0, 90.0, 0.25)
    row = light([(2.9, 1.3, 8)], np.ones(3), [(at, 3.0, 2.0) for at in x], [WEST] * len(x))[:, 0]
    assert np.abs(np.diff(row)).max() < 0.05 * row.max()
    assert not row[np.abs(x) > 8 * STEP_M + 4].any()


def test_a_town_without_lamps_has_none():
    assert not light(np.empty((0, 3)), np.empty((0, 3)), [(0.0, 0.0, 1.0)], [UP]).any()


def test_it_follows_what_clients_do_with_the_lamps():
    box = turned_box((0.6, 0.3, 0.1))
    lamp = build_mesh(
        box.vertices + np.array([0.0, 0.0, 7.0]), box.triangles, Material.STREET_LAMP,
        CityObjectLabel.POLES,
    )  # fmt: skip
    store = SceneStore(lamp, {}.__getitem__, cache=None)
    off = store.frame([]).lamps
    assert not off.thrown[..., :3].any()
    store.show(TownChanges(lamp_power=np.ones((1, 3), np.float32)))
    on = store.frame([]).lamps
    assert on.thrown[..., :3].max() > 0.0
    store.show(TownChanges(lamp_power=np.ones((1, 3), np.float32)))
    assert store.frame([]).lamps.thrown is on.thrown
