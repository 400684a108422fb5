"""The labelled objects of one frame as arrays, with their boxes in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from carstage.annotation.boxes import LabelBox
from carstage.geometry import FloatArray, box_corners, invert_pose, multiply, pose_matrix
from carstage.rawlog.reader import ActorInfo, WorldFrame
from carstage.spec.vehicle_classes import VEHICLE_CLASSES

_MAX_SINK_M: Final = 0.2
"""Boxes of CARLA's cars reach up to 16 cm below the pivot, which is on the road. A pivot much
higher in its box is not on the road."""


@dataclass(frozen=True, slots=True)
class ActorFacts:
    """What is static about a labelled actor or level object.

    Attributes:
        info: from the raw log; of a level object: its track, its name, the light that it is of.
        object_class: Car-STAGE class.
        box: the box to label it with.
        tags: ``(256,)`` which semantic tags its pixels may carry.
        is_static: it is part of the level.
    """

    info: ActorInfo
    object_class: str
    box: LabelBox
    tags: NDArray[np.bool_]
    is_static: bool = False

    @property
    def is_fixture(self) -> bool:
        """Whether it is part of the level and no parked vehicle."""
        return self.is_static and self.object_class not in VEHICLE_CLASSES

    @property
    def is_walker(self) -> bool:
        """Whether it is a pedestrian."""
        return self.object_class.startswith("walker")


@dataclass(frozen=True, slots=True)
class Scene:
    """``N`` labelled objects of one frame, ascending track; world frame, metres.

    Attributes:
        world: the snapshot.
        facts: ``N`` static facts.
        location: ``(N, 3)`` of the pivots.
        rotation_deg: ``(N, 3)`` pitch, yaw, roll of the actors.
        velocity: ``(N, 3)`` m/s.
        acceleration: ``(N, 3)`` m/s^2.
        angular_velocity_deg: ``(N, 3)`` deg/s.
        valid: ``(N,)`` whether the box may be used.
        world_from_box: ``(N, 4, 4)``; of no meaning where not valid.
        extent: ``(N, 3)`` half sizes; ones where not valid.
        ground: ``(N,)`` height of the road in box axes: the bottom of the box, or a vehicle's
            pivot where the box reaches a little deeper.
        corners: ``(N, 8, 3)``.
        world_from_ego: ``(4, 4)``.
        ego_from_world: ``(4, 4)``.
    """

    world: WorldFrame
    facts: Sequence[ActorFacts]
    location: FloatArray
    rotation_deg: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    angular_velocity_deg: FloatArray
    valid: NDArray[np.bool_]
    world_from_box: FloatArray
    extent: FloatArray
    ground: FloatArray
    corners: FloatArray
    world_from_ego: FloatArray
    ego_from_world: FloatArray


def build_scene(
    world: WorldFrame, rows: Sequence[int], facts: Sequence[ActorFacts], ego_row: int
) -> Scene:
    """Place the boxes of labelled actors in the world.

    Args:
        world: the snapshot.
        rows: the actors' rows in it.
        facts: the same actors' static facts.
        ego_row: the ego's row.
    """
    world_from_ego = pose_matrix(world.location[ego_row], world.rotation_deg[ego_row])
    if not facts:
        return _scene_of_nobody(world, world_from_ego)
    index = np.array(rows, dtype=np.int64)
    count = len(index)
    valid = np.array([fact.box.valid for fact in facts], dtype=np.bool_)
    location, rotation, extent = np.zeros((count, 3)), np.zeros((count, 3)), np.ones((count, 3))
    for i, fact in enumerate(facts):
        if valid[i]:
            location[i], rotation[i] = fact.box.location, fact.box.rotation_deg
            extent[i] = fact.box.extent
    on_road = np.array([not fact.is_walker for fact in facts], dtype=np.bool_)
    bottom, pivot = -extent[:, 2], -location[:, 2]
    sinks = on_road & (pivot > bottom) & (pivot - bottom <= _MAX_SINK_M)
    ground = np.where(sinks, pivot, bottom)
    actor = pose_matrix(world.location[index], world.rotation_deg[index])
    world_from_box = multiply(actor, pose_matrix(location, rotation))
    return Scene(
        world=world,
        facts=facts,
        location=world.location[index],
        rotation_deg=world.rotation_deg[index],
        velocity=world.velocity[index],
        acceleration=world.acceleration[index],
        angular_velocity_deg=world.angular_velocity_deg[index],
        valid=valid,
        world_from_box=world_from_box,
        extent=extent,
        ground=ground,
        corners=box_corners(world_from_box, extent),
        world_from_ego=world_from_ego,
        ego_from_world=invert_pose(world_from_ego),
    )


def _scene_of_nobody(world: WorldFrame, world_from_ego: FloatArray) -> Scene:
    """A recording without objects' labels: to turn and multiply nothing takes time, too."""
    vectors, matrices = np.zeros((0, 3)), np.zeros((0, 4, 4))
    return Scene(
        world=world,
        facts=(),
        location=vectors,
        rotation_deg=vectors,
        velocity=vectors,
        acceleration=vectors,
        angular_velocity_deg=vectors,
        valid=np.zeros(0, dtype=np.bool_),
        world_from_box=matrices,
        extent=vectors,
        ground=np.zeros(0),
        corners=np.zeros((0, 8, 3)),
        world_from_ego=world_from_ego,
        ego_from_world=invert_pose(world_from_ego),
    )
