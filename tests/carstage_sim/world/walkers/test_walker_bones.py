"""Bones of walkers: names, frames, clients' poses."""

from __future__ import annotations

import numpy as np
import pytest

from carstage_sim.content.skeleton import BONES
from carstage_sim.content.wheelchairs import EXTENT
from carstage_sim.geometry import pose_matrix
from carstage_sim.maps import Town
from carstage_sim.world.actors import Actor
from carstage_sim.world.controls import WalkerControl
from carstage_sim.world.pose import Pose, compose
from carstage_sim.world.walkers.bones import (
    BoneTransform,
    bone_transforms,
    pose_bones,
    pose_from_animation,
    posed_joints,
)
from carstage_sim.world.world import World

WALKER = "walker.pedestrian.0001"
ARM = "crl_arm__R"


@pytest.fixture(scope="module")
def earlier(stage01: Town) -> World:
    return World(stage01, episode_id=0)


@pytest.fixture
def world(stage01: Town, earlier: World) -> World:
    return World(stage01, episode_id=1, previous=earlier)


@pytest.fixture
def walker(world: World, stage01: Town) -> Actor:
    x, y, z, *_ = stage01.spawn_points[3].tolist()
    walker = world.spawn(WALKER, {}, Pose((x, y, z + 1.0), (0.0, 50.0, 0.0)))
    world.tick(0.05)
    return walker


def bones(world: World, walker: Actor) -> dict[str, BoneTransform]:
    return {bone.name: bone for bone in bone_transforms(world.actors, walker)}


def test_every_bone_that_carlas_example_draws_exists_after_its_parent() -> None:
    names = [bone.name for bone in BONES]
    assert len(names) == len(set(names)) == 66
    for bone in BONES:
        assert bone.parent is None or names.index(bone.parent) < names.index(bone.name)
    assert {"crl_root", "crl_hips__C", "crl_Head__C", "crl_eye__L", "crl_toeEnd__R",
            "crl_handThumbEnd__L", "crl_handPinky02__R"} <= set(names)  # fmt: skip


def test_the_three_frames_of_a_bone_agree(world: World, walker: Actor) -> None:
    found = bones(world, walker)
    feet = compose(world.actors.pose(walker.actor_id), Pose((0.0, 0.0, -walker.box_extent[2])))
    for bone in BONES:
        here = found[bone.name]
        in_world = compose(feet, here.component)
        np.testing.assert_allclose(in_world.location, here.world.location, atol=1e-6)
        if bone.parent is not None:
            chained = compose(found[bone.parent].component, here.relative)
            np.testing.assert_allclose(chained.location, here.component.location, atol=1e-6)


def test_body_parts_are_where_a_body_has_them(world: World, walker: Actor) -> None:
    found = {name: bone.component.location for name, bone in bones(world, walker).items()}
    height = 2.0 * walker.box_extent[2]
    order = ("crl_toe__L", "crl_foot__L", "crl_leg__L", "crl_hips__C", "crl_spine01__C",
             "crl_neck__C", "crl_eye__L")  # fmt: skip
    heights = [found[name][2] for name in order]
    assert heights == sorted(heights)
    assert heights[0] > 0.0
    assert heights[-1] < height
    assert found["crl_hand__L"][1] < 0.0 < found["crl_hand__R"][1]
    assert found["crl_eye__L"][0] > found["crl_Head__C"][0]


def test_who_sits_in_a_wheelchair_has_bones_and_a_box_that_sit(world: World, stage01: Town) -> None:
    x, y, z, *_ = stage01.spawn_points[3].tolist()
    pose = Pose((x, y, z + 1.0), (0.0, 50.0, 0.0))
    sitting = world.spawn(WALKER, {"use_wheelchair": "true"}, pose)
    world.tick(0.05)
    assert sitting.attributes["use_wheelchair"] == "true"
    assert sitting.box_extent == EXTENT
    assert world.freeze(0.05).state.wheelchairs == {sitting.actor_id}
    ground = world.actors.pose(sitting.actor_id).location[2] - EXTENT[2]
    found = {name: bone.world.location[2] - ground for name, bone in bones(world, sitting).items()}
    assert found["crl_foot__L"] < 0.2
    assert found["crl_leg__L"] == pytest.approx(found["crl_thigh__L"], abs=0.05)
    assert 1.1 < found["crl_eye__L"] < 1.4
    pose_from_animation(world.actors, sitting)
    pose_bones(sitting, (), blend=1.0)
    assert sitting.actor_id in world.freeze(0.05).state.figures


def test_who_cannot_use_a_wheelchair_stands_whatever_a_client_sets(
    world: World, stage01: Town
) -> None:
    x, y, z, *_ = stage01.spawn_points[3].tolist()
    child = world.spawn("walker.pedestrian.0009", {"use_wheelchair": "true"}, Pose((x, y, z + 1.0)))
    assert child.attributes["use_wheelchair"] == "false"
    assert child.box_extent[2] == 0.55
    world.tick(0.05)
    assert not world.freeze(0.05).state.wheelchairs


def test_legs_swing_with_the_walk_and_rest_when_standing(world: World, walker: Actor) -> None:
    def foot() -> float:
        return bones(world, walker)["crl_foot__L"].component.location[0]

    standing = foot()
    world.control_walker(walker.actor_id, WalkerControl((1.0, 0.0, 0.0), 1.4))
    swing = []
    for _ in range(30):
        world.tick(0.05)
        swing.append(foot())
    assert max(swing) - min(swing) > 0.1
    world.control_walker(walker.actor_id, WalkerControl((1.0, 0.0, 0.0), 0.0))
    world.tick(0.05)
    world.tick(0.05)
    assert foot() == pytest.approx(standing)


def test_a_pose_shows_by_its_blend_and_moves_what_hangs_on_the_bone(
    world: World, walker: Actor
) -> None:
    before = bones(world, walker)
    raised = Pose(before[ARM].relative.location, (0.0, 120.0, 0.0))
    pose_bones(walker, [(ARM, raised), ("crl_tail", Pose())], blend=None)
    assert bones(world, walker) == before  # set, not shown
    hands = []
    for blend in (0.5, 1.0):
        pose_bones(walker, (), blend=blend)
        hands.append(bones(world, walker)["crl_hand__R"].component.location)
    shown = bones(world, walker)[ARM].relative
    goal = pose_matrix(raised.location, raised.rotation_deg)
    np.testing.assert_allclose(pose_matrix(shown.location, shown.rotation_deg), goal, atol=1e-6)
    rest = before["crl_hand__R"].component.location
    moved = [np.linalg.norm(np.subtract(hand, rest)) for hand in hands]
    assert 0.1 < moved[0] < moved[1]
    pose_bones(walker, (), blend=0.0)
    assert bones(world, walker) == before


def test_pose_from_animation_keeps_the_step_while_the_walker_goes_on(
    world: World, walker: Actor
) -> None:
    world.control_walker(walker.actor_id, WalkerControl((1.0, 0.0, 0.0), 1.4))
    for _ in range(7):
        world.tick(0.05)
    kept = bones(world, walker)["crl_foot__L"].component.location
    pose_from_animation(world.actors, walker)
    pose_bones(walker, (), blend=1.0)
    for _ in range(8):
        world.tick(0.05)
    assert bones(world, walker)["crl_foot__L"].component.location == pytest.approx(kept, abs=1e-6)


def test_only_posed_walkers_have_joints_of_their_own_in_the_frame(
    world: World, walker: Actor
) -> None:
    assert posed_joints(world.actors, walker) is None
    assert world.tick(0.05).state.figures == {}
    pose_bones(walker, [(ARM, Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))], blend=1.0)
    assert list(world.tick(0.05).state.figures) == [walker.actor_id]
