"""``carla.Walker`` and ``carla.WalkerAIController``."""

from __future__ import annotations

import carla

from client_api.entries import works
from client_api.picture import changed
from client_api.trial_scene import TrialScene, expect, look_at


@works("Walker.apply_control", "Walker.get_control", "WalkerControl.*")
def _walking(scene: TrialScene) -> None:
    """It walks in the direction, at the speed times the direction's length, and jumps."""
    walker = scene.spawn("walker.pedestrian.0002")
    start = walker.get_location()
    walker.apply_control(carla.WalkerControl(carla.Vector3D(1.0, 0.0, 0.0), 1.5, False))
    scene.ticks(40)
    gone = walker.get_location() - start
    expect(abs(gone.x - 3.0) < 0.5 and abs(gone.y) < 0.3, f"it came {gone} far")
    control = walker.get_control()
    expect(abs(control.speed - 1.5) < 1e-5 and control.direction.x > 0.99, "control reads back")
    expect(not control.jump, "jump reads back")
    start = walker.get_location()
    walker.apply_control(carla.WalkerControl(carla.Vector3D(0.5, 0.0, 0.0), 1.5, True))
    scene.ticks(4)
    gone = walker.get_location() - start
    expect(gone.x < 0.3 and gone.z > 0.4, f"half as fast, and in the air: {gone}")


@works("Walker.get_bones", "Walker.set_bones", "Walker.blend_pose", "Walker.show_pose",
       "Walker.hide_pose", "Walker.get_pose_from_animation", "WalkerBoneControlIn.*",
       "WalkerBoneControlOut.*", "bone_transform_out.*")  # fmt: skip
def _posing(scene: TrialScene) -> None:
    """A bone that is turned is seen turned, once the pose is shown."""
    walker = scene.spawn("walker.pedestrian.0003")
    bones = walker.get_bones().bone_transforms
    names = [bone.name for bone in bones]
    expect("crl_arm__R" in names and "crl_hips__C" in names, f"bones {names[:5]}")
    for bone in bones:
        near = bone.world.location.distance(walker.get_location())
        expect(near < 3.0, f"{bone.name} is {near} m away")
    arm = next(bone for bone in bones if bone.name == "crl_arm__R")
    expect(arm.component.location.distance(carla.Location()) < 3.0, "in the walker's frame")
    front_deg = walker.get_transform().rotation.yaw + 180.0
    view = look_at(walker.get_location(), 2.4, front_deg)
    before = scene.picture(view)
    walker.get_pose_from_animation()
    pose = carla.WalkerBoneControlIn()
    turned = arm.relative.rotation
    wanted = carla.Transform(
        arm.relative.location, carla.Rotation(turned.pitch + 80.0, turned.yaw, turned.roll)
    )
    pose.bone_transforms = [("crl_arm__R", wanted)]
    walker.set_bones(pose)
    walker.blend_pose(0.5)
    walker.show_pose()
    scene.ticks(2)
    expect(changed(before, scene.picture(view)) > 0.002, "the arm is not seen raised")
    walker.hide_pose()
    scene.ticks(2)


@works("WalkerAIController.*")
def _navigating(scene: TrialScene) -> None:
    """It walks towards its goal on the navigation mesh, faster with a higher limit, and stops."""
    start = scene.world.get_random_location_from_navigation()
    walker = scene.spawn(
        "walker.pedestrian.0004", carla.Transform(start + carla.Location(z=1.0)),
    )  # fmt: skip
    controller = scene.spawn("controller.ai.walker", carla.Transform(), walker)
    controller.start()
    goal = scene.world.get_random_location_from_navigation()
    controller.go_to_location(goal)
    controller.set_max_speed(1.4)
    scene.until(lambda: walker.get_location().distance(start) > 1.5, "it walks", 400)
    controller.set_max_speed(3.0)
    scene.ticks(20)
    controller.stop()
    scene.ticks(5)
