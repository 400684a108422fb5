"""Scenario ``replay``: everybody moves as in a recorded episode, whatever sensors look on."""

from __future__ import annotations

import logging
import math
from typing import Any, Callable, Dict, List, Optional, Sequence

import carla

from carstage.collector.actors import find_blueprint
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.scenario.base import Population, Scenario, scenario
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, ReplayedActor, ReplaySpec

DROPS_M = (0.3, 1.0, 4.0, 20.0)
"""Heights above the recorded place to try: a spawn that touches the road or a neighbour fails."""

PoseRow = Sequence[float]
_log = logging.getLogger(__name__)


@scenario("replay")
class Replay(Scenario):
    """Vehicles and walkers are put where they were, step by step; nobody drives them.

    They have no physics meanwhile. Their velocity is set explicitly, so snapshots and sensors
    hold it. In the last steps of the warm-up they run up to their first place, so that they move
    in the first recorded step as they did.
    """

    def __init__(
        self,
        client: Any,
        session: WorldSession,
        spec: EpisodeSpec,
        server: ServerPlan,
        program: Optional[ProgramPlan] = None,
    ) -> None:
        super().__init__(client, session, spec, server, program)
        assert isinstance(spec.scenario, ReplaySpec)
        self._roles = spec.scenario.actors
        self._alive: Dict[int, Any] = {}
        self._ego: Any = None
        self._run_up_left = spec.warmup_ticks

    def populate(self, check: Callable[[], None]) -> Population:
        """Spawn everybody who is there at the first step; the ego is the first role.

        Raises:
            SceneError: the server lacks a blueprint, or has no room for the ego.
        """
        for index in range(len(self._roles)):
            check()
            self._appear(index, 0)
        if 0 not in self._alive:
            raise SceneError(
                "scenario: there is no room for the recorded ego at its first place.",
                "Use the map and the server version that it was recorded with.",
            )
        self._ego = self._alive[0]
        walkers = self._count("walker.", self._roles)
        vehicles = len(self._roles) - walkers - 1
        spawned_walkers = self._count("walker.", [self._roles[i] for i in self._alive])
        return Population(
            self._ego,
            [self._alive[i] for i in sorted(self._alive) if self._is_vehicle(i) and i > 0],
            [],
            {"vehicles": vehicles, "pedestrians": walkers},
            {
                "vehicles": len(self._alive) - spawned_walkers - 1,
                "pedestrians": spawned_walkers,
            },
        )

    def before_step(self, tick: Optional[int]) -> None:
        """Put everybody where they were at this step; through the warm-up, where they came from."""
        commands: List[Any] = []
        for index in range(len(self._roles)):
            commands += self._step(index, tick)
        if tick is None:
            self._run_up_left -= 1
        self._client.apply_batch(commands)
        vehicles = [self._alive[i] for i in sorted(self._alive) if self._is_vehicle(i)]
        self._lamps.light(vehicles, self._session.weather.values)

    def _step(self, index: int, tick: Optional[int]) -> List[Any]:
        """The commands that move one road user; it appears and disappears here."""
        poses = self._roles[index].poses
        if tick is not None and tick > 0 and poses[tick - 1] is None:
            self._appear(index, tick)
        if index not in self._alive:
            return []
        number = -self._run_up_left if tick is None else tick
        pose = self._pose(index, number)
        if pose is None:
            gone = self._alive.pop(index)
            self._client.apply_batch_sync([carla.command.DestroyActor(gone.id)], False)
            return []
        velocity, turn = carla.Vector3D(), carla.Vector3D()
        before = self._pose(index, number - 1)
        after = self._pose(index, number + 1)
        if number == 0 and self._roles[index].run_up is None:
            before = None
        if before is not None:
            velocity, turn = _rates(before, pose, self._spec.step_s)
        elif after is not None:
            velocity, turn = _rates(pose, after, self._spec.step_s)
        return self._motion(index, _transform(pose), velocity, turn) + self._driving(index, tick)

    def _pose(self, index: int, step: int) -> Optional[PoseRow]:
        """Where a road user is at a step; those before the first, counted down from -1, run up."""
        role = self._roles[index]
        run_up = role.run_up or ()
        if step >= 0 or role.poses[0] is None:
            return role.poses[step] if 0 <= step < len(role.poses) else None
        return run_up[max(step, -len(run_up))] if run_up else role.poses[0]

    def _motion(self, index: int, transform: Any, velocity: Any, turn: Any) -> List[Any]:
        actor = self._alive[index]
        if not self._is_vehicle(index):
            # Not ApplyWalkerState, which takes the place of the feet as navigation gives it. The
            # control is for the gait: a CARLA server also lets it carry the walker a step on.
            speed_m_s = math.hypot(velocity.x, velocity.y)
            ahead = carla.Vector3D()
            if speed_m_s > 0.0:
                ahead = carla.Vector3D(velocity.x / speed_m_s, velocity.y / speed_m_s, 0.0)
            walk = carla.WalkerControl(ahead, speed_m_s, False)
            return [
                carla.command.ApplyTransform(actor.id, transform),
                carla.command.ApplyWalkerControl(actor.id, walk),
            ]
        return [
            carla.command.ApplyTransform(actor.id, transform),
            carla.command.ApplyTargetVelocity(actor.id, velocity),
            carla.command.ApplyTargetAngularVelocity(actor.id, turn),
        ]

    def _driving(self, index: int, tick: Optional[int]) -> List[Any]:
        """What the recorded driver did; without physics it moves nothing, but can be read back."""
        controls = self._roles[index].controls
        if controls is None:
            return []
        now = controls[tick or 0]
        control = carla.VehicleControl(
            throttle=now.throttle,
            steer=now.steer,
            brake=now.brake,
            hand_brake=bool(now.hand_brake),
            reverse=bool(now.reverse),
            manual_gear_shift=True,
            gear=int(now.gear),
        )
        return [carla.command.ApplyVehicleControl(self._alive[index].id, control)]

    def _appear(self, index: int, step: int) -> None:
        """Spawn a road user at its pose of a step, if it is there and finds room."""
        role = self._roles[index]
        pose = role.poses[step]
        if pose is None:
            return
        library = self._session.world.get_blueprint_library()
        path = "scenario.actors[%d].blueprint" % index
        blueprint = find_blueprint(library, role.blueprint, path)
        for name, value in role.attributes.items():
            if blueprint.has_attribute(name) and blueprint.get_attribute(name).is_modifiable:
                blueprint.set_attribute(name, value)
        for drop_m in DROPS_M:
            place = _transform(pose)
            place.location.z += drop_m
            actor = self._session.try_spawn(blueprint, place)
            if actor is not None:
                break
        else:
            _log.warning("no room for %s at %s: it is left out", role.blueprint, pose[:3])
            return
        self._session.destroy_on_exit("actor %d" % actor.id, actor)
        actor.set_simulate_physics(False)
        self._alive[index] = actor

    def _is_vehicle(self, index: int) -> bool:
        return self._roles[index].blueprint.startswith("vehicle.")

    def _count(self, family: str, roles: Sequence[ReplayedActor]) -> int:
        return sum(role.blueprint.startswith(family) for role in roles)


def _transform(pose: PoseRow) -> Any:
    x, y, z, pitch, yaw, roll = pose
    return carla.Transform(carla.Location(x, y, z), carla.Rotation(pitch, yaw, roll))


def _rates(before: PoseRow, after: PoseRow, step_s: float) -> Any:
    """Velocity (m/s) and angular velocity (deg/s, about x, y, z) between two poses."""
    moved = [(b - a) / step_s for a, b in zip(before[:3], after[:3])]
    pitch, yaw, roll = (
        ((b - a + 180.0) % 360.0 - 180.0) / step_s for a, b in zip(before[3:], after[3:])
    )
    return carla.Vector3D(*moved), carla.Vector3D(roll, pitch, yaw)
