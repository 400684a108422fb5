"""Traffic lights and signs as actors: pose, trigger volume and head boxes of a site."""

from __future__ import annotations

import numpy as np

from carstage_sim.content.street_furniture import light_head_bounds, light_head_middles
from carstage_sim.geometry import pose_matrix, rotation_deg
from carstage_sim.labels import CityObjectLabel
from carstage_sim.maps.town import OrientedBox, TrafficLightSite, TrafficSignSite
from carstage_sim.world.actors import Actor
from carstage_sim.world.pose import Pose
from carstage_sim.world.state import ActorKind


def traffic_light_actor(actor_id: int, site: TrafficLightSite) -> tuple[Actor, Pose]:
    """The actor of a site. Its box is the trigger volume, as ``carla.TrafficLight`` has it."""
    center, extent = _trigger_in_actor_frame(site)
    actor = Actor(
        actor_id=actor_id,
        type_id="traffic.traffic_light",
        kind=ActorKind.TRAFFIC_LIGHT,
        attributes={},
        box_center=center,
        box_extent=extent,
        semantic_tags=(CityObjectLabel.TRAFFIC_LIGHT,),
        collides=False,
    )
    return actor, Pose(site.location, site.rotation_deg)


def traffic_sign_actor(actor_id: int, site: TrafficSignSite) -> tuple[Actor, Pose]:
    """The actor of a sign. Its box is the trigger volume, as ``carla.TrafficSign`` has it."""
    center, extent = _trigger_in_actor_frame(site)
    actor = Actor(
        actor_id=actor_id,
        type_id=site.type_id,
        kind=ActorKind.TRAFFIC_SIGN,
        attributes={},
        box_center=center,
        box_extent=extent,
        semantic_tags=(CityObjectLabel.TRAFFIC_SIGNS,),
        collides=False,
    )
    return actor, Pose(site.location, site.rotation_deg)


def head_boxes(site: TrafficLightSite) -> tuple[OrientedBox, ...]:
    """Tight boxes around the light heads, in the world: the arm's, then the mast's."""
    low, high = light_head_bounds()
    world_from_actor = pose_matrix(site.location, site.rotation_deg)
    boxes = []
    for middle in light_head_middles(site.head):
        world_from_head = world_from_actor @ pose_matrix(middle, (0.0, site.head[3], 0.0))
        cx, cy, cz = (world_from_head @ [*((low + high) / 2.0), 1.0])[:3].tolist()
        ex, ey, ez = ((high - low) / 2.0).tolist()
        pitch, yaw, roll = rotation_deg(world_from_head[:3, :3]).tolist()
        boxes.append(OrientedBox((cx, cy, cz), (ex, ey, ez), (pitch, yaw, roll)))
    return tuple(boxes)


def _trigger_in_actor_frame(
    site: TrafficLightSite | TrafficSignSite,
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Centre and half sizes of the smallest box, in the actor's axes, around all its volumes."""
    actor_from_world = np.linalg.inv(pose_matrix(site.location, site.rotation_deg))
    signs = np.array([[x, y, z, 1.0] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = [
        (
            actor_from_world
            @ pose_matrix(box.center, box.rotation_deg)
            @ (signs * [*box.extent, 1.0]).T
        ).T[:, :3]
        for box in site.trigger
    ]
    if not corners:
        return (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    cx, cy, cz = ((low + high) / 2.0).tolist()
    ex, ey, ez = ((high - low) / 2.0).tolist()
    return (cx, cy, cz), (ex, ey, ez)
