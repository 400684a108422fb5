"""Freezes the world into a snapshot: arrays that nothing writes to any more."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carstage_sim.content.posing import Pose as Joints
from carstage_sim.maps.town import Town
from carstage_sim.world.signals.traffic_lights import TrafficLightState, TrafficLightSystem
from carstage_sim.world.snapshot import (
    Snapshot,
    TrafficLightColumns,
    TrafficSignColumns,
    VehicleColumns,
    WalkerColumns,
)
from carstage_sim.world.state import ActorKind, WorldState
from carstage_sim.world.walkers.bones import posed_joints

if TYPE_CHECKING:
    from carstage_sim.world.world import World

_STANDING_MPS = 0.5


@dataclass(frozen=True, slots=True)
class SiteColumns:
    """What never changes about an episode's traffic lights and signs.

    Attributes:
        light_ids, sign_ids: OpenDRIVE signal ids.
        pole_index: ``(L,)`` uint32 place of each light within its group.
    """

    light_ids: tuple[str, ...]
    sign_ids: tuple[str, ...]
    pole_index: NDArray[np.uint32]


def site_columns(town: Town, lights: TrafficLightSystem) -> SiteColumns:
    """Reads them off a town and the system of its lights."""
    return SiteColumns(
        tuple(site.sign_id for site in town.traffic_lights),
        tuple(site.sign_id for site in town.traffic_signs),
        np.array([lights.group(i).index(i) for i in range(len(lights))], np.uint32),
    )


def freeze(world: World, sites: SiteColumns, delta_s: float) -> Snapshot:
    """The current frame of a world.

    Args:
        world: what to freeze; it may go on afterwards.
        sites: of the world's town.
        delta_s: simulated seconds that led to this frame.
    """
    table = world.actors
    count = len(table)
    vehicles = _vehicle_columns(world)
    walkers = _walker_columns(world)
    lights = _light_columns(world, sites)

    control = np.zeros((count, 3), np.float32)
    control[vehicles.rows] = vehicles.control
    control[walkers.rows, 0] = walkers.speed
    light_state = np.zeros(count, np.uint32)
    light_state[lights.rows] = lights.state
    light_state[vehicles.rows] = [
        actor.vehicle.light_state
        for actor in table.of_kind(ActorKind.VEHICLE)
        if actor.vehicle is not None
    ]
    wheel_angle_deg = np.zeros(count, np.float32)
    wheel_angle_deg[vehicles.rows] = world.fleet.wheel_angle_deg
    rolled_m = np.zeros(count)
    rolled_m[vehicles.rows] = world.fleet.rolled_m
    state = WorldState(
        frame=world.frame,
        timestamp_s=world.elapsed_s,
        delta_s=delta_s,
        weather=world.weather,
        actor_id=table.actor_id,
        kind=table.kind,
        type_id=table.type_id,
        location=table.location.copy(),
        rotation_deg=table.rotation_deg.copy(),
        velocity=table.velocity.copy(),
        angular_velocity_deg=table.angular_velocity_deg.copy(),
        acceleration=table.acceleration.copy(),
        light_state=light_state,
        control=control,
        colour=table.colour,
        wheel_angle_deg=wheel_angle_deg,
        rolled_m=rolled_m,
        collisions=world.collisions,
        figures=_posed_figures(world),
        wheelchairs=table.wheelchairs,
        hero_id=table.hero_id,
        doors=_open_doors(world),
        town_changes=world.town_changes(),
        debug_shapes=world.debug_drawing.frame,
        transmissions=world.v2x.transmissions,
    )
    return Snapshot(
        episode_id=world.episode_id,
        map_changed=world.frame == 1,
        state=state,
        vehicles=vehicles,
        walkers=walkers,
        traffic_lights=lights,
        traffic_signs=_sign_columns(world, sites),
        lights_changed=world.street_lights.changed_since_frame,
    )


def _open_doors(world: World) -> NDArray[np.uint8] | None:
    table = world.actors
    opened = [
        (table.row(actor.actor_id), actor.vehicle.open_doors)
        for actor in table.of_kind(ActorKind.VEHICLE)
        if actor.vehicle is not None and actor.vehicle.open_doors
    ]
    if not opened:
        return None
    doors = np.zeros(len(table), np.uint8)
    for row, bits in opened:
        doors[row] = bits
    return doors


def _posed_figures(world: World) -> dict[int, Joints]:
    posed = (walker for walker in world.actors.of_kind(ActorKind.WALKER) if walker.bones)
    figures = ((walker.actor_id, posed_joints(world.actors, walker)) for walker in posed)
    return {actor_id: joints for actor_id, joints in figures if joints is not None}


def _vehicle_columns(world: World) -> VehicleColumns:
    table, fleet = world.actors, world.fleet
    # The rows of the fleet ascend by id, as the table's do.
    rows = table.rows_of_kind(ActorKind.VEHICLE)
    light = _governing_lights(world)
    ids = np.array([*world.light_ids, 0], np.uint32)  # index -1 finds the last: no light
    states = np.array([*world.lights.state, TrafficLightState.GREEN], np.uint8)[light]
    states[_waits(world, light)] = TrafficLightState.RED
    return VehicleColumns(
        rows=rows,
        control=fleet.control.copy(),
        hand_brake=fleet.hand_brake.copy(),
        reverse=fleet.reverse,
        manual_gear_shift=fleet.manual.copy(),
        gear=fleet.gear.astype(np.int32),
        speed_limit_kmh=fleet.speed_limit_kmh.copy(),
        light_id=ids[light],
        light_state=states,
    )


def _waits(world: World, light: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Who has to let others pass at a junction without lights."""
    waiting = np.isin(world.fleet.ids, world.arm_turns.waiting_ids)
    return np.asarray(waiting & (light < 0))


def _governing_lights(world: World) -> NDArray[np.int32]:
    """Index of the light that each vehicle is at, -1 for none.

    Who stands in a trigger when its light turns red is out of it for that one frame. The Traffic
    Manager lets whom it saw at a green light pass it later (``SimulationState::
    UpdateTrafficLightState``); that is meant for who is passing, and sends off under red who had
    to stop there.
    """
    lights, fleet = world.lights, world.fleet
    light = lights.lights_at(*fleet.footprints())
    stands = np.abs(fleet.speed) < _STANDING_MPS
    # Index -1 finds the last, which stands for no light.
    light[stands & np.append(lights.turned_red, False)[light]] = -1
    return light


def _walker_columns(world: World) -> WalkerColumns:
    walkers = world.actors.of_kind(ActorKind.WALKER)
    controls = [actor.walker for actor in walkers]
    return WalkerColumns(
        rows=world.actors.rows_of_kind(ActorKind.WALKER),
        direction=np.array([c.direction for c in controls], np.float32).reshape(-1, 3),
        speed=np.array([c.speed for c in controls], np.float32),
        jump=np.array([c.jump for c in controls], np.bool_),
    )


def _sign_columns(world: World, sites: SiteColumns) -> TrafficSignColumns | None:
    if not sites.sign_ids:
        return None
    return TrafficSignColumns(world.actors.rows_of_kind(ActorKind.TRAFFIC_SIGN), sites.sign_ids)


def _light_columns(world: World, sites: SiteColumns) -> TrafficLightColumns:
    lights = world.lights
    return TrafficLightColumns(
        rows=world.actors.rows_of_kind(ActorKind.TRAFFIC_LIGHT),
        sign_id=sites.light_ids,
        green_s=lights.green_s.astype(np.float32),
        yellow_s=lights.yellow_s.astype(np.float32),
        red_s=lights.red_s.astype(np.float32),
        elapsed_s=lights.elapsed_s.astype(np.float32),
        pole_index=sites.pole_index,
        frozen=lights.frozen.copy(),
        state=lights.state.copy(),
    )
