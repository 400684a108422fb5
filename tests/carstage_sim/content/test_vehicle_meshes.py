"""Every vehicle of the catalogue lies in its box, stands on the ground and is tagged rightly."""

from __future__ import annotations

import numpy as np
import pytest

from axis_rays import first_triangle
from carstage_sim.content.lettering import add_text, plate_number, text_width
from carstage_sim.content.lofting import ShapeBuilder
from carstage_sim.content.vehicle_shapes import shape_of
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.render.caster import RayCaster
from carstage_sim.render.scene import Placement
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind
from ray_scenes import frame_of

VEHICLES = [b for b in catalogue().values() if b.kind == ActorKind.VEHICLE]
_CENTIMETRE = 0.01
_MOST_TRIANGLES = 9000
"""A body of 3000, four wheels of 500, and lamps, plates, cabin and driver."""


CARS = [b for b in VEHICLES if set(b.semantic_tags) == {CityObjectLabel.CAR}]
SHINES = {
    Material.HEAD_LAMP,
    Material.TAIL_LAMP,
    Material.BLINKER_LEFT,
    Material.BLINKER_RIGHT,
    Material.REVERSE_LAMP,
    Material.LAMP_COVER,
    Material.PLASTIC_DARK,
}
"""What a lamp is made of, its dark joints among it."""


def mesh_of(blueprint):
    return vehicle_mesh(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(blueprint.vehicle.front_axle_x_m, blueprint.vehicle.rear_axle_x_m),
        wheel_radius_m=blueprint.vehicle.wheels[0].radius_m,
    )


def face_vectors(mesh):
    """``(T, 3)`` normals of the triangles, each as long as its area (m2)."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0


@pytest.mark.parametrize("blueprint", VEHICLES, ids=lambda b: b.id)
def test_vehicle_keeps_its_box_budget_and_tags(blueprint):
    mesh = mesh_of(blueprint)
    center, extent = np.array(blueprint.box_center), np.array(blueprint.box_extent)
    low, high = mesh.bounds
    assert np.all(low[:2] >= (center - extent)[:2] - _CENTIMETRE)
    assert np.all(high <= center + extent + _CENTIMETRE)
    assert low[2] == pytest.approx(0.0, abs=0.001)
    # The box is filled, or boxes drawn on pictures would look wrong.
    ground = max(center[2] - extent[2], 0.0)
    assert high[0] - low[0] > 0.97 * 2.0 * extent[0]
    assert high[1] - low[1] > 0.97 * 2.0 * extent[1]
    assert high[2] - ground > 0.97 * (center[2] + extent[2] - ground)
    assert len(mesh.triangles) <= _MOST_TRIANGLES
    assert set(mesh.tag.tolist()) == set(blueprint.semantic_tags)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=2), 1.0, atol=1e-3)


@pytest.mark.parametrize("blueprint", VEHICLES, ids=lambda b: b.id)
def test_all_tyres_touch_the_ground(blueprint):
    mesh = mesh_of(blueprint)
    tyres = mesh.vertices[mesh.triangles[mesh.material == Material.RUBBER]].reshape(-1, 3)
    for end in (tyres[:, 0] > 0.0, tyres[:, 0] < 0.0):
        assert tyres[end, 2].min() == pytest.approx(0.0, abs=0.001)


@pytest.mark.parametrize(
    "material",
    [
        Material.GLASS,
        Material.RUBBER,
        Material.HEAD_LAMP,
        Material.TAIL_LAMP,
        Material.BLINKER_LEFT,
        Material.BLINKER_RIGHT,
        Material.PAINT,
        Material.LICENCE_PLATE,
        Material.REVERSE_LAMP,
        Material.BRAKE_LAMP,
        Material.LAMP_COVER,
    ],
)
def test_a_car_has_windows_wheels_and_lamps(material):
    mesh = mesh_of(catalogue()["vehicle.tesla.model3"])
    assert (mesh.material == material).any()


def test_lamps_sit_at_their_ends_and_sides():
    mesh = mesh_of(catalogue()["vehicle.audi.tt"])
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    assert middle[mesh.material == Material.HEAD_LAMP, 0].min() > 1.5
    assert middle[mesh.material == Material.TAIL_LAMP, 0].max() < -1.5
    assert middle[mesh.material == Material.BLINKER_LEFT, 1].max() < 0
    assert middle[mesh.material == Material.BLINKER_RIGHT, 1].min() > 0


@pytest.mark.parametrize("blueprint", CARS, ids=lambda b: b.id)
def test_lamps_are_seen_from_their_end(blueprint):
    """What shines must not lie under the paint: rays along the road meet lamps first."""
    mesh = mesh_of(blueprint)
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    middle = corners.mean(axis=1)
    area = np.linalg.norm(face_vectors(mesh), axis=1)
    for material, end in ((Material.HEAD_LAMP, 1.0), (Material.TAIL_LAMP, -1.0)):
        lit = np.flatnonzero((mesh.material == material) & (area > 5e-6))
        free = [first_triangle(corners, middle[k] + [end * 9.0, 0, 0], -end) for k in lit[::9]]
        assert {mesh.material[k] for k in free} <= SHINES


@pytest.mark.parametrize(
    "name",
    [
        "tesla.model3", "seat.leon", "nissan.patrol", "jeep.wrangler_rubicon", "audi.tt",
        "mercedes.sprinter", "ford.ambulance", "volkswagen.t2", "mitsubishi.fusorosa",
        "carlamotors.european_hgv", "carlamotors.firetruck", "carlamotors.carlacola",
    ],
)  # fmt: skip
def test_a_windscreen_is_as_wide_at_its_foot_as_at_its_top(name):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    normals = mesh.normals.mean(axis=1)
    screen = (mesh.material == Material.GLASS) & (normals[:, 0] > 0.25)
    points = mesh.vertices[mesh.triangles[screen]].reshape(-1, 3)
    low, high = np.quantile(points[:, 2], [0.0, 1.0])
    share = (points[:, 2] - low) / (high - low)
    foot, top = (np.abs(points[at, 1]).max() for at in (share < 0.25, share > 0.75))
    assert foot >= 0.97 * top
    assert foot > 0.7 * mesh.bounds[1, 1]


def test_lorries_and_buses_have_upright_mirrors_and_wheels_without_spokes():
    for name in ("mitsubishi.fusorosa", "carlamotors.european_hgv", "carlamotors.firetruck"):
        mesh = mesh_of(catalogue()[f"vehicle.{name}"])
        corners = mesh.vertices[mesh.triangles].astype(np.float64)
        outside = np.abs(corners[..., 1]).min(axis=1) > 0.985 * mesh.bounds[1, 1]
        high = corners[..., 2].min(axis=1) > 0.5 * mesh.bounds[1, 2]
        ahead = corners[..., 0].min(axis=1) > 0.7 * mesh.bounds[1, 0]
        mirror = corners[outside & high & ahead & (mesh.material == Material.PLASTIC_DARK)]
        assert np.ptp(mirror[..., 2]) > 3.0 * np.ptp(mirror[..., 0])


@pytest.mark.parametrize(
    ("name", "sheet"),  # where it is bare, between strips and lamps
    [("seat.leon", 0.55), ("mini.cooper_s", 0.55), ("nissan.patrol_2021", 0.57),
     ("audi.etron", 0.55)],
)  # fmt: skip
def test_the_tailgate_of_a_hatch_or_suv_has_a_dark_window_half_way_up(name, sheet):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    low, high = mesh.bounds.astype(np.float64)
    for share, material in ((sheet, Material.PAINT), (0.74, Material.GLASS_TINTED),
                            (0.86, Material.GLASS_TINTED)):  # fmt: skip
        behind = np.array([low[0] - 5.0, 0.21, share * high[2]])
        assert mesh.material[first_triangle(corners, behind, 1.0)] == material, share
    # One sees through the front doors' windows: no dark glass ahead of the middle pillar.
    clear = corners[mesh.material == Material.GLASS].mean(axis=1)
    sides = np.abs(clear[:, 1]) > 0.3 * high[1]
    assert clear[sides, 0].min() > corners[mesh.material == Material.GLASS_TINTED, :, 0].min() + 1.5


def from_behind(name, y, share):
    """What one meets first from behind, at a height that is a share of the box's."""
    mesh = mesh_of(catalogue()[name])
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    eye = np.array([mesh.bounds[0, 0] - 5.0, y, share * mesh.bounds[1, 2]])
    return mesh.material[first_triangle(corners, eye, 1.0)]


@pytest.mark.parametrize("name", ["vehicle.nissan.patrol", "vehicle.jeep.wrangler_rubicon"])
def test_a_spare_wheel_hangs_on_the_rear_door_and_hides_no_plate(name):
    height = mesh_of(catalogue()[name]).bounds[1, 2]
    assert from_behind(name, 0.05, 0.49) == Material.METAL
    assert from_behind(name, 0.29, 0.49) == Material.RUBBER
    plate = mesh_of(catalogue()[name])
    at = plate.vertices[plate.triangles[plate.material == Material.LICENCE_PLATE]].mean(axis=1)
    behind = at[at[:, 0] < 0.0]
    for y in (-0.21, 0.01, 0.19):
        seen = from_behind(name, y, behind[:, 2].mean() / height)
        assert seen in (Material.LICENCE_PLATE, Material.SIGN_BLUE, Material.PAINT_BLACK)


def test_a_line_of_tail_lamps_crosses_the_whole_rear():
    low, high = shape_of("vehicle.dodge.charger_2020").tail_lamp[2:]
    for y in (-0.5, -0.015, 0.015, 0.5):
        seen = from_behind("vehicle.dodge.charger_2020", y, (low + high) / 2)
        assert seen == Material.TAIL_LAMP


@pytest.mark.parametrize("name", ["seat.leon", "citroen.c3", "nissan.micra"])
def test_a_hatchback_falls_to_the_rear_behind_a_wide_pillar(name):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    low, high = mesh.bounds.astype(np.float64)
    behind = mesh.vertices[:, 0] < low[0] + 0.14 * (high[0] - low[0])
    assert mesh.vertices[behind, 2].max() < 0.95 * high[2]
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    panes = np.isin(mesh.material, (Material.GLASS, Material.GLASS_TINTED))
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    aside = np.abs(normal[:, 1]) > 0.8 * np.linalg.norm(normal, axis=1)
    rear = corners[panes & aside, :, 0].min()
    assert (rear - low[0]) / (high[0] - low[0]) > 0.15


def test_a_heavy_lorry_has_boards_on_its_rear():
    mesh = mesh_of(catalogue()["vehicle.carlamotors.european_hgv"])
    corners = mesh.vertices[mesh.triangles[mesh.material == Material.SIGN_YELLOW]]
    behind = corners[..., 0].max(axis=1) < mesh.bounds[0, 0] + 0.05
    for side in (-1.0, 1.0):
        board = corners[behind & (corners[..., 1].mean(axis=1) * side > 0.0)].reshape(-1, 3)
        assert np.ptp(board[:, 1]) > 0.4
        assert np.ptp(board[:, 2]) > 0.06


@pytest.mark.parametrize("name", ["nissan.patrol", "nissan.patrol_2021", "audi.etron"])
def test_an_suv_is_wide_and_stands_on_bare_plastic(name):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    painted = corners[mesh.material == Material.PAINT].reshape(-1, 3)
    body = np.abs(painted[painted[:, 2] < 0.45 * mesh.bounds[1, 2], 1]).max()
    assert body > 0.92 * mesh.bounds[1, 1]
    side = corners[:, :, [1, 0, 2]]
    for height, material in ((0.19, Material.PLASTIC_DARK), (0.40, Material.PAINT)):
        beside = np.array([-9.0, 0.23, height * mesh.bounds[1, 2]])
        assert mesh.material[first_triangle(side, beside, 1.0)] == material


def area_on_sides(mesh, material):
    """Square metres of a material that are turned to the left or right."""
    return np.abs(face_vectors(mesh)[mesh.material == material, 1]).sum()


@pytest.mark.parametrize(
    "name",
    ["mercedes.sprinter", "mitsubishi.fusorosa", "ford.ambulance", "carlamotors.european_hgv",
     "carlamotors.carlacola", "carlamotors.firetruck"],
)  # fmt: skip
def test_long_vehicles_have_amber_lamps_along_their_sides(name):
    """UN ECE R48 asks for side markers: none more than 3 m from the next."""
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    for material, side in ((Material.BLINKER_LEFT, -1.0), (Material.BLINKER_RIGHT, 1.0)):
        at = mesh.vertices[mesh.triangles[mesh.material == material]].mean(axis=1)
        x = np.sort(at[at[:, 1] * side > 0.7 * mesh.bounds[1, 1], 0])
        assert np.diff(np.concatenate([mesh.bounds[:1, 0], x, mesh.bounds[1:, 0]])).max() < 3.1


@pytest.mark.parametrize(
    ("name", "material", "least_m2"),
    [
        ("mercedes.sprinter", Material.PLASTIC_DARK, 1.0),
        ("volkswagen.t2", Material.RIM, 0.3),
        ("mitsubishi.fusorosa", Material.DISPLAY, 0.1),
        ("ford.ambulance", Material.METAL, 0.5),
        ("carlamotors.european_hgv", Material.SIGN_YELLOW, 0.2),
        ("carlamotors.firetruck", Material.METAL, 8.0),
        ("carlamotors.carlacola", Material.SIGN_RED, 5.0),
    ],
)
def test_sides_of_vans_lorries_and_buses_are_not_blank(name, material, least_m2):
    assert area_on_sides(mesh_of(catalogue()[f"vehicle.{name}"]), material) > least_m2


@pytest.mark.parametrize(
    "name",
    ["tesla.model3", "seat.leon", "micro.microlino", "mitsubishi.fusorosa", "ford.ambulance"],
)
def test_no_ray_from_outside_meets_the_cabin(name):
    """Glass belongs to the car for all but colour: what is behind it has no label of its own."""
    blueprint = catalogue()[f"vehicle.{name}"]
    mesh = mesh_of(blueprint)
    inside = np.isin(mesh.material, (Material.SEAT, Material.SKIN, Material.HAIR))
    assert inside.any()
    frame = frame_of(None, [Placement(1, "car", np.zeros(3), np.eye(3))], {"car": mesh})
    chance = np.random.default_rng(3)
    turn = chance.uniform(0.0, 2 * np.pi, 60)
    eyes = np.stack([9 * np.cos(turn), 9 * np.sin(turn), chance.uniform(0.3, 6.0, 60)], axis=1)
    aims = mesh.vertices[mesh.triangles[inside]].mean(axis=1)
    caster = RayCaster(1)
    for eye in eyes:
        rays = (aims[chance.integers(len(aims), size=200)] - eye).astype(np.float32)
        hits = caster.cast(frame.scene, eye, rays, low=0.0, high=100.0)
        assert not inside[hits.triangle[hits.row == 0]].any()
    caster.close()


def test_only_cars_that_somebody_drives_have_a_driver():
    blueprint = catalogue()["vehicle.audi.tt"]
    box = (blueprint.box_extent, blueprint.box_center)
    driven = vehicle_mesh(blueprint.id, *box)
    parked = vehicle_mesh(blueprint.id, *box, occupied=False)
    assert (driven.material == Material.SKIN).any()
    assert not (parked.material == Material.SKIN).any()
    assert (parked.material == Material.SEAT).any()


@pytest.mark.parametrize("name", ["audi.tt", "nissan.patrol", "mercedes.sprinter"])
def test_a_coarse_body_is_the_same_car_of_fewer_triangles(name):
    blueprint = catalogue()[f"vehicle.{name}"]
    box = (blueprint.box_extent, blueprint.box_center)
    fine = vehicle_mesh(blueprint.id, *box, occupied=False)
    coarse = vehicle_mesh(blueprint.id, *box, occupied=False, coarse=True)
    assert len(coarse.triangles) < 0.75 * len(fine.triangles)
    for one, other in zip(fine.bounds, coarse.bounds, strict=True):
        assert one == pytest.approx(other, abs=_CENTIMETRE)
    # No part is left out, and what one sees most of is as large.
    assert set(fine.material.tolist()) == set(coarse.material.tolist())
    for material in (Material.RIM, Material.RUBBER, Material.GLASS, Material.PAINT):
        whole, part = (
            np.linalg.norm(face_vectors(mesh)[mesh.material == material], axis=1).sum()
            for mesh in (fine, coarse)
        )
        assert part == pytest.approx(whole, rel=0.35), material.name


@pytest.mark.parametrize(
    ("name", "materials"),
    [
        ("dodge.charger_police", {Material.BEACON_BLUE, Material.BEACON_RED, Material.SIGN_BLUE}),
        ("ford.ambulance", {Material.BEACON_BLUE, Material.BEACON_RED, Material.SIGN_RED}),
        ("carlamotors.firetruck", {Material.BEACON_BLUE, Material.SIGN_YELLOW, Material.METAL}),
        ("mitsubishi.fusorosa", {Material.DISPLAY, Material.SEAT, Material.GLASS}),
    ],
)
def test_vehicles_bear_the_marks_of_their_trade(name, materials):
    present = set(mesh_of(catalogue()[f"vehicle.{name}"]).material.tolist())
    assert materials <= present
    plain = set(mesh_of(catalogue()["vehicle.audi.tt"]).material.tolist())
    assert not {Material.BEACON_BLUE, Material.BEACON_RED, Material.DISPLAY} & plain


def test_beacons_stand_on_roofs():
    for name in ("dodge.charger_police", "dodge.charger_police_2020", "ford.ambulance"):
        mesh = mesh_of(catalogue()[f"vehicle.{name}"])
        height = mesh.vertices[mesh.triangles].mean(axis=1)[:, 2]
        beacons = np.isin(mesh.material, (Material.BEACON_BLUE, Material.BEACON_RED))
        painted = mesh.material == Material.PAINT
        assert height[beacons].min() > height[painted].max() - 0.08


def test_a_plate_number_belongs_to_its_model():
    numbers = {plate_number(b.id) for b in VEHICLES}
    assert len(numbers) == len(VEHICLES)
    assert plate_number("vehicle.audi.tt") == plate_number("vehicle.audi.tt")


def test_a_text_is_as_wide_and_high_as_said():
    builder = ShapeBuilder(CityObjectLabel.CAR)
    add_text(
        builder, "BUS 12", 0.35, lambda a, b: np.stack([a, 0 * a, b], axis=1), Material.DISPLAY
    )
    low, high = builder.mesh().bounds
    assert high[0] - low[0] == pytest.approx(text_width("BUS 12", 0.35), rel=0.05)
    assert high[2] - low[2] == pytest.approx(0.35)


def test_bodies_are_symmetric():
    mesh = mesh_of(catalogue()["vehicle.seat.leon"])
    low, high = mesh.bounds
    assert low[1] == pytest.approx(-high[1], abs=1e-3)


def test_an_unknown_vehicle_becomes_a_car():
    mesh = vehicle_mesh("vehicle.unknown.one", (2.2, 0.95, 0.75), (0.0, 0.0, 0.75))
    assert set(mesh.tag.tolist()) == {CityObjectLabel.CAR}


@pytest.mark.parametrize(
    ("name", "width_to_height"),
    [("nissan.patrol_2021", 1.995 / 1.94), ("jeep.wrangler_rubicon", 1.872 / 1.8),
     ("lincoln.mkz_2020", 1.864 / 1.478), ("lincoln.mkz_2017", 1.864 / 1.478),
     ("bmw.grandtourer", 1.8 / 1.608), ("volkswagen.t2_2021", 1.72 / 1.96),
     ("tesla.model3", 1.849 / 1.443), ("seat.leon", 1.742 / 1.439)],
)  # fmt: skip
def test_a_body_is_as_wide_for_its_height_as_its_maker_says(name, width_to_height):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    corners = mesh.vertices[mesh.triangles]
    low = corners[corners[..., 2].max(axis=1) < 0.5 * mesh.bounds[1, 2]]
    body = 2.0 * float(np.abs(low[..., 1]).max())
    assert body / float(mesh.bounds[1, 2]) == pytest.approx(width_to_height, rel=0.06)


@pytest.mark.parametrize("name", ["tesla.model3", "seat.leon", "nissan.patrol", "audi.tt"])
def test_tyres_show_below_the_rear_bumper(name):
    mesh = mesh_of(catalogue()[f"vehicle.{name}"])
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    rear, half = float(mesh.bounds[0, 0]), float(mesh.bounds[1, 1])
    eye = np.array([rear - 8.0, 0.78 * half, 0.19])
    assert mesh.material[first_triangle(corners, eye, 1.0)] in (
        Material.RUBBER,
        Material.PLASTIC_DARK,
    )
    at_end = corners[(corners[..., 0] < rear + 0.05).all(axis=1)]
    assert at_end[..., 2].min() > 0.25
