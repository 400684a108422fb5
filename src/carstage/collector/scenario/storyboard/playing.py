"""Scenario ``storyboard``: everybody is spawned and moved as an OpenSCENARIO file says."""

from __future__ import annotations

import random
from typing import Any, Callable, Dict, List, Optional

import carla

from carstage.collector.actors import dress, find_blueprint
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.scenario.base import Population, Scenario, scenario
from carstage.collector.scenario.events.surroundings import Surroundings
from carstage.collector.scenario.storyboard.conditions import StoryState
from carstage.collector.scenario.storyboard.movers import (
    WALKER_Z_M,
    Mover,
    StoryCar,
    StoryWalker,
)
from carstage.collector.scenario.storyboard.parts import PlayedStoryboard
from carstage.collector.scenario.storyboard.places import Places
from carstage.collector.scenario.storyboard.road_users import RoadUsers
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, StoryboardSpec
from carstage.spec.story_parts import taking_part
from carstage.spec.storyboard import StoryEntity

RUN_UP_STEPS = 3
"""An accelerometer looks three steps back."""
DROPS_M = (0.2, 0.6, 1.5)
"""Heights above the ground to try: a spawn that touches it fails."""


@scenario("storyboard")
class Storyboard(Scenario):
    """An OpenSCENARIO file that Car-STAGE plays itself.

    Who is moved by the file has no physics, and is where the file puts it. Everybody stands in the
    warm-up but for its last steps, so that the first recorded one shows the file's speeds.
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
        assert isinstance(spec.scenario, StoryboardSpec)
        self._board = spec.scenario
        self._rng = random.Random(spec.seeds.spawn)
        self._transforms: Dict[str, Any] = {}
        self._actors: Dict[str, Any] = {}
        self._warmup_left = spec.warmup_ticks
        self._places = Places(session.map, self._transforms.__getitem__)

    def populate(self, check: Callable[[], None]) -> Population:
        """Spawn everybody at their places.

        Raises:
            SceneError: the server lacks a blueprint, the map a lane, or a place is taken.
        """
        for entity in self._board.entities:
            check()
            self._transforms[entity.name] = self._places.transform(entity.place)
            self._actors[entity.name] = self._spawn(entity)
        ego, *others = self._actors.values()
        vehicles = [actor for actor in others if actor.type_id.startswith("vehicle.")]
        walkers = sum(actor.type_id.startswith("walker.") for actor in others)
        counts = {"vehicles": len(vehicles), "pedestrians": walkers}
        return Population(ego, vehicles, [], counts, dict(counts))

    def start(self, population: Population) -> None:
        """Everybody stands where the file puts them."""
        super().start(population)
        session, spec = self._session, self._spec
        port = self._server.traffic_manager_port
        self._world = Surroundings(session, spec, population, port, self._rng)
        users = RoadUsers(self._actors, spec.step_s)
        places = Places(session.map, users.transform)
        movers = self._movers()
        world = StoryState(users, places, spec.step_s)
        self._played = PlayedStoryboard(self._board, movers, world)
        self._moved = movers
        self._world.send()

    def before_step(self, tick: Optional[int]) -> None:
        """Move everybody by a step; at the end of the warm-up they come to their places."""
        if tick is not None and tick > 0:
            self._played.step((tick - 1) * self._spec.step_s)
        else:
            self._run_up(self._warmup_left if tick is None else 0)
            self._warmup_left -= 1
        if self._board.entities[0].name not in self._moved:
            ego = self._actors[self._board.entities[0].name]
            self._lamps.light([ego], self._session.weather.values)
        self._world.send()

    def event_states(self) -> Optional[List[Dict[str, Any]]]:
        """How each event of the file stands, and each of its actions; None: it has none."""
        ids = {name: int(actor.id) for name, actor in self._actors.items()}
        ego = self._board.entities[0].name
        planned, states = self._board.planned_events(), self._played.states()
        return [
            {
                "state": state.state,
                "actors": [ids[name] for name in taking_part(part, ego)],
                "reason": state.reason,
                "execution": state.execution,
            }
            for part, state in zip(planned, states)
        ] or None

    def _run_up(self, steps_left: int) -> None:
        if steps_left > RUN_UP_STEPS:
            return
        for entity in self._board.entities:
            if entity.name in self._moved:
                self._moved[entity.name].run_up(entity.speed_m_s, steps_left)
            elif not steps_left and entity.speed_m_s > 0.0:
                actor = self._actors[entity.name]
                ahead = actor.get_transform().get_forward_vector()
                velocity = carla.Vector3D(entity.speed_m_s * ahead.x, entity.speed_m_s * ahead.y)
                self._world.commands.append(carla.command.ApplyTargetVelocity(actor.id, velocity))

    def _movers(self) -> Dict[str, Mover]:
        """Who moves all but an ego with a driver of its own."""
        found: Dict[str, Mover] = {}
        for index, entity in enumerate(self._board.entities):
            if index == 0 and self._spec.ego.driver is not None:
                continue
            family = entity.blueprint.split(".", 1)[0]
            mover = {"vehicle": StoryCar, "walker": StoryWalker}.get(family, Mover)
            actor, at = self._actors[entity.name], self._transforms[entity.name]
            found[entity.name] = mover(self._world, self._session.map, actor, at)
        return found

    def _spawn(self, entity: StoryEntity) -> Any:
        library = self._session.world.get_blueprint_library()
        blueprint = find_blueprint(library, entity.blueprint, "scenario.file")
        dress(blueprint, self._rng)
        role = "hero" if not self._actors else entity.name
        for name, value in {**entity.attributes, "role_name": role}.items():
            if blueprint.has_attribute(name):
                blueprint.set_attribute(name, value)
        at = self._transforms[entity.name]
        above_m = WALKER_Z_M if entity.blueprint.startswith("walker.") else 0.0
        for drop_m in (0.0, *DROPS_M) if entity.blueprint.startswith("static.") else DROPS_M:
            place = carla.Location(at.location.x, at.location.y, at.location.z + above_m + drop_m)
            transform = carla.Transform(place, at.rotation)
            actor = self._session.try_spawn(blueprint, transform)
            if actor is not None:
                self._session.destroy_on_exit("actor %d" % actor.id, actor)
                return actor
        raise SceneError(
            "scenario.file: there is no room for %s at (%.1f, %.1f)."
            % (entity.name, at.location.x, at.location.y),
            "Place it where nobody and nothing stands.",
        )
