"""Pedestrians have human sizes, clothes of their own, and feet that stay where they stand."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from carstage_sim.content.pedestrians import pedestrian_mesh, walking_joints, walking_meshes
from carstage_sim.content.people import (
    CHILDREN,
    ELDERLY,
    POLICE,
    colours_of,
    dress_of,
    has_umbrella,
)
from carstage_sim.content.walking import (
    PHASES,
    RUN_PHASES,
    WALK_PHASES,
    gait_at,
    size_m,
    stride_m,
)
from carstage_sim.labels import CityObjectLabel
from carstage_sim.mesh import Material
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.state import ActorKind

WALKERS = [b for b in catalogue().values() if b.kind == ActorKind.WALKER]
EXTENTS = sorted({b.box_extent for b in WALKERS})
ADULT = (0.19, 0.19, 0.93)
ONE = "walker.pedestrian.0001"


def walking(name, extent, phase):
    return pedestrian_mesh(name, extent, walking_joints(name, extent, phase))


@pytest.mark.parametrize("extent", EXTENTS)
def test_pedestrian_is_as_tall_as_its_box_and_as_wide_as_a_human(extent):
    tall = 2.0 * extent[2]
    for name, phase in itertools.product(
        ("walker.pedestrian.0001", "walker.pedestrian.0007", "walker.pedestrian.0033"),
        range(PHASES + 1),
    ):
        mesh = walking(name, extent, phase)
        low, high = mesh.bounds
        assert -extent[2] - 0.02 <= low[2] < -extent[2] + 0.05
        assert 0.95 * tall < high[2] - low[2] <= tall + 0.02
        # Shoulder breadth over arms: a quarter to a third of the height.
        assert 0.25 * tall < high[1] - low[1] < 0.34 * tall
        assert high[0] - low[0] < 0.5 * tall
        assert set(mesh.tag.tolist()) == {CityObjectLabel.PEDESTRIANS}


@pytest.mark.parametrize("blueprint", WALKERS, ids=lambda b: b.id)
def test_every_figure_keeps_within_its_height_and_its_triangles(blueprint):
    half = blueprint.box_extent[2]
    for phase in (0, 1, 13, 25, 50, 66):
        mesh = walking(blueprint.id, blueprint.box_extent, phase)
        low, high = mesh.bounds
        assert low[2] > -half - 0.01
        assert 0.9 * half < high[2] < half + 0.01
        assert len(mesh.triangles) <= 1700
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1.0, atol=1e-5)


def test_steps_and_arms_leave_the_capsule():
    low, high = walking(ONE, ADULT, 3).bounds
    assert low[0] < -0.28
    assert high[0] > 0.30
    assert high[1] > 0.25


@pytest.mark.parametrize("name", sorted({b.id for b in WALKERS})[::7])
def test_the_same_triangles_follow_each_other_in_every_pose(name):
    standing = walking(name, ADULT, 0)
    for phase in range(1, PHASES + 1):
        mesh = walking(name, ADULT, phase)
        assert np.array_equal(mesh.triangles, standing.triangles)
        assert np.array_equal(mesh.material, standing.material)
        moved = np.linalg.norm(mesh.vertices - standing.vertices, axis=1)
        # A foot that stays on the ground is left behind by half a step; runners lift heels.
        assert 0.05 < moved.max() < (0.65 if phase <= WALK_PHASES else 0.9)


def test_phases_of_a_walk_differ():
    meshes = [walking(ONE, ADULT, k) for k in (0, 1, 3)]
    assert not np.array_equal(meshes[0].vertices, meshes[1].vertices)
    assert not np.array_equal(meshes[1].vertices, meshes[2].vertices)


@pytest.mark.parametrize(
    ("gait", "count", "first", "slip_m"),
    [("walk", WALK_PHASES, 1, 0.03), ("run", RUN_PHASES, WALK_PHASES + 1, 0.06)],
)
@pytest.mark.parametrize("name", [ONE, "walker.pedestrian.0012"])
def test_a_foot_on_the_ground_does_not_slide(name, gait, count, first, slip_m):
    extent = catalogue()[name].box_extent
    stride = stride_m(size_m(extent), gait)
    meshes = [walking(name, extent, first + k) for k in range(count)]
    soles = np.isin(meshes[0].material, (Material.SOLE, Material.SHOE))
    sole = np.unique(meshes[0].triangles[soles])
    # Places of all points of both feet while the body goes on by two strides, and who touches.
    way = np.arange(0.0, 2.0 * stride, 0.01)
    at = np.array([meshes[int(w / stride % 1.0 * count)].vertices[sole] for w in way])
    at[..., 0] += way[:, None]
    down = at[..., 2] < -extent[2] + 0.005
    assert down.any(axis=1).mean() > (0.99 if gait == "walk" else 0.6)
    slipped = stood = 0.0
    for point in range(len(sole)):
        for touches, run in itertools.groupby(range(len(way)), key=lambda k: down[k, point]):
            steps = list(run)
            if touches and steps[0] > 0 and steps[-1] < len(way) - 1:
                places = at[steps, point, :2]
                slipped = max(slipped, float(np.ptp(places, axis=0).max()))
                stood = max(stood, way[steps[-1]] - way[steps[0]])
    # The body passes over a point that stays.
    assert stood > 0.25 * stride * (1.0 if gait == "walk" else 0.5)
    assert slipped <= slip_m


def test_knees_and_elbows_bend_and_legs_keep_their_length():
    joints = [walking_joints(ONE, ADULT, phase) for phase in range(PHASES + 1)]
    legs = [
        np.linalg.norm(pose.knee[s] - pose.hip[s]) + np.linalg.norm(pose.ankle[s] - pose.knee[s])
        for pose in joints
        for s in (0, 1)
    ]
    assert max(legs) - min(legs) < 0.02

    def bend(a, b, c):
        one, two = (b - a) / np.linalg.norm(b - a), (c - b) / np.linalg.norm(c - b)
        return np.degrees(np.arccos(np.clip(one @ two, -1, 1)))

    knees = [bend(p.hip[0], p.knee[0], p.ankle[0]) for p in joints[1 : WALK_PHASES + 1]]
    assert min(knees) < 20 < 50 < max(knees)
    elbows = [bend(p.shoulder[0], p.elbow[0], p.hand[0]) for p in joints]
    assert min(elbows[: WALK_PHASES + 1]) > 3
    assert min(elbows[WALK_PHASES + 1 :]) > 40


def test_who_runs_and_who_walks_follows_from_speed_and_size():
    assert [gait_at(1.8, v) for v in (0.0, 1.6, 2.6)] == ["stand", "walk", "run"]
    assert [gait_at(1.1, v) for v in (0.0, 1.1, 2.0)] == ["stand", "walk", "run"]


def test_pedestrians_of_one_dress_are_one_figure():
    by_dress = {}
    for blueprint in WALKERS:
        by_dress.setdefault(dress_of(blueprint.id), []).append(blueprint.id)
    names = max(by_dress.values(), key=len)
    first, second = (walking(n, ADULT, 0) for n in names[:2])
    assert np.array_equal(first.vertices, second.vertices)
    assert len(by_dress) > 15


def test_blueprints_differ_in_their_clothes():
    seen = {}
    for blueprint in WALKERS:
        worn = colours_of(blueprint.id, 40)
        assert colours_of(blueprint.id, 40) == worn
        seen.setdefault((dress_of(blueprint.id), tuple(worn.items())), []).append(blueprint.id)
    police = [names for names in seen.values() if "walker.pedestrian.0030" in names]
    # Officers wear the same, and are still two people.
    assert len(seen) >= len(WALKERS) - (len(police[0]) - 1)
    assert len({colours_of(b.id, 40)["skin"] for b in WALKERS}) >= 6


UMBRELLAS = [b for b in WALKERS if has_umbrella(b.id)]


def under_umbrella(blueprint, phases):
    return walking_meshes(blueprint.id, blueprint.box_extent, phases, umbrella=True)


def test_a_quarter_of_the_grown_up_have_umbrellas_children_and_officers_none():
    grown = [b for b in WALKERS if b.attribute("age").value != "child"]
    assert 0.25 < len(UMBRELLAS) / len(grown) < 0.5
    numbers = {int(b.id.rpartition(".")[2]) for b in UMBRELLAS}
    assert not numbers & {*CHILDREN, *POLICE}
    without = next(b for b in WALKERS if not has_umbrella(b.id))
    (mesh,) = under_umbrella(without, [0])
    assert np.array_equal(mesh.vertices, walking(without.id, without.box_extent, 0).vertices)


@pytest.mark.parametrize("blueprint", UMBRELLAS[:6], ids=lambda b: b.id)
def test_an_umbrella_is_over_the_head_and_hardly_above_the_box(blueprint):
    half, phases = blueprint.box_extent[2], range(PHASES + 1)
    for phase, mesh in zip(phases, under_umbrella(blueprint, phases), strict=True):
        dry = walking(blueprint.id, blueprint.box_extent, phase)
        head = walking_joints(blueprint.id, blueprint.box_extent, phase).head
        top = float(mesh.bounds[1, 2])
        # 4 % of the height above the box, and a hand's breadth above what it keeps dry.
        assert top < half * 1.08
        assert top > float(dry.bounds[1, 2]) + 0.04
        cloth = mesh.vertices[np.unique(mesh.triangles[mesh.material == Material.BAG])]
        above = cloth[cloth[:, 2] > top - 0.20]
        assert np.abs(above[:, :2].mean(axis=0) - head[:2]).max() < 0.12
        assert 0.8 < np.ptp(above[:, 0]) < 1.05
        assert set(mesh.tag.tolist()) == {CityObjectLabel.PEDESTRIANS}
        np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=2), 1.0, atol=1e-5)
    assert len(mesh.triangles) < len(dry.triangles) + 120


def test_a_hand_that_holds_something_does_not_swing_and_the_other_does():
    name = UMBRELLAS[0].id
    poses = [walking_joints(name, ADULT, phase) for phase in range(1, WALK_PHASES + 1)]
    swing = [np.ptp([p.hand[side][0] - p.neck[0] for p in poses]) for side in (0, 1)]
    assert swing[0] > 0.3
    assert swing[1] < 0.06
    dry, wet = [*under_umbrella(UMBRELLAS[0], [3]), walking(name, UMBRELLAS[0].box_extent, 3)]
    feet = [mesh.vertices[mesh.vertices[:, 2] < -0.8] for mesh in (dry, wet)]
    assert np.array_equal(*feet), "rain changes what the hand holds, and nothing else"


def test_shopping_bags_hang_upright_from_both_hands_above_the_ground():
    carrying = [b for b in WALKERS if dress_of(b.id).bag == "shopping"]
    assert len(carrying) >= 4
    name, extent = carrying[0].id, carrying[0].box_extent
    for phase in (0, 1, 13, 25, 37, WALK_PHASES + 9):
        mesh, joints = walking(name, extent, phase), walking_joints(name, extent, phase)
        for side, material in enumerate((Material.BAG, Material.SIGN_WHITE)):
            bag = mesh.vertices[np.unique(mesh.triangles[mesh.material == material])]
            bag = bag[bag[:, 2] < 0.3]
            assert np.abs(bag.mean(axis=0) - joints.hand[side])[:2].max() < 0.03
            assert -extent[2] + 0.15 < bag[:, 2].min() < joints.hand[side][2] - 0.38
            assert bag[:, 2].max() < joints.hand[side][2]


def test_the_old_are_grey_and_children_have_larger_heads():
    old = colours_of(f"walker.pedestrian.{ELDERLY[0]:04d}", 3)["hair"]
    assert min(old) > 140
    child = f"walker.pedestrian.{CHILDREN[0]:04d}"
    shares = []
    for name in (child, "walker.pedestrian.0003"):
        extent = catalogue()[name].box_extent
        mesh, pose = walking(name, extent, 0), walking_joints(name, extent, 0)
        shares.append((mesh.bounds[1, 2] - pose.head[2]) / extent[2])
    assert shares[0] > 1.1 * shares[1]


@pytest.mark.parametrize(("name", "heads"), [("0009", 5.5), ("0012", 6.2), ("0001", 7.4)])
def test_bodies_are_so_many_heads_tall_as_those_of_their_age(name, heads):
    name = f"walker.pedestrian.{name}"
    extent = catalogue()[name].box_extent
    mesh = walking(name, extent, 0)
    skin = mesh.vertices[np.unique(mesh.triangles[mesh.material == Material.SKIN])]
    head = walking_joints(name, extent, 0).head
    face = skin[(skin[:, 0] > head[0] + 0.065 * extent[2]) & (skin[:, 2] > head[2] - 0.2)]
    chin = face[:, 2].min()
    assert 2.0 * extent[2] / (mesh.bounds[1, 2] - chin) == pytest.approx(heads, abs=0.25)


def test_children_have_low_wide_faces():
    faces = {}
    for name in ("walker.pedestrian.0011", "walker.pedestrian.0001"):
        extent = catalogue()[name].box_extent
        mesh = walking(name, extent, 0)
        pose = walking_joints(name, extent, 0)
        size = mesh.bounds[1, 2] - pose.head[2]
        eyes = mesh.vertices[np.unique(mesh.triangles[mesh.material == Material.RUBBER])]
        lips = mesh.vertices[np.unique(mesh.triangles[mesh.material == Material.LIPS])]
        faces[extent[2]] = (
            (eyes[:, 2].mean() - pose.head[2]) / size,
            (eyes[:, 2].mean() - lips[:, 2].mean()) / size,
            np.ptp(eyes[:, 1]) / size,
        )
    child, adult = (faces[half] for half in sorted(faces))
    assert child[0] < adult[0] - 0.12
    assert child[1] < adult[1]
    assert child[2] > 1.05 * adult[2]


def test_bytes_repeat():
    one, two = (walking(ONE, ADULT, 7) for _ in range(2))
    assert one.vertices.tobytes() == two.vertices.tobytes()
    assert one.normals.tobytes() == two.normals.tobytes()


def test_a_phase_out_of_range_is_refused():
    with pytest.raises(ValueError, match="phase"):
        walking_joints(ONE, ADULT, PHASES + 1)


def test_phases_that_are_made_together_are_those_that_are_made_alone():
    phases = (0, 7, WALK_PHASES, PHASES)
    for phase, mesh in zip(phases, walking_meshes(ONE, ADULT, phases), strict=True):
        alone = walking(ONE, ADULT, phase)
        assert np.array_equal(mesh.vertices, alone.vertices)
        assert np.array_equal(mesh.normals, alone.normals)
