"""Drawing the episodes of a configuration, and refusing what the server does not have."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from functools import lru_cache
from typing import Any, TypeVar

import numpy as np

from carstage.config import Config
from carstage.config.agents import VehicleAgent
from carstage.config.dimensions import Variants, dimensions
from carstage.config.drivers import ReplayDriver
from carstage.config.fields import unknown
from carstage.config.labels import Labels
from carstage.config.scene import map_name
from carstage.config.timing import Timing
from carstage.config.traffic import Vehicles
from carstage.config.weather import WeatherConfig
from carstage.errors import ConfigError
from carstage.plan.agents import are_as_asked, plan_agents
from carstage.plan.canonical import CanonicalTexts
from carstage.plan.draws import Draws
from carstage.plan.drivers import (
    Drive,
    check_drive,
    driven_again,
    plan_comfort,
    plan_driver,
)
from carstage.plan.episodes import EpisodePlan
from carstage.plan.estimate import COST, EpisodeCosts
from carstage.plan.facts import ServerFacts
from carstage.plan.offered import check_offered, offered_presets
from carstage.plan.patches import plan_patches
from carstage.plan.rig import plan_sensors
from carstage.plan.sampling import Sampling
from carstage.plan.scenario import plan_scenario
from carstage.plan.sources import Source
from carstage.plan.starts import plan_start
from carstage.plan.stereo import planned_pairs
from carstage.spec import (
    BirdsEyeSpec,
    EgoSpec,
    EpisodeSpec,
    GroundTruthSpec,
    GroupSpec,
    LabelsSpec,
    OccupancySpec,
    PedestriansSpec,
    Seeds,
    SensorSpec,
    TimingSpec,
    TrafficSpec,
    VariantSpec,
    VehiclesSpec,
    WeatherChange,
    WeatherSpec,
)
from carstage.spec.patches import PatchSpec

_CHOICES_STREAM = 1000
_LARGEST_SEED = 0x7FFF_FFFF  # CARLA keeps noise seeds in signed 32-bit integers
_READ_OTHERWISE = {"cameras", "lidars", "boxes", "level_objects", "birds_eye", "occupancy"}
"""Of the label settings."""


Made = TypeVar("Made")


def plan_episodes(
    config: Config, facts: ServerFacts, recording: Source | None = None
) -> EpisodePlan:
    """The episodes of a configuration.

    The same configuration and facts always give the same episodes: an episode's draws depend on the
    seed and its index only, so that more episodes do not change the first ones.

    Args:
        config: what the user asks for.
        facts: what the server offers.
        recording: what scenario or driver plays, where that is a file.

    Raises:
        ConfigError: the server lacks a map, a blueprint, an attribute or a spawn point, a sensor is
            beyond its limits, or the recording is shorter than the episode.
    """
    if isinstance(recording, Drive):
        check_drive(config, recording)
    check_offered(config.without_variants(), facts, recording)
    _check_stereo(config)
    _check_samples_offered(config, facts, recording)
    _check_variants_offered(config, facts, recording)
    planners = _planners_of(config, facts, recording)

    def make(number: int) -> EpisodeSpec:
        index, place = divmod(number, len(planners))
        return planners[place].episode(index)

    texts = [CanonicalTexts() for _ in planners]
    costs = [EpisodeCosts() for _ in planners]
    ids, needs = [], np.empty(config.planned_episodes, COST)
    for number in range(config.planned_episodes):
        spec, place = make(number), number % len(planners)
        ids.append(texts[place].episode_id(spec))
        needs[number] = costs[place].of(spec)
    return EpisodePlan(make, np.arange(config.planned_episodes), tuple(ids), needs)


def _check_stereo(config: Config) -> None:
    """Refuse disparity where no rig has a stereo pair.

    Raises:
        ConfigError: names the field.
    """
    if not config.labels.disparity:
        return
    views = [config, *map(config.as_variant, config.variants)]
    rigs = [view for one in views for view in (one, *map(one.seen_by, one.agents))]
    if not any(planned_pairs(plan_sensors(rig)) for rig in rigs):
        raise ConfigError(
            "labels.disparity: the rig has no rectified stereo pair.",
            "It takes two labelled colour cameras without distortion, of equal size, lens and "
            "direction, one to the right of the other.",
        )


def _planners_of(
    config: Config, facts: ServerFacts, recording: Source | None
) -> Sequence[_Planner | _VariantPlanner]:
    """What makes the specifications of an index: one for each variant, if there are any."""
    base = _Planner(config, facts, recording)
    if not config.variants:
        return (base,)
    texts = CanonicalTexts()

    @lru_cache(maxsize=1)
    def base_id(index: int) -> str:
        return texts.episode_id(base.episode(index))

    return tuple(
        _VariantPlanner(name, _Planner(config, facts, recording, name), base_id)
        for name in config.variants
    )


def _check_variants_offered(config: Config, facts: ServerFacts, recording: Source | None) -> None:
    """Refuse what a variant has of its own and the server does not have.

    Raises:
        ConfigError: with the path of the value.
    """
    for name in config.variants:
        try:
            check_offered(config.as_variant(name), facts, recording)
        except ConfigError as error:
            raise ConfigError(f"variants.{name}.{error.message}", error.hint) from error


def _check_samples_offered(config: Config, facts: ServerFacts, recording: Source | None) -> None:
    """Refuse sampled values that the server does not have, before any of them is drawn.

    Raises:
        ConfigError: with the path of the value.
    """
    for dimension in dimensions(config):
        variants = Variants(config, [dimension.path])
        for place, value in dimension.sampled.ends:
            varied = variants.with_values({dimension.path: value})
            try:
                check_offered(varied, facts, recording)
                _maps(varied, facts, recording)
            except ConfigError as error:
                message = error.message
                if message.startswith(dimension.name):
                    message = dimension.path_to(place) + message.removeprefix(dimension.name)
                raise ConfigError(message, error.hint) from error


class _Planner:
    """Makes specifications; sections that episodes have in common are made once.

    Args:
        config: what the user asks for.
        facts: what the server offers.
        recording: what scenario or driver plays, where that is a file.
        variant: name of the variant to make; None: the episode without any.
    """

    def __init__(
        self,
        config: Config,
        facts: ServerFacts,
        recording: Source | None,
        variant: str | None = None,
    ) -> None:
        self.sampling = Sampling(config)
        self._variant = variant
        self._facts = facts
        self._recording = recording
        self._draws = Draws(config.seed)
        self._made: dict[str, tuple[tuple[Any, ...], Any]] = {}

    def episode(self, index: int) -> EpisodeSpec:
        """The specification of an index.

        Raises:
            ConfigError: the server lacks a map or a spawn point.
        """
        config, facts = self.config(index), self._facts
        # Each choice is drawn whether it is free or not, so that fixing one moves no other.
        map_draw, weather_draw, spawn_draw = self._draws.uniform(index, _CHOICES_STREAM, 3)
        maps = self._once("maps", (config.map,), lambda: _maps(config, facts, self._recording))
        name = _pick(maps, map_draw)
        presets = offered_presets(config.weather, facts.dialect)
        preset = _pick(presets, weather_draw) if presets else None
        weather = self._once(
            "weather", (config.weather, preset), lambda: _weather(config.weather, preset)
        )
        recording = self._recording
        if isinstance(recording, Drive):
            driven = driven_again(recording, index, self.settings(config), weather)
            return replace(driven, patches=self.patches(config, index))
        scenario = self._once(
            "scenario",
            (config.scenario, name, config.duration_s, config.fps),
            lambda: plan_scenario(config, facts.count(name), recording),
        )
        named = [agent.spawn for agent in config.agents if isinstance(agent, VehicleAgent)]
        taken = {spawn for spawn in named if isinstance(spawn, int)}
        start = plan_start(config.ego.spawn, facts, name, spawn_draw, "ego", "spawn", taken=taken)
        if start["spawn_index"] is not None:
            taken.add(start["spawn_index"])
        return EpisodeSpec(
            **self.settings(config),
            index=index,
            map=name,
            opendrive=facts.opendrive.get(name),
            weather=weather,
            ego=EgoSpec(
                blueprint=config.ego.blueprint,
                color=None if config.ego.color == "random" else config.ego.color,
                **start,
                driver=plan_driver(config, config.ego.driver),
                comfort=plan_comfort(config.ego.driver),
            ),
            scenario=scenario,
            seeds=self.seeds(index),
            agents=plan_agents(config, facts, name, index, self._draws, self.agent_sensors, taken),
            patches=self.patches(config, index),
        )

    def config(self, index: int) -> Config:
        """The configuration of an index: its sampled values, then what the variant has."""
        config = self.sampling.config(index)
        if self._variant is not None:
            return config.as_variant(self._variant)
        return config.without_variants() if config.variants else config

    def agent_sensors(self, config: Config, position: int) -> tuple[SensorSpec, ...]:
        """The sensors of an agent."""
        agent = config.agents[position]
        of = (agent.rig, config.labels, config.fps, config.image_size)
        return self._once(f"agents[{position}]", of, lambda: plan_sensors(config.seen_by(agent)))

    def patches(self, config: Config, index: int) -> tuple[PatchSpec, ...]:
        """The patches of an index; ``config`` is the one of that index."""
        return plan_patches(config, index, self._draws)

    def seeds(self, index: int) -> Seeds:
        """One integer for each consumer of randomness in an episode."""
        words = (self._draws.word(index, stream) for stream in range(len(fields(Seeds))))
        return Seeds(*(word & _LARGEST_SEED for word in words))

    def _once(self, name: str, of: tuple[Any, ...], make: Callable[[], Made]) -> Made:
        """What was made of the very same values before, or else is made now."""
        known = self._made.get(name)
        if known is None or not all(a is b for a, b in zip(known[0], of, strict=True)):
            known = self._made[name] = (of, make())
        made: Made = known[1]
        return made

    def settings(self, config: Config) -> dict[str, Any]:
        """The keys of a specification that follow from the settings alone."""
        once, timing = self._once, config.timing
        rig = (config.rig, config.labels, config.fps, config.image_size)
        return {
            "dialect": self._facts.dialect,
            "map_layers": None if config.map.layers == "all" else config.map.layers,
            "steps": config.steps,
            "fps": config.fps,
            "save_every": config.save_every,
            "warmup_ticks": timing.warmup_ticks,
            "timing": once("timing", (timing, config.fps), lambda: _timing(timing, config.fps)),
            "vehicles": once("vehicles", (config.vehicles,), lambda: _vehicles(config.vehicles)),
            "pedestrians": once(
                "pedestrians",
                (config.pedestrians,),
                lambda: PedestriansSpec(**config.pedestrians.by_key()),
            ),
            "traffic": once(
                "traffic", (config.traffic,), lambda: TrafficSpec(**config.traffic.by_key())
            ),
            "sensors": once("sensors", rig, lambda: plan_sensors(config)),
            "labels": once("labels", (config.labels,), lambda: _labels(config.labels)),
            "ground_truth": once(
                "ground_truth",
                (config.ground_truth,),
                lambda: GroundTruthSpec(**config.ground_truth.by_key()),
            ),
            "max_distance_m": config.max_distance_m,
            "min_lidar_points": config.min_lidar_points,
            "wet_grip": config.wet_grip,
        }


class _VariantPlanner:
    """Makes the specifications of one variant.

    Args:
        name: of the variant.
        planner: makes them, but for what variant they are.
        base_id: gives the id of an index as it would be without variants.
    """

    def __init__(self, name: str, planner: _Planner, base_id: Callable[[int], str]) -> None:
        self._name = name
        self._planner = planner
        self._base_id = base_id

    def episode(self, index: int) -> EpisodeSpec:
        """The specification of an index.

        Raises:
            ConfigError: the server lacks a map or a spawn point.
        """
        variant = VariantSpec(self._name, self._base_id(index))
        return replace(self._planner.episode(index), variant=variant)


class PlanMatcher:
    """Finds episodes of a configuration among recorded ones, without asking its server.

    Args:
        config: the configuration.
    """

    def __init__(self, config: Config) -> None:
        self._config = config
        facts, names = ServerFacts(maps={}), tuple(config.variants) or (None,)
        self._planners = {name: _Planner(config, facts, None, name) for name in names}
        self.sampling = self._planners[names[0]].sampling

    def number_of(self, spec: EpisodeSpec) -> int | None:
        """The number of an episode among those planned, from 0; None where it is of another.

        The variants of an episode follow one another. Map, spawn point, weather and what the
        server speaks are not compared.

        Args:
            spec: of a recorded episode.

        Raises:
            ConfigError: the values of that episode do not go together.
        """
        name = None if spec.variant is None else spec.variant.name
        if name not in self._planners or spec.index >= self._config.episodes:
            return None
        planner = self._planners[name]
        if spec.seeds != planner.seeds(spec.index):
            return None
        config = planner.config(spec.index)
        driver = config.ego.driver
        if isinstance(driver, ReplayDriver) or plan_driver(config, driver) != spec.ego.driver:
            return None
        if plan_comfort(driver) != spec.ego.comfort:
            return None
        if not are_as_asked(spec.agents, config, planner.agent_sensors):
            return None
        if spec.patches != planner.patches(config, spec.index):
            return None
        wanted = planner.settings(config)
        del wanted["dialect"]
        if all(getattr(spec, name) == value for name, value in wanted.items()):
            return self._config.number_of(spec.index, name)
        return None


def _timing(timing: Timing, fps: float) -> TimingSpec:
    substeps = timing.substeps(fps)
    return TimingSpec(
        mode=timing.mode,
        sensor_sync=timing.sensor_sync,
        max_substep_delta_time_s=substeps.max_substep_delta_time_s,
        max_substeps=substeps.max_substeps,
        on_incomplete=timing.on_incomplete,
    )


def _vehicles(vehicles: Vehicles) -> VehiclesSpec:
    groups = tuple(GroupSpec(**group.by_key()) for group in vehicles.groups)
    return VehiclesSpec(**vehicles.by_key(without={"groups"}), groups=groups)


def _labels(labels: Labels) -> LabelsSpec:
    birds_eye, occupancy = labels.birds_eye, labels.occupancy
    return LabelsSpec(
        **labels.by_key(without=_READ_OTHERWISE),
        boxes=tuple(sorted(set(labels.boxes))),
        level_objects=tuple(sorted(set(labels.level_objects))),
        birds_eye=None if birds_eye is None else BirdsEyeSpec(**birds_eye.by_key()),
        occupancy=None if occupancy is None else OccupancySpec(**occupancy.by_key()),
    )


def _weather(weather: WeatherConfig, preset: str | None) -> WeatherSpec:
    return WeatherSpec(
        preset=preset,
        parameters=weather.parameters.given(),
        lights=weather.lights,
        changes=tuple(
            WeatherChange(change.at_s, change.choice, change.parameters.given())
            for change in weather.changes
        ),
    )


def _pick(names: Iterable[str], draw: float) -> str:
    options = tuple(names)
    return options[int(draw * len(options))]


def _maps(config: Config, facts: ServerFacts, recording: Source | None) -> tuple[str, ...]:
    """The maps that an episode may get.

    Raises:
        ConfigError: the server does not have one of them.
    """
    if recording is not None:
        field = "ego.driver.episode" if isinstance(recording, Drive) else recording.field
        wanted: tuple[tuple[str, str], ...] = ((field, recording.map),)
    elif config.map.choice is not None:
        wanted = (("map.choice", config.map.choice),)
    elif "all" in (config.map.random_from or ()):
        return tuple(sorted(facts.maps))
    else:
        names = config.map.random_from or ()
        wanted = tuple((f"map.random_from[{i}]", name) for i, name in enumerate(names))
    found = []
    for path, name in wanted:
        short = map_name(name)
        if short not in facts.maps:
            message, hint = unknown("map", name, facts.maps)
            raise ConfigError(f"{path}: {message}", hint)
        found.append(short)
    return tuple(found)
