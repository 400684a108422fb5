"""Cars have the outlines of the models they are named after: screens, windows, faces, wings."""

from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest

from axis_rays import first_triangle
from carstage_sim.content.vehicles import vehicle_mesh
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue

_PANES = (Material.GLASS, Material.GLASS_TINTED)
_JEEP = "jeep.wrangler_rubicon"


def mesh_of(name):
    blueprint = catalogue()[f"vehicle.{name}"]
    parameters = blueprint.vehicle
    return vehicle_mesh(
        blueprint.id,
        blueprint.box_extent,
        blueprint.box_center,
        axles_m=(parameters.front_axle_x_m, parameters.rear_axle_x_m),
        wheel_radius_m=parameters.wheels[0].radius_m,
    )


def number_met(mesh, eye, axis, direction):
    """Number of the triangle that a ray along an axis meets first; None for nothing."""
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    return first_triangle(corners, eye, direction, axis)


def first_met(mesh, eye, axis, direction):
    """Material of what a ray along an axis meets first; None for nothing."""
    number = number_met(mesh, eye, axis, direction)
    return None if number is None else Material(mesh.material[number])


def beside(mesh, share, count=200):
    """Materials that one sees from the right, at a share of the height, from rear to front."""
    x = np.linspace(mesh.bounds[0, 0], mesh.bounds[1, 0], count)
    return x, [first_met(mesh, (k, 9.0, share * mesh.bounds[1, 2]), 1, -1.0) for k in x]


def height_over(mesh, x, y):
    """Height at which a ray from above meets a mesh."""
    first, *others = mesh.vertices[mesh.triangles[number_met(mesh, (x, y, 9.0), 2, -1.0)]].astype(
        np.float64
    )
    normal = np.cross(others[0] - first, others[1] - first)
    return first[2] - (normal[0] * (x - first[0]) + normal[1] * (y - first[1])) / normal[2]


def runs_of(seen):
    return [material for material, _ in groupby(seen)]


def rear_edge_of_windows(mesh, share):
    """x of the rear end of the side windows at a share of the height; a tailgate's is none."""
    for x in np.linspace(mesh.bounds[0, 0], mesh.bounds[1, 0], 400):
        number = number_met(mesh, (x, 9.0, share * mesh.bounds[1, 2]), 1, -1.0)
        if number is None or mesh.material[number] not in _PANES:
            continue
        if mesh.normals[number, :, 1].mean() > 0.75:
            return float(x)
    raise AssertionError("no window")


@pytest.mark.parametrize(
    ("name", "share"),
    [("tesla.model3", 0.25), ("dodge.charger_2020", 0.30), ("ford.crown", 0.30),
     ("ford.mustang", 0.34), ("seat.leon", 0.265), ("mini.cooper_s", 0.29),
     ("nissan.patrol_2021", 0.29), ("audi.etron", 0.26), ("bmw.grandtourer", 0.25)],
)  # fmt: skip
def test_a_windscreen_stands_where_its_models_does(name, share):
    """Shares of the length before the screen's foot, as we know the cars; none is another's."""
    mesh = mesh_of(name)
    normal = mesh.normals.mean(axis=1)
    screen = (mesh.material == Material.GLASS) & (normal[:, 0] > 0.25)
    points = mesh.vertices[mesh.triangles[screen]].reshape(-1, 3)
    foot = points[np.abs(points[:, 1]) < 0.1, 0].max()
    low, high = mesh.bounds[:, 0]
    assert (high - foot) / (high - low) == pytest.approx(share, abs=0.025)


@pytest.mark.parametrize("name", ["nissan.patrol_2021", "nissan.patrol"])
def test_a_painted_pillar_divides_the_rear_quarter_window_of_a_big_suv(name):
    mesh = mesh_of(name)
    _, seen = beside(mesh, 0.80)
    pane, paint = Material.GLASS_TINTED, Material.PAINT
    # The tailgate's window, the rearmost pillar, the quarter window, the pillar, the rear door's.
    kinds = [k for k in runs_of(seen) if k in (paint, *_PANES)]
    assert kinds[:5] == [pane, paint, pane, paint, pane]


@pytest.mark.parametrize(
    "name", ["nissan.patrol_2021", "audi.etron", "seat.leon", "mercedes.coupe_2020", "audi.tt"]
)
def test_side_windows_end_in_an_edge_that_leans_forward(name):
    """An upright edge there is a van's."""
    mesh = mesh_of(name)
    assert rear_edge_of_windows(mesh, 0.82) - rear_edge_of_windows(mesh, 0.70) > 0.04


@pytest.mark.parametrize(
    "name", ["mercedes.coupe_2020", "mercedes.coupe", "audi.tt", "ford.mustang"]
)
def test_a_coupe_falls_in_one_line_to_its_tail_and_has_a_window_behind_the_door(name):
    mesh = mesh_of(name)
    low, high = mesh.bounds[:, 0].astype(np.float64)
    rear = low + np.array([0.06, 0.12, 0.18, 0.24, 0.30, 0.36]) * (high - low)
    line = [height_over(mesh, x, 0.02) for x in rear]
    assert np.all(np.diff(line) > 0.0)
    assert np.diff(line).max() < 0.16
    edge = rear_edge_of_windows(mesh, 0.70)
    assert (edge - low) / (high - low) < 0.24
    _, seen = beside(mesh, 0.76)
    assert runs_of([k for k in seen if k in (Material.GLASS, Material.PLASTIC_DARK)])[:3] == [
        Material.GLASS, Material.PLASTIC_DARK, Material.GLASS,
    ]  # fmt: skip


def test_a_rear_door_ends_on_the_wheel_arch():
    """Its joint shows above the arch: without it a side looks like a van's panel."""
    mesh = mesh_of("nissan.patrol_2021")
    x, seen = beside(mesh, 0.52, count=900)
    joints = [a for a, b in zip(x, seen, strict=True) if b is Material.PLASTIC_DARK]
    length = mesh.bounds[1, 0] - mesh.bounds[0, 0]
    shares = np.array([(a - mesh.bounds[0, 0]) / length for a in joints])
    assert np.any((shares > 0.18) & (shares < 0.30))


def ahead(mesh, z_share, y):
    return first_met(mesh, (mesh.bounds[1, 0] + 5.0, y, z_share * mesh.bounds[1, 2]), 0, -1.0)


def test_a_wrangler_has_seven_slots_between_round_lamps():
    mesh = mesh_of(_JEEP)
    y = np.linspace(-0.55, 0.55, 331)
    seen = runs_of([ahead(mesh, 0.52, float(k)) for k in y])
    assert seen.count(Material.PAINT_BLACK) == 7
    assert seen.index(Material.HEAD_LAMP) < seen.index(Material.PAINT_BLACK)
    lamp = mesh.vertices[mesh.triangles[mesh.material == Material.HEAD_LAMP]].reshape(-1, 3)
    right = lamp[lamp[:, 1] > 0.0]
    assert np.ptp(right[:, 1]) == pytest.approx(np.ptp(right[:, 2]), rel=0.05)


def test_a_wrangler_is_a_narrow_tub_between_wings_of_bare_plastic():
    mesh = mesh_of(_JEEP)
    half = float(mesh.bounds[1, 1])
    painted = mesh.vertices[mesh.triangles[mesh.material == Material.PAINT]].reshape(-1, 3)
    below = painted[painted[:, 2] < 0.5 * mesh.bounds[1, 2]]
    assert np.abs(below[:, 1]).max() < 0.85 * half
    parameters = catalogue()[f"vehicle.{_JEEP}"].vehicle
    for axle in (parameters.front_axle_x_m, parameters.rear_axle_x_m):
        for side in (-1.0, 1.0):
            above = (axle, side * 0.90 * half, 9.0)
            assert first_met(mesh, above, 2, -1.0) is Material.PLASTIC_DARK
            outside = (axle, side * 9.0, 0.15 * parameters.wheels[0].radius_m)
            assert first_met(mesh, outside, 1, -side) is Material.RUBBER


def test_one_sees_through_all_of_a_wranglers_side_windows_under_a_dark_top():
    mesh = mesh_of(_JEEP)
    _, seen = beside(mesh, 0.80)
    assert seen.count(Material.GLASS) > 0.35 * len(seen)
    assert Material.GLASS_TINTED not in seen
    assert first_met(mesh, (-0.5, 0.1, 9.0), 2, -1.0) is Material.PLASTIC_DARK
    assert ahead(mesh, 0.29, 0.02) in (
        Material.LICENCE_PLATE, Material.PAINT_BLACK, Material.SIGN_BLUE,
    )  # fmt: skip


@pytest.mark.parametrize("name", ["seat.leon", "mercedes.coupe_2020", "audi.etron", "audi.tt"])
def test_a_mesh_grille_is_a_dark_opening_with_a_bright_rim(name):
    """Bars as bright as the rim make one grey area of it from afar."""
    mesh = mesh_of(name)
    z = np.linspace(0.30, 0.56, 121)
    seen = [ahead(mesh, float(k), 0.13) for k in z]
    hole = [k for k in seen if k in (Material.PLASTIC_DARK, Material.PAINT_BLACK)]
    assert Material.PAINT_BLACK in hole
    assert Material.RIM in seen
    assert Material.PAINT_GREY not in seen


def test_a_mini_has_a_roof_of_another_colour():
    mesh = mesh_of("mini.cooper_s")
    assert first_met(mesh, (0.0, 0.0, 9.0), 2, -1.0) is Material.PAINT_BLACK
    assert first_met(mesh, (1.4, 0.3, 9.0), 2, -1.0) is Material.PAINT


@pytest.mark.parametrize("name", ["volkswagen.t2", "volkswagen.t2_2021"])
def test_a_camper_has_a_window_in_its_rear(name):
    mesh = mesh_of(name)
    behind = mesh.bounds[0, 0] - 5.0
    for y in (-0.30, 0.25):
        assert first_met(mesh, (behind, y, 0.70 * mesh.bounds[1, 2]), 0, 1.0) is Material.GLASS


def test_a_badge_is_no_taller_than_its_grille():
    mesh = mesh_of("toyota.prius")
    disc = mesh.vertices[mesh.triangles[mesh.material == Material.RIM]].reshape(-1, 3)
    disc = disc[(disc[:, 0] > mesh.bounds[1, 0] - 0.35) & (np.abs(disc[:, 1]) < 0.03)]
    assert np.ptp(disc[:, 2]) < 0.10


@pytest.mark.parametrize("name", ["seat.leon", "tesla.model3", "audi.etron", "mercedes.coupe"])
def test_sills_curve_in_below_the_doors(name):
    """In the shade of the doors they are a dark line, as the gap over the road is."""
    mesh = mesh_of(name)
    corners = mesh.vertices[mesh.triangles]
    skin = corners[np.isin(mesh.material, (Material.PAINT, Material.PLASTIC_DARK))].reshape(-1, 3)
    skin = skin[(np.abs(skin[:, 0]) < 0.4) & (skin[:, 2] < 0.45 * mesh.bounds[1, 2])]
    foot = skin[:, 2] < skin[:, 2].min() + 0.005
    assert np.abs(skin[~foot, 1]).max() - np.abs(skin[foot, 1]).max() > 0.09


@pytest.mark.parametrize("name", ["tesla.model3", "seat.leon", "audi.tt", "nissan.patrol_2021"])
def test_screens_have_a_dark_border_in_the_roof_and_pillars(name):
    """The print that hides the glue: paint never meets the glass of a windscreen."""
    mesh = mesh_of(name)
    normal = mesh.normals.mean(axis=1)
    screen = (mesh.material == Material.GLASS) & (normal[:, 0] > 0.25) & (normal[:, 2] > 0.25)
    corners = mesh.vertices[mesh.triangles[screen]].reshape(-1, 3)
    for share in (0.35, 0.6):
        z = corners[:, 2].min() + share * np.ptp(corners[:, 2])
        y = np.linspace(0.0, mesh.bounds[1, 1], 300)
        seen = runs_of([first_met(mesh, (mesh.bounds[1, 0] + 5.0, k, z), 0, -1.0) for k in y])
        assert seen[seen.index(Material.PAINT) - 1] is Material.PLASTIC_DARK


@pytest.mark.parametrize("name", ["tesla.model3", "seat.leon", "audi.tt", "nissan.patrol_2021"])
def test_the_upper_brake_lamp_and_the_bonnets_joint_are_seen_level(name):
    """Lines on the skin lie flat on it: level ones on its slope are seen from above only."""
    mesh = mesh_of(name)
    brake = mesh.vertices[mesh.triangles[mesh.material == Material.BRAKE_LAMP]].mean(axis=(0, 1))
    behind = (mesh.bounds[0, 0] - 5.0, 0.03, float(brake[2]))
    assert first_met(mesh, behind, 0, 1.0) is Material.BRAKE_LAMP
    z = np.linspace(0.50, 0.68, 300) * mesh.bounds[1, 2]
    for y in (0.20, 0.35, 0.50):
        ahead_of = [first_met(mesh, (mesh.bounds[1, 0] + 5.0, y, k), 0, -1.0) for k in z]
        joint = runs_of(ahead_of)[-4:]
        assert (Material.PAINT, Material.PLASTIC_DARK, Material.PAINT) in set(
            zip(joint, joint[1:], joint[2:], strict=False)
        )
