"""Ends and sides of cars: pillars beside rear windows, bumpers, openings, lamps, doors."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest

from axis_rays import first_triangle
from carstage_sim.content.vehicle_shapes import shape_of
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue

_PANES = (Material.GLASS, Material.GLASS_TINTED)


class Seen:
    """A vehicle's mesh that is looked at along an axis."""

    def __init__(self, name):
        blueprint = catalogue()[f"vehicle.{name}"]
        parameters = blueprint.vehicle
        self.mesh = vehicle_mesh(
            blueprint.id, blueprint.box_extent, blueprint.box_center,
            axles_m=(parameters.front_axle_x_m, parameters.rear_axle_x_m),
            wheel_radius_m=parameters.wheels[0].radius_m,
        )  # fmt: skip
        self.corners = self.mesh.vertices[self.mesh.triangles].astype(np.float64)
        self.low, self.high = self.mesh.bounds.astype(np.float64)

    def met(self, eye, axis, direction):
        """Material of what is met, and where along the axis."""
        number = first_triangle(self.corners, eye, direction, axis)
        if number is None:
            return None, np.nan
        a, b, c = self.corners[number]
        normal = np.cross(b - a, c - a)
        others = [k for k in range(3) if k != axis]
        off = sum(normal[k] * (eye[k] - a[k]) for k in others)
        return Material(self.mesh.material[number]), a[axis] - off / normal[axis]

    def behind(self, y, share):
        """What is met from behind, at a share of the height."""
        return self.met((self.low[0] - 5.0, y, share * self.high[2]), 0, 1.0)

    def ahead(self, y, share):
        """What is met from ahead, at a share of the height."""
        return self.met((self.high[0] + 5.0, y, share * self.high[2]), 0, -1.0)


@pytest.mark.parametrize(
    ("name", "least_m"),
    [("nissan.patrol_2021", 0.08), ("audi.etron", 0.08), ("citroen.c3", 0.08),
     ("seat.leon", 0.08), ("audi.a2", 0.08), ("tesla.model3", 0.06)],
)  # fmt: skip
def test_painted_pillars_stand_beside_a_rear_window(name, least_m):
    """A window from side to side is a minibus's."""
    seen = Seen(name)
    y = np.arange(0.3, seen.high[1], 0.005)
    materials = [seen.behind(k, 0.80)[0] for k in y]
    # Beyond the pillar one sees the side windows, which lean in.
    runs = [(kind, len(list(run))) for kind, run in groupby(materials)]
    painted = [count for kind, count in runs[1:] if kind is Material.PAINT]
    assert runs[0][0] in _PANES
    assert painted[0] * 0.005 > least_m


def test_the_rear_window_of_an_suv_begins_at_its_waist_and_ends_below_the_roof():
    """A window up to the roof over a tall blank sheet is a van's."""
    seen = Seen("nissan.patrol_2021")
    materials = [seen.behind(0.30, share)[0] for share in (0.63, 0.70, 0.85, 0.93)]
    pane = Material.GLASS_TINTED
    assert materials == [Material.PAINT, pane, pane, Material.PAINT]


def test_the_cabin_of_a_big_suv_is_narrower_than_its_body():
    seen = Seen("nissan.patrol_2021")
    half = [abs(seen.met((0.0, 5.0, share * seen.high[2]), 1, -1.0)[1]) for share in (0.52, 0.90)]
    assert half[1] < 0.83 * half[0]


@pytest.mark.parametrize(
    ("name", "y", "share"),
    [("jeep.wrangler_rubicon", 0.45, 0.85), ("nissan.patrol", 0.45, 0.80),
     ("mercedes.sprinter", 0.30, 0.70), ("mitsubishi.fusorosa", 0.30, 0.60)],
)  # fmt: skip
def test_no_sheet_metal_is_right_behind_the_window_of_an_upright_rear_door(name, y, share):
    seen = Seen(name)
    pane, x = seen.behind(y, share)
    assert pane in _PANES
    beyond, next_x = seen.met((x + 0.001, y, share * seen.high[2]), 0, 1.0)
    assert next_x - x > 0.3, beyond


@pytest.mark.parametrize("name", ["nissan.patrol_2021", "seat.leon", "mercedes.coupe_2020"])
def test_a_rear_bumper_stands_out_below_the_lid(name):
    seen = Seen(name)
    z = np.arange(0.25, 0.45, 0.002)
    # Beside plate and badge, inside of the lamps.
    x = np.array([seen.behind(0.40 * seen.high[1], k)[1] for k in z])
    step = np.array([x[k + 12] - x[k] for k in range(len(x) - 12)])
    assert 0.025 < step.max() < 0.08
    assert x.min() > seen.low[0] - 1e-6


@pytest.mark.parametrize("name", ["mercedes.coupe_2020", "audi.tt", "tesla.model3"])
def test_no_paint_shows_within_the_opening_of_the_front_bumper(name):
    low, high, wide = shape_of(f"vehicle.{name}").intake
    seen = Seen(name)
    met = [
        seen.ahead(y, low + share * (high - low))[0]
        for y in np.linspace(0.28, 0.65 * wide, 12)
        for share in np.linspace(0.10, 0.85, 12)
    ]
    assert met.count(Material.PAINT) < 0.03 * len(met)
    assert met.count(Material.PLASTIC_DARK) > 0.7 * len(met)


@pytest.mark.parametrize("name", ["nissan.patrol_2021", "seat.leon", "lincoln.mkz_2017"])
def test_a_tail_lamp_is_red_but_for_two_small_parts(name):
    seen = Seen(name)
    met = [
        seen.behind(y, z)[0]
        for y in np.linspace(0.35, seen.high[1], 60)
        for z in np.linspace(0.40, 0.66, 80)
    ]
    red = met.count(Material.TAIL_LAMP)
    others = met.count(Material.BLINKER_RIGHT) + met.count(Material.REVERSE_LAMP)
    assert red > 40
    assert 0 < others < 0.5 * red


@pytest.mark.parametrize("name", ["tesla.model3", "seat.leon", "mercedes.coupe_2020"])
def test_a_door_is_hollow_between_its_shoulder_and_the_sill(name):
    """Its upper part looks to the sky, its lower part to the road."""
    seen = Seen(name)
    x = 0.10 * seen.high[0]
    z = np.linspace(0.20, 0.56, 60)
    out = np.array([seen.met((x, 5.0, k * seen.high[2]), 1, -1.0)[1] for k in z])
    widest = int(out.argmax())
    assert 0.40 < z[widest] < 0.55
    assert out[widest] - out[z < 0.38].max() > 0.005
    assert out[widest] - out[-1] > 0.01


def test_under_an_off_road_car_one_sees_axles():
    seen = Seen("jeep.wrangler_rubicon")
    parameters = catalogue()["vehicle.jeep.wrangler_rubicon"].vehicle
    for y in (-0.4, 0.15):
        material, x = seen.met((seen.low[0] - 5.0, y, 0.43), 0, 1.0)
        assert material is Material.PLASTIC_DARK
        assert x == pytest.approx(parameters.rear_axle_x_m, abs=0.35)
