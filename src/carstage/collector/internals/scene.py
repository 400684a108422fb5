"""An episode's scene: everybody and everything that was spawned, ready to be stepped."""

from __future__ import annotations

from types import MappingProxyType
from typing import (
    TYPE_CHECKING,
    Any,
    Callable,
    Dict,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Sequence,
)

from carstage.collector.drivers.base import Driver
from carstage.collector.drivers.driving import EgoDriving
from carstage.collector.drones import DroneFlight
from carstage.collector.internals.plan import ProgramPlan, ServerPlan
from carstage.collector.internals.resting import NONE_RESTS, Resting
from carstage.collector.internals.traffic_manager_wakeup import TickWatch, started_threads
from carstage.collector.patch_carriers import place_carriers, send_to_ego
from carstage.collector.patches import PlacedPatch, place_patches
from carstage.collector.pedestrian_rules import PedestrianRules
from carstage.collector.scenario import Population, Scenario, make_scenario
from carstage.collector.sensors.rig import Rig
from carstage.collector.timing import CLOCKS, Clock, Tick
from carstage.collector.walking_groups import WalkingGroups
from carstage.collector.world import WorldSession
from carstage.spec import EpisodeSpec, stream_of

if TYPE_CHECKING:
    from carstage.collector.scenario.events import EventRunner


class Party(NamedTuple):
    """The ego or an agent at work: what carries its sensors, they themselves, and who drives it.

    Attributes:
        name: of the agent; empty: the ego.
        number: of the agent, from 1; 0: the ego.
        actor: ``carla.Actor``.
        is_vehicle: whether it is a ``carla.Vehicle``.
        rig: its sensors.
        driving: its driver at work; None: the Traffic Manager drives, or nobody.
        flight: of a drone: what moves it.
    """

    name: str
    number: int
    actor: Any
    is_vehicle: bool
    rig: Rig
    driving: Optional[EgoDriving]
    flight: Optional[DroneFlight] = None

    def stream(self, sensor_id: str) -> str:
        """Stream of the raw log that one of its sensors is recorded in."""
        return stream_of(sensor_id, self.number) if self.number else sensor_id

    @property
    def command(self) -> Optional[List[Any]]:
        """What its driver commanded for the last step; None: it has none of its own."""
        return None if self.driving is None else self.driving.command

    @property
    def noted(self) -> Dict[str, Any]:
        """What the log notes of it in each step beside its place."""
        noted: Dict[str, Any] = {}
        if self.command is not None:
            noted["driver"] = list(self.command)
        if self.flight is not None:
            noted["motion"] = self.flight.noted
        return noted


class Scene:
    """What stands in the world, and how it gets from one step to the next.

    Args:
        session: the episode's world.
        clock: makes or awaits steps.
        scenario: moves who is moved by us.
        parties: the ego, then the agents.
        population: who was spawned.
        step_s: simulated time of a step.
        event_runner: what happens to the ego beside the scenario; None: nothing.
        pedestrian_rules: stops pedestrians at kerbs.
        walking_groups: keeps those who walk together side by side.
        patches: pictures on boards.
        resting: which sensors do not measure in every step.
    """

    def __init__(
        self,
        session: WorldSession,
        clock: Clock,
        scenario: Scenario,
        parties: Sequence[Party],
        population: Population,
        step_s: float,
        event_runner: Optional[EventRunner],
        pedestrian_rules: PedestrianRules,
        walking_groups: WalkingGroups,
        patches: Sequence[PlacedPatch] = (),
        resting: Resting = NONE_RESTS,
    ) -> None:
        self._session = session
        self._clock = clock
        self._scenario = scenario
        self._step_s = step_s
        self._event_runner = event_runner
        self._pedestrian_rules = pedestrian_rules
        self._walking_groups = walking_groups
        self._parties = tuple(parties)
        self.ego: Any = population.ego
        self.patches = tuple(patches)
        self.resting = resting
        self.requested: Dict[str, int] = population.requested
        self.spawned: Dict[str, int] = population.spawned

    def step(self, tick: Optional[int]) -> Tick:
        """Prepare the next step and make it; ``tick`` is None in the warm-up.

        Raises:
            RecordingError: the server's state is not the one of that step.
            DriverError: the ego's driver failed.
            RuntimeError: the server did not answer in time.
        """
        self._session.weather.advance((tick or 0) * self._step_s)
        self._scenario.before_step(tick)
        if self._event_runner is not None:
            self._event_runner.before_step(tick)
        self._pedestrian_rules.before_step()
        self._walking_groups.before_step()
        for party in self._parties:
            if party.driving is not None:
                party.driving.before_step(tick)
            if party.flight is not None:
                party.flight.before_step(tick)
            party.rig.move_followers()
        return self._clock.step()

    def event_states(self) -> Optional[List[Dict[str, Any]]]:
        """How the planned events stood in the last step; None: none are planned."""
        if self._event_runner is None:
            return self._scenario.event_states()
        return self._event_runner.states()

    def command(self) -> Optional[List[Any]]:
        """What the ego's driver commanded for the last step; None: it has none of its own."""
        return self._parties[0].command

    @property
    def rig(self) -> Rig:
        """The ego's sensors."""
        return self._parties[0].rig

    @property
    def agents(self) -> Sequence[Party]:
        """The agents beside the ego."""
        return self._parties[1:]

    @property
    def expected_bytes(self) -> Dict[str, int]:
        """Upper estimate of one tick's payload, by stream, of all sensors."""
        return {
            party.stream(name): size
            for party in self._parties
            for name, size in party.rig.expected_bytes.items()
        }

    def listen(
        self,
        callback: Callable[[str], Callable[[Any], None]],
        wanted: Callable[[str], bool] = lambda stream: True,
    ) -> None:
        """Listen to sensors; ``callback`` gives what takes the data of a stream that is wanted."""
        for party in self._parties:
            streams = {name: party.stream(name) for name in party.rig.actors}
            party.rig.listen(
                {name: callback(stream) for name, stream in streams.items() if wanted(stream)}
            )

    def stop_listening(self) -> None:
        """Stop listening; stopping what never listened does nothing."""
        for party in self._parties:
            party.rig.stop()


def build_scene(
    client: Any,
    session: WorldSession,
    spec: EpisodeSpec,
    server: ServerPlan,
    check: Callable[[], None],
    drivers: Mapping[str, Driver] = MappingProxyType({}),
    program: Optional[ProgramPlan] = None,
    resting: Resting = NONE_RESTS,
) -> Scene:
    """Spawn everybody and everything, in an order that depends on the plan alone.

    Args:
        client: ``carla.Client``.
        session: the episode's world.
        spec: the episode.
        server: for its timeout and the Traffic Manager's port.
        check: called between long stretches; raises when somebody asks to end.
        drivers: by name of the agent, ``""`` of the ego; of others the Traffic Manager, or nobody.
        program: of scenario ``scenic`` or ``openscenario``.
        resting: which sensors do not measure in every step.

    Raises:
        SceneError: the server cannot make the planned scene.
    """
    check()
    if spec.scenario.events:
        from carstage.collector.scenario.events import check_map

        check_map(spec, session.map)
    scenario = make_scenario(client, session, spec, server, program)
    population = scenario.populate(check)
    check()
    with started_threads() as manager:
        scenario.prepare()
    watch = TickWatch(session.world, server.traffic_manager_port, manager)
    session.on_exit("tick watch", watch.stop)
    clock = CLOCKS[spec.timing.synchronous](session.world, server.timeout_s, watch)
    clock.step()  # so that the client knows what was spawned
    carriers = place_carriers(session, spec, population) if scenario.may_place else {}
    if carriers:
        clock.step()  # people begin to walk where the newest frame has them
    scenario.start(population)
    walkers = send_to_ego(session, population, carriers)
    parties = [
        _party(session, spec, server, drivers, name, number, actor, resting)
        for number, (name, actor) in enumerate(
            [("", population.ego), *((a.spec.name, a.actor) for a in population.agents)]
        )
    ]
    for number, agent in enumerate(spec.agents, 1):
        if agent.drone is not None:
            carrier = parties[number].actor
            flight = DroneFlight(session, agent.drone, carrier, population.ego, spec.step_s)
            parties[number] = parties[number]._replace(flight=flight)
    event_runner = _event_runner(session, spec, population, server, scenario)
    rules = PedestrianRules(session, walkers, spec.step_s)
    groups = WalkingGroups(session, walkers, spec.step_s, rules)
    patches = place_patches(session, spec, population, carriers)
    return Scene(
        session, clock, scenario, parties, population, spec.step_s, event_runner, rules, groups,
        patches, resting,
    )  # fmt: skip


def _event_runner(
    session: WorldSession,
    spec: EpisodeSpec,
    population: Population,
    server: ServerPlan,
    scenario: Scenario,
) -> Optional[EventRunner]:
    """What makes the planned events happen; None where there are none."""
    if not spec.scenario.events:
        return None
    from carstage.collector.scenario.events import EventRunner

    port = server.traffic_manager_port
    return EventRunner(session, spec, population, port, scenario.driven_gently())


def _party(
    session: WorldSession,
    spec: EpisodeSpec,
    server: ServerPlan,
    drivers: Mapping[str, Driver],
    name: str,
    number: int,
    actor: Any,
    resting: Resting,
) -> Party:
    """Spawn the sensors of the ego or an agent, and give its driver the vehicle."""
    own, path = (spec, "") if not number else (spec.seen_by(name), "agents[%d]." % (number - 1))
    intervals_s = {
        sensor.id: resting.interval_s
        for sensor in own.sensors
        if (stream_of(sensor.id, number) if number else sensor.id) in resting.streams
    }
    rig = Rig(session, own, actor, path, intervals_s)
    driving = None
    if name in drivers:
        field = "%s.driver" % (path.rstrip(".") or "ego")
        driving = EgoDriving(session, own, drivers[name], actor, rig, server.timeout_s, field)
    return Party(name, number, actor, own.ego.is_vehicle, rig, driving)
