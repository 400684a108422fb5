"""Drawing the episodes of a configuration, and refusing what the server does not have."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from typing import Any

import numpy as np

from carstage.config import Config
from carstage.config.fields import unknown
from carstage.config.scene import Stand as ConfiguredStand
from carstage.errors import ConfigError
from carstage.plan.facts import ServerFacts
from carstage.plan.offered import check_offered
from carstage.plan.rig import plan_sensors
from carstage.plan.scenario import Recording, plan_scenario
from carstage.spec import (
    EgoSpec,
    EpisodeSpec,
    GroundTruthSpec,
    GroupSpec,
    LabelsSpec,
    PedestriansSpec,
    Seeds,
    Stand,
    TimingSpec,
    TrafficSpec,
    VehiclesSpec,
    WeatherChange,
    WeatherSpec,
)

_CHOICES_STREAM = 1000
_LARGEST_SEED = 0x7FFF_FFFF  # CARLA keeps noise seeds in signed 32-bit integers


def plan_episodes(
    config: Config, facts: ServerFacts, recording: Recording | None = None
) -> tuple[EpisodeSpec, ...]:
    """The episodes of a configuration.

    The same configuration and facts always give the same episodes: an episode's draws depend on the
    seed and its index only, so that more episodes do not change the first ones.

    Args:
        config: what the user asks for.
        facts: what the server offers.
        recording: what scenario ``replay`` moves the road users by.

    Raises:
        ConfigError: the server lacks a map, a blueprint, an attribute or a spawn point, a sensor is
            beyond its limits, or the recording is shorter than the episode.
    """
    check_offered(config, facts, recording)
    maps = _maps(config, facts, recording)
    sensors = plan_sensors(config)
    substeps = config.timing.substeps(config.fps)
    episodes = []
    for index in range(config.episodes):
        draw = np.random.default_rng(_sequence(config.seed, index, _CHOICES_STREAM))
        # Each choice is drawn whether it is free or not, so that fixing one moves no other.
        map_draw, weather_draw, spawn_draw = draw.random(3)
        map_name = _pick(maps, map_draw)
        episodes.append(
            EpisodeSpec(
                dialect=facts.dialect,
                index=index,
                map=map_name,
                map_layers=None if config.map.layers == "all" else config.map.layers,
                weather=_weather(config, weather_draw),
                steps=config.steps,
                fps=config.fps,
                save_every=config.save_every,
                warmup_ticks=config.timing.warmup_ticks,
                timing=TimingSpec(
                    mode=config.timing.mode,
                    sensor_sync=config.timing.sensor_sync,
                    max_substep_delta_time_s=substeps.max_substep_delta_time_s,
                    max_substeps=substeps.max_substeps,
                    on_incomplete=config.timing.on_incomplete,
                ),
                vehicles=VehiclesSpec(
                    **config.vehicles.model_dump(exclude={"groups"}),
                    groups=tuple(
                        GroupSpec(**group.model_dump()) for group in config.vehicles.groups
                    ),
                ),
                pedestrians=PedestriansSpec(**config.pedestrians.model_dump()),
                traffic=TrafficSpec(**config.traffic.model_dump()),
                ego=EgoSpec(
                    blueprint=config.ego.blueprint,
                    color=None if config.ego.color == "random" else config.ego.color,
                    **_start(config, facts, map_name, spawn_draw),
                ),
                scenario=plan_scenario(config, facts.count(map_name), recording),
                sensors=sensors,
                labels=LabelsSpec(
                    **config.labels.model_dump(
                        exclude={"cameras", "lidars", "boxes", "level_objects"}
                    ),
                    boxes=tuple(sorted(set(config.labels.boxes))),
                    level_objects=tuple(sorted(set(config.labels.level_objects))),
                ),
                ground_truth=GroundTruthSpec(**config.ground_truth.model_dump()),
                max_distance_m=config.max_distance_m,
                min_lidar_points=config.min_lidar_points,
                seeds=Seeds(
                    *(_seed(config.seed, index, position) for position in range(len(fields(Seeds))))
                ),
            )
        )
    return tuple(episodes)


def _weather(config: Config, draw: float) -> WeatherSpec:
    weather = config.weather
    return WeatherSpec(
        preset=_pick(weather.presets, draw) if weather.presets else None,
        parameters=weather.parameters.given(),
        lights=weather.lights,
        changes=tuple(
            WeatherChange(change.at_s, change.choice, change.parameters.given())
            for change in weather.changes
        ),
    )


def _sequence(seed: int, index: int, stream: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed, spawn_key=(index, stream))


def _seed(seed: int, index: int, stream: int) -> int:
    return int(_sequence(seed, index, stream).generate_state(1)[0]) & _LARGEST_SEED


def _pick(names: Iterable[str], draw: float) -> str:
    options = tuple(names)
    return options[int(draw * len(options))]


def _maps(config: Config, facts: ServerFacts, recording: Recording | None) -> tuple[str, ...]:
    """The maps that an episode may get.

    Raises:
        ConfigError: the server does not have one of them.
    """
    if recording is not None:
        wanted: tuple[tuple[str, str], ...] = (("scenario.episode", recording.map),)
    elif config.map.choice is not None:
        wanted = (("map.choice", config.map.choice),)
    elif "all" in (config.map.random_from or ()):
        return tuple(sorted(facts.maps))
    else:
        names = config.map.random_from or ()
        wanted = tuple((f"map.random_from[{i}]", name) for i, name in enumerate(names))
    found = []
    for path, name in wanted:
        short = name.rsplit("/", 1)[-1]
        if short not in facts.maps:
            message, hint = unknown("map", name, facts.maps)
            raise ConfigError(f"{path}: {message}", hint)
        found.append(short)
    return tuple(found)


def _start(config: Config, facts: ServerFacts, map_name: str, draw: float) -> dict[str, Any]:
    """Where the ego begins: a spawn point, or a place of its own."""
    count, spawn = facts.count(map_name), config.ego.spawn
    if isinstance(spawn, ConfiguredStand):
        place = Stand(x_m=spawn.x, y_m=spawn.y, z_m=spawn.z, yaw_deg=spawn.yaw_deg)
        return {"spawn_index": None, "spawn_place": place}
    if spawn == "random":
        return {"spawn_index": int(draw * facts.maps[map_name]), "spawn_place": None}
    if count is not None and spawn >= count:
        raise ConfigError(
            f"ego.spawn: {map_name} has no spawn point {spawn}.",
            f"It has {count}, counted from 0; or use `random`.",
        )
    return {"spawn_index": spawn, "spawn_place": None}
