"""Agents beside the ego: cars, roadside units, cameras at junctions, drones; each has a rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Strict, field_validator, model_validator

from carstage.config.drivers import AutopilotDriver, ClassDriver, Driver, RouteDriver
from carstage.config.drones import DroneFlight
from carstage.config.fields import Section, problem, setting, shortened
from carstage.config.rig import Rig
from carstage.config.scene import FROM_FILES, Channel, Stand
from carstage.config.sensors import CUBE_SUFFIX, INSTANCE_SUFFIX, LONGEST_STREAM_NAME, Pose
from carstage.config.servers import EmbeddedServerConfig
from carstage.config.timing import Timing
from carstage.sensor_kinds.model import MESSAGES
from carstage.spec import MOST_AGENTS, is_agent_name
from carstage.spec.agents import AGENT_KINDS, VEHICLE

if TYPE_CHECKING:
    from carstage.config.model import Config

LONGEST_AGENT_SENSOR_ID = LONGEST_STREAM_NAME - len(INSTANCE_SUFFIX) - len(f"@{MOST_AGENTS}")
"""The raw log's streams of an agent's sensors end with the agent's number."""


class _Agent(Section):
    """What all agents have."""

    name: str = setting(
        title="Name",
        description="Name of the agent, and of its folder in the episode; not `ego`.",
        group="rig",
    )
    rig: Rig = setting(title="Rig", description="The agent's sensors.", group="rig")

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        if not is_agent_name(name):
            raise problem(
                f"{shortened(repr(name))} cannot be an agent's name.",
                "Use up to 32 letters, digits, '_' and '-', beginning with a letter or digit; "
                "`ego` is the ego's.",
            )
        return name

    @model_validator(mode="after")
    def _check_lengths(self) -> _Agent:
        for position, sensor in enumerate(self.rig.sensors):
            longest = LONGEST_AGENT_SENSOR_ID - (len(CUBE_SUFFIX) if sensor.needs_cube else 0)
            if len(sensor.id) > longest:
                raise problem(
                    f"{sensor.id!r} has {len(sensor.id)} characters.",
                    f"Use at most {longest} for such a sensor of an agent.",
                    "rig", "sensors", position, "id",
                )  # fmt: skip
        return self


class VehicleAgent(_Agent):
    """A car with sensors of its own."""

    kind: Literal["vehicle"] = setting(
        "vehicle", title="Agent", description="A car with sensors.", group="rig"
    )
    blueprint: str = setting(
        "vehicle.tesla.model3",
        title="Vehicle",
        description="Blueprint of the vehicle.",
        group="rig",
        min_length=1,
    )
    spawn: Literal["near_ego", "random"] | Annotated[int, Field(ge=0)] | Stand = setting(
        "near_ego",
        title="Start",
        description="Index of a spawn point, a place `{x, y, z, yaw_deg}`, or `random`. "
        "`near_ego`: the free spawn point nearest to the ego's.",
        group="rig",
    )
    color: Literal["random"] | Annotated[tuple[Channel, Channel, Channel], Strict(strict=False)] = (
        setting(
            "random",
            title="Colour",
            description="`[red, green, blue]` from 0 to 255, or `random`: one that the blueprint "
            "recommends.",
            group="rig",
        )
    )
    driver: Driver = setting(
        AutopilotDriver,
        title="Driver",
        description="Who drives it: `autopilot`, `route` or a class; see "
        "docs/how-to/drive-the-ego.md.",
        group="rig",
    )


class RoadsideAgent(_Agent):
    """A roadside unit: sensors that stand still, such as on a mast."""

    kind: Literal["roadside"] = setting(
        title="Agent", description="Sensors that stand at a place.", group="rig"
    )
    pose: Pose = setting(
        title="Pose",
        description="Where the unit stands on the map, in CARLA's axes; poses of its sensors are "
        "relative to it.",
        group="rig",
    )


class JunctionAgent(_Agent):
    """Cameras on a mast at a junction of the map, turned to the junction's middle."""

    kind: Literal["junction"] = setting(
        title="Agent", description="Sensors on a mast at a junction.", group="rig"
    )
    junction: Literal["near_ego", "random"] | Annotated[int, Field(ge=0)] = setting(
        "near_ego",
        title="Junction",
        description="Id of a junction, as OpenDRIVE and the vector map have it; `random`; "
        "`near_ego`: the nearest to where the ego begins.",
        group="rig",
    )
    arm: int = setting(
        0,
        title="Road",
        description="By which of the roads that lead to it the mast stands, clockwise from +x.",
        group="rig",
        ge=0,
        le=20,
    )
    height_m: float = setting(
        7.0, title="Height", description="Of the mast above the road.", unit="m", group="rig",
        ge=1, le=100,
    )  # fmt: skip


class DroneAgent(_Agent, DroneFlight):
    """Sensors on the gimbal of a drone: nothing to see or hit, moved along a path."""

    kind: Literal["drone"] = setting(title="Agent", description="Sensors on a drone.", group="rig")


def _with_kind(data: Any) -> Any:
    """``kind: vehicle`` may be left out."""
    return {"kind": VEHICLE, **data} if isinstance(data, dict) and "kind" not in data else data


AnyAgent = VehicleAgent | RoadsideAgent | JunctionAgent | DroneAgent
Agent = Annotated[AnyAgent, Discriminator("kind"), BeforeValidator(_with_kind)]
Agents = Annotated[tuple[Agent, ...], Strict(strict=False)]
__all__ = [
    "AGENT_KINDS",
    "Agent",
    "Agents",
    "AnyAgent",
    "DroneAgent",
    "JunctionAgent",
    "RoadsideAgent",
    "VehicleAgent",
    "check_agents",
]


def check_agents(config: Config) -> None:
    """Refuse agents that do not go together, or with the rest.

    Raises:
        PydanticCustomError: with the path of one of them.
    """
    if not config.agents:
        return
    if isinstance(config.scenario, FROM_FILES) or config.ego.driver.kind == "replay":
        raise problem(
            "a file says what everybody does, which further agents would change.",
            "Leave the agents out, or let scenario and driver be none from a file.",
            "agents",
        )
    _check_agent_names([agent.name for agent in config.agents])
    spawns = {config.ego.spawn: "ego"} if isinstance(config.ego.spawn, int) else {}
    for position, agent in enumerate(config.agents):
        if isinstance(agent, VehicleAgent):
            if isinstance(agent.spawn, int) and agent.spawn in spawns:
                raise problem(
                    f"spawn point {agent.spawn} is that of {spawns[agent.spawn]!r}.",
                    "Give each vehicle its own, or use random.",
                    "agents", position, "spawn",
                )  # fmt: skip
            if isinstance(agent.spawn, int):
                spawns[agent.spawn] = agent.name
            _check_agent_driver(agent.driver, config.timing, position)
            continue
        if not isinstance(config.server, EmbeddedServerConfig):
            _check_radios(agent, position)
        if isinstance(agent, DroneAgent) and config.timing.mode != "sync":
            raise problem(
                "a drone needs a world that waits for each step.",
                "Set timing.mode to sync, or leave the drone out.",
                "agents", position, "kind",
            )  # fmt: skip


def _check_radios(agent: RoadsideAgent | JunctionAgent | DroneAgent, position: int) -> None:
    for number, sensor in enumerate(agent.rig.sensors):
        if sensor.row.content == MESSAGES:
            raise problem(
                "CARLA 0.9.16 ends where a V2X sensor rides on anything but a vehicle.",
                "Leave the sensor out, or use the embedded simulator.",
                "agents", position, "rig", "sensors", number, "kind",
            )  # fmt: skip


def _check_agent_names(names: Sequence[str]) -> None:
    if len(names) > MOST_AGENTS:
        message = f"{len(names)} are more than can be recorded."
        raise problem(message, f"Give at most {MOST_AGENTS}.", "agents")
    taken: set[str] = set()
    for position, name in enumerate(names):
        if name.lower() in taken:
            raise problem(
                f"{name!r} is the name of another agent.",
                "Give every agent its own (upper and lower case do not make a difference).",
                "agents", position, "name",
            )  # fmt: skip
        taken.add(name.lower())


def _check_agent_driver(driver: Section, timing: Timing, position: int) -> None:
    place = ("agents", position, "driver")
    if not isinstance(driver, AutopilotDriver | RouteDriver | ClassDriver):
        raise problem(
            "only the ego is driven by a person or by recorded commands.",
            "Use `autopilot`, `route` or a class of yours.",
            *place,
        )
    if timing.mode != "sync" and not isinstance(driver, AutopilotDriver):
        raise problem(
            "a driver needs a world that waits for each step.",
            "Set timing.mode to sync, or leave the driver out.",
            *place,
        )
