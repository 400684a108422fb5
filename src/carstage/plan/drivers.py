"""Who drives the ego of an episode: as its specification says it, or an old drive once more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from carstage.config import Config
from carstage.config.drivers import (
    AutopilotDriver,
    ClassDriver,
    DeviceDriver,
    Driver,
    RouteDriver,
)
from carstage.config.fields import path_text
from carstage.config.scene import OpenScenarioScenario
from carstage.errors import ConfigError
from carstage.spec import (
    ClassDriverSpec,
    ComfortSpec,
    Command,
    DeviceDriverSpec,
    DriverSpec,
    EpisodeSpec,
    OpenScenarioSpec,
    ReplayDriverSpec,
    RouteDriverSpec,
    WeatherSpec,
)
from carstage.spec.comfort import COMFORT_RANGES

_OWN = (
    "dialect", "steps", "save_every", "sensors", "labels", "ground_truth", "max_distance_m",
    "min_lidar_points", "wet_grip",
)  # fmt: skip
"""What a replay takes from its own configuration, beside the weather."""


@dataclass(frozen=True, slots=True)
class Drive:
    """A recorded episode whose ego was driven, as far as it can be driven once more.

    Attributes:
        spec: the episode's.
        commands: of its first steps, one for each.
    """

    spec: EpisodeSpec
    commands: tuple[Command, ...]

    @property
    def map(self) -> str:
        """Its map, without folders."""
        return self.spec.map


def plan_driver(config: Config, driver: Driver) -> DriverSpec | None:
    """A driver in the specification, the ego's or an agent's; None: the Traffic Manager.

    A replay's comes with the rest of the drive, see :func:`driven_again`.
    """
    if isinstance(driver, AutopilotDriver):
        return None
    if isinstance(driver, RouteDriver):
        return RouteDriverSpec(speed_m_s=driver.speed_m_s, turns=driver.turns)
    if isinstance(driver, ClassDriver):
        return ClassDriverSpec(name=driver.name, parameters=dict(driver.parameters))
    if isinstance(driver, DeviceDriver):
        camera = driver.camera or config.colour_cameras[0]
        inputs = {name: getattr(driver, name) for name in driver.inputs}
        at_page = driver.where == "page"
        return DeviceDriverSpec(driver.kind, camera, driver.take, inputs, at_page)
    raise ConfigError(
        f"ego.driver.episode: {driver.episode} was not read.",
        "Give the folder of a recorded episode.",
    )


def plan_comfort(driver: Driver) -> ComfortSpec | None:
    """How gently the Traffic Manager drives the ego or an agent; None: as it does by itself."""
    if not isinstance(driver, AutopilotDriver) or not driver.comfort:
        return None
    return ComfortSpec(*(getattr(driver, name) for name in COMFORT_RANGES))


def check_drive(config: Config, drive: Drive) -> None:
    """Refuse a drive that does not fit the configuration's time or scenario, or was a fleet's.

    Raises:
        ConfigError: it has another frame rate, ends before the episode does, had agents, keeps
            all sensors in step, or a program played that the configuration does not name.
    """
    if drive.spec.agents:
        raise ConfigError(
            "ego.driver.episode: agents drove beside the ego, whose commands are not replayed.",
            "Give an episode without agents.",
        )
    if config.fps != drive.spec.fps:
        raise ConfigError(
            f"fps: the episode in ego.driver was driven at {drive.spec.fps:g} Hz, one command for "
            "each step.",
            f"Give {drive.spec.fps:g}.",
        )
    if config.steps > len(drive.commands):
        possible_s = len(drive.commands) / drive.spec.fps
        raise ConfigError(
            f"duration_s: the episode in ego.driver was driven for {possible_s:g} s.",
            f"Give at most {possible_s:g} s.",
        )
    for path, sensor in config.sensors_of_all_variants():
        if sensor.rate_hz is not None and drive.spec.timing.sensor_sync:
            raise ConfigError(
                f"{path_text((*path, 'rate_hz'))}: in the episode in ego.driver, which says how "
                "time runs, sensors measure in every step.",
                "Leave it out.",
            )
    if isinstance(drive.spec.scenario, OpenScenarioSpec):
        scenario = config.scenario
        if not isinstance(scenario, OpenScenarioScenario) or scenario.scenario_runner is None:
            raise ConfigError(
                "scenario: scenario_runner played a file in the episode in ego.driver.",
                "Give the same here, with kind openscenario, file and scenario_runner.",
            )


def driven_again(
    drive: Drive, index: int, settings: Mapping[str, Any], weather: WeatherSpec
) -> EpisodeSpec:
    """The specification of an episode in which the recorded commands drive.

    Args:
        drive: the recorded episode.
        index: of the new episode in its configuration.
        settings: keys of the specification that follow from the configuration.
        weather: the new episode's.
    """
    commands = drive.commands[: settings["steps"]]
    driver = ReplayDriverSpec(episode_id=drive.spec.episode_id, commands=commands)
    return replace(
        drive.spec,
        **{name: settings[name] for name in _OWN},
        index=index,
        weather=weather,
        variant=None,
        ego=replace(drive.spec.ego, driver=driver),
    )
