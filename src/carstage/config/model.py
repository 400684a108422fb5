"""The configuration as a whole: everything that a user can ask for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from pydantic import model_validator

from carstage.config.agents import Agents, AnyAgent, VehicleAgent, check_agents
from carstage.config.asked_events import check_events
from carstage.config.attributes import (
    ImageSize,
    SensorAttributes,
    SweepAttributes,
    check_server_has,
)
from carstage.config.campaign import Campaign, Condition
from carstage.config.conversion import Conversion
from carstage.config.drivers import Driver, check_driver, idle_comfort
from carstage.config.fields import Section, path_text, problem, setting, unknown
from carstage.config.labels import GroundTruth, Labels
from carstage.config.occupancy import Occupancy
from carstage.config.output import Output
from carstage.config.patches import Patches, with_pair
from carstage.config.rig import Rig, default_rig
from carstage.config.scene import (
    DEFAULT_MAP,
    MAP_SUFFIX,
    AutopilotScenario,
    Ego,
    MapConfig,
    Scenario,
    check_file,
)
from carstage.config.sensors import CameraSensor, Sensor
from carstage.config.servers import EmbeddedServerConfig, ServerConfig
from carstage.config.supervision import Supervision
from carstage.config.timing import Timing, check_substepping
from carstage.config.traffic import Pedestrians, Traffic, Vehicles
from carstage.config.variants import VariantsByName, check_variants, has_wet_grip
from carstage.config.weather import DEFAULT_PRESET, WeatherConfig
from carstage.errors import BadInputError
from carstage.releases import refusal
from carstage.sensor_kinds.model import COLOUR, MESSAGES, POINTS, TAGGED_POINTS
from carstage.spec import SavedSteps
from carstage.spec.defaults import MAX_DISTANCE_M, MIN_LIDAR_POINTS
from carstage.spec.sensors import EGO, SPRING_ARMS

_SLACK = 1e-9
_GEN_CAM_MIN_S, _GEN_CAM_MAX_S = 0.1, 1.0


class Config(Section):
    """A run: which episodes, with which sensors and labels, recorded on which server."""

    name: str = setting(
        "quickstart",
        title="Name",
        basic=True,
        description="Name of the dataset.",
        group="scene",
        min_length=1,
        max_length=100,
    )
    seed: int = setting(
        7,
        title="Seed",
        basic=True,
        description="All random choices follow from it.",
        group="scene",
        ge=0,
        le=2**63 - 1,
    )
    episodes: int = setting(
        1,
        title="Episodes",
        basic=True,
        description="Number of episodes.",
        group="scene",
        ge=1,
        le=100_000,
    )
    duration_s: float = setting(
        5.0,
        title="Duration",
        basic=True,
        description="Simulated time of an episode after warm-up.",
        unit="s",
        group="scene",
        gt=0,
        le=86_400,
    )
    fps: float = setting(
        10.0,
        title="Frame rate",
        basic=True,
        description="Steps of the world per simulated second.",
        unit="Hz",
        group="scene",
        ge=1,
        le=240,
    )
    save_every: int = setting(
        1,
        title="Save every",
        description="1 saves every step; n saves every n-th, physics runs on.",
        unit="steps",
        group="scene",
        ge=1,
        le=100_000,
    )
    map: MapConfig = setting(
        lambda: MapConfig(choice=DEFAULT_MAP),
        title="Map",
        basic=True,
        description="The town.",
        group="scene",
    )
    weather: WeatherConfig = setting(
        lambda: WeatherConfig(choice=DEFAULT_PRESET),
        title="Weather",
        basic=True,
        description="Sky, rain, fog and sun.",
        group="scene",
    )
    vehicles: Vehicles = setting(
        Vehicles, title="Vehicles", basic=True, description="Other vehicles.", group="traffic"
    )
    pedestrians: Pedestrians = setting(
        Pedestrians, title="Pedestrians", basic=True, description="Pedestrians.", group="traffic"
    )
    traffic: Traffic = setting(
        Traffic, title="Driving", description="How the other vehicles drive.", group="traffic"
    )
    ego: Ego = setting(
        Ego,
        title="Ego",
        basic=True,
        description="The vehicle that carries the sensors.",
        group="ego",
    )
    scenario: Scenario = setting(
        AutopilotScenario,
        title="Scenario",
        basic=True,
        description="What the ego does.",
        group="ego",
    )
    timing: Timing = setting(
        Timing, title="Timing", description="Synchronisation and physics time.", group="timing"
    )
    image_size: ImageSize = setting(
        (640, 360),
        title="Image size",
        basic=True,
        description="Width and height of cameras that do not say otherwise.",
        unit="px",
        group="rig",
    )
    max_distance_m: float = setting(
        MAX_DISTANCE_M,
        title="Maximum distance",
        basic=True,
        description="Objects farther away get no camera labels; see labels.distance_origin.",
        unit="m",
        group="labels",
        gt=0,
        le=10_000,
    )
    min_lidar_points: int = setting(
        MIN_LIDAR_POINTS,
        title="Minimum LiDAR points",
        description="Fewer points of the LiDARs beside a camera make an object not visible to it; "
        "0 switches the rule off.",
        group="labels",
        ge=0,
        le=1_000_000,
    )
    ground_truth: GroundTruth = setting(
        GroundTruth,
        title="Ground truth",
        description="What the label tables hold.",
        group="labels",
    )
    labels: Labels = setting(
        Labels,
        title="Labels",
        basic=True,
        description="Visibility method and boxes.",
        group="labels",
    )
    rig: Rig = setting(
        default_rig, title="Rig", basic=True, description="The sensors.", group="rig"
    )
    agents: Agents = setting(
        (),
        title="Agents",
        description="Cars, roadside units, cameras at junctions and drones beside the ego, each "
        "with sensors of its own; see docs/how-to/record-a-fleet.md.",
        group="rig",
    )
    variants: VariantsByName = setting(
        dict,
        title="Variants",
        description="Weathers and rigs by name, by each of which every episode is recorded, all "
        "else equal; see docs/how-to/record-variants.md.",
        group="rig",
    )
    patches: Patches = setting(
        (),
        title="Patches",
        description="Pictures on boards, vehicles and people; without `variants`, episodes are "
        "recorded with and without them. See docs/how-to/patches.md.",
        group="scene",
    )
    show_patches: bool = setting(
        True,
        title="Show patches",
        description="Whether the pictures are on their boards; else these are plain.",
        group="scene",
    )
    server: ServerConfig = setting(
        EmbeddedServerConfig,
        title="Server",
        basic=True,
        description="Where the world is simulated.",
        group="server",
    )
    supervision: Supervision = setting(
        Supervision,
        title="Supervision",
        description="When a server or collector counts as lost.",
        group="server",
    )
    conversion: Conversion = setting(
        Conversion, title="Conversion", description="From raw logs to files.", group="conversion"
    )
    output: Output = setting(
        Output,
        title="Output",
        description="How raw recordings are written, and what stays on disk.",
        group="output",
    )
    campaign: Campaign | None = setting(
        None,
        title="Campaign",
        description="How settings are sampled that are a range, a choice or a distribution, and "
        "quotas; see docs/how-to/campaigns.md.",
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in_default_kinds(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        filled = dict(data)
        for key, kind in (("server", "embedded"), ("scenario", "autopilot")):
            section = data.get(key)
            if isinstance(section, dict) and "kind" not in section:
                filled[key] = {"kind": kind, **section}
        return with_pair(filled)

    @model_validator(mode="after")
    def _check_together(self) -> Config:
        self.check_together()
        return self

    def check_together(self) -> None:
        """Refuse settings that do not go together, though each is right by itself.

        Raises:
            PydanticCustomError: with the path of one of them.
        """
        check_substepping(self.timing, self.fps)
        check_events(self.scenario, self.timing)
        check_file(self.scenario, self.timing)
        check_driver(self.ego.driver, self.scenario, self.timing, self.colour_cameras)
        check_agents(self)
        self._check_maps()
        self.check_steps()
        self.check_sensors()
        check_variants(self)
        everything = [sensor for _, sensor in self.sensors_of_all_variants()]
        ids = {sensor.id for sensor in everything}
        cameras = {sensor.id for sensor in everything if sensor.row.is_camera}
        _check_names("cameras", self.labels.cameras, cameras)
        self._check_lidars(everything)
        for name in self.conversion.codecs:
            if name not in ids:
                message, hint = unknown("sensor", name, ids)
                raise problem(message, hint, "conversion", "codecs", name)
        for position, quota in enumerate(() if self.campaign is None else self.campaign.quotas):
            self._check_condition(quota.where, "campaign", "quotas", position, "where")

    def _check_lidars(self, sensors: Sequence[Sensor]) -> None:
        """Points are labelled by a semantic LiDAR that scans alike."""
        lidars = {sensor.id for sensor in sensors if sensor.row.content == POINTS}
        _check_names("lidars", self.labels.lidars, lidars)
        unlike = {sensor.id: sensor.kind for sensor in sensors if sensor.row.recorded}
        named = () if self.labels.lidars == "all" else self.labels.lidars
        for position, name in enumerate(named):
            if name in unlike:
                raise problem(
                    f"no semantic LiDAR scans like a {unlike[name]}.",
                    "Leave it out, and put a semantic_lidar beside it.",
                    "labels",
                    "lidars",
                    position,
                )

    def check_sensors(self) -> None:
        """Refuse sensors of the ego and of agents that cannot be, or lack what labels need.

        Raises:
            PydanticCustomError: with the path of a setting.
        """
        for path, sensor in self.located_sensors():
            self._check_sensor(path, sensor)
        if self.labels.occupancy is not None:
            self._check_occupancy(self.labels.occupancy, "the ego")
            for agent in self.agents:  # each has voxels of its own
                self.seen_by(agent)._check_occupancy(
                    self.labels.occupancy, f"the agent {agent.name!r}"
                )

    def _check_occupancy(self, asked: Occupancy, who: str) -> None:
        """Voxels are where something is, and get their classes from sensors that tell them."""
        ids, frame = {sensor.id for sensor in self.sensors}, asked.frame
        if frame != EGO and frame not in ids:
            _, hint = unknown("sensor", frame, ids)
            message = f"{who} has no sensor {frame!r}."
            raise problem(message, f"{hint} Or use `ego`.", "labels", "occupancy", "frame")
        if asked.exact and self.server.kind == "carla":
            raise problem(
                "a CARLA server cannot say which voxels its surfaces pass through.",
                "Leave it out, or use `server: {kind: embedded}`.",
                "labels",
                "occupancy",
                "exact",
            )
        cameras = self.labels.method != "stage_vo" and any(
            self._is_labelled(sensor) and isinstance(sensor, CameraSensor) and sensor.is_pinhole
            for sensor in self.sensors
        )
        lidars = any(sensor.row.content == TAGGED_POINTS for sensor in self.sensors)
        if not (asked.exact or cameras or lidars or self.labelled_lidars):
            raise problem(
                f"no sensor of {who} tells the classes of surfaces.",
                "Label a camera without distortion with pixels in labels.method, or a LiDAR by "
                "labels.lidars.",
                "labels",
                "occupancy",
            )

    def _check_maps(self) -> None:
        """Only the embedded simulator makes a town of a file."""
        if isinstance(self.server, EmbeddedServerConfig):
            return
        for place, name in self.map.located_names():
            if name.endswith(MAP_SUFFIX):
                raise problem(
                    f"a {self.server.kind} server has maps of its own, it loads no file.",
                    "Give the name of one, or use `server: {kind: embedded}`.",
                    "map",
                    *place,
                )

    def check_steps(self) -> None:
        """Refuse an episode without a step.

        Raises:
            PydanticCustomError: it is too short.
        """
        if self.steps < 1:
            raise problem(
                f"{self.duration_s:g} s at {self.fps:g} Hz are no step.",
                f"Record at least {1.0 / self.fps:g} s.",
                "duration_s",
            )

    def _check_condition(self, where: Condition, *path: str | int) -> None:
        """What a quota asks of the label tables is written into them."""
        sun = (where.sun_altitude_above_deg, where.sun_altitude_below_deg)
        distance = (where.min_distance_m, where.max_distance_m)
        needs = (
            (sun, self.ground_truth.ego_motion, "ground_truth.ego_motion: true"),
            (distance, "3d" in self.labels.boxes, "`3d` in labels.boxes"),
            ((where.min_visibility,), self.labels.method != "stage_vo", "pixels in labels.method"),
        )
        for values, there, what in needs:
            if any(value is not None for value in values) and not there:
                raise problem(f"nothing tells without {what}.", "Add it.", *path)

    def _check_sensor(self, path: tuple[str | int, ...], sensor: Sensor) -> None:
        attributes = sensor.attributes
        check_server_has(self.server.kind, sensor.row.attributes.rows, attributes, *path)
        if isinstance(self.server, EmbeddedServerConfig):
            reason = refusal(self.server.carla_version, {sensor.kind: sensor.row.since})
            if reason:
                hint = "Leave the sensor out, or choose a later server.carla_version."
                raise problem(f"{reason}.", hint, *path, "kind")
        elif sensor.row.content == MESSAGES and sensor.attach_to != EGO:
            raise problem(
                "CARLA 0.9.16 ends where a V2X sensor rides on anything but a vehicle.",
                "Leave attach_to out, or use the embedded simulator.",
                *path,
                "attach_to",
            )
        if sensor.row.content == MESSAGES:
            _check_intervals(path, attributes)
        if isinstance(attributes, SweepAttributes):
            rate_hz = sensor.measures_hz(self.fps)
            turns = attributes.turns(rate_hz)
            if turns > 1.0 + _SLACK:
                raise problem(
                    f"{attributes.rotation_hz(rate_hz):g} Hz make {turns:g} turns in a sweep, "
                    "which would overwrite itself.",
                    f"Use `auto` or at most {rate_hz:g} Hz, at which it measures.",
                    *path,
                    "attributes",
                    "rotation_frequency_hz",
                )
        if isinstance(sensor, CameraSensor):
            try:
                sensor.source(self.image_size)
            except BadInputError as error:
                raise problem(error.message, error.hint, *path, "lens") from None
        if sensor.attachment in SPRING_ARMS and self._is_labelled(sensor):
            raise problem(
                "a spring arm swings, so labels would not fit the picture.",
                "Use `rigid` or `follow`, or leave the camera out of labels.cameras.",
                *path,
                "attachment",
            )
        if sensor.rate_hz is not None:
            if self.timing.sensor_sync:
                raise problem(
                    "sensors in step measure in every step.",
                    "Use save_every, or set timing.sensor_sync to false.",
                    *path,
                    "rate_hz",
                )
            if sensor.rate_hz > self.fps:
                raise problem(
                    f"{sensor.rate_hz:g} Hz are more than the frame rate.",
                    f"Give at most {self.fps:g}.",
                    *path,
                    "rate_hz",
                )

    def _is_labelled(self, sensor: Sensor) -> bool:
        if self.labels.cameras == "all":
            return sensor.row.content == COLOUR
        # Another vehicle's sensor, or another variant's, may have the id of a camera.
        return sensor.row.is_camera and sensor.id in self.labels.cameras

    def warnings(self) -> list[str]:
        """What may be meant and still surprises; each begins with the field's path."""
        found = idle_comfort(self.ego.driver, self.scenario, self.timing)
        for path, sensor in self.located_sensors():
            attributes = sensor.attributes
            if isinstance(attributes, SweepAttributes):
                rate_hz = sensor.measures_hz(self.fps)
                share = attributes.turns(rate_hz)
                if share < 1.0 - _SLACK:
                    field = path_text((*path, "attributes", "rotation_frequency_hz"))
                    found.append(
                        f"{field}: at {attributes.rotation_hz(rate_hz):g} Hz each file holds "
                        f"{share:.0%} of a turn; `auto` makes whole turns."
                    )
            if (
                self.save_every > 1
                and sensor.measures_hz(self.fps) < self.fps
                and not isinstance(self.server, EmbeddedServerConfig)
            ):
                why = "such a server may measure in steps that save_every leaves out"
                found.append(f"{path_text((*path, 'rate_hz'))}: {why}. Save every step.")
            if sensor.kind == "imu" and sensor.pose.is_turned:
                why = "CARLA turns the gyroscope of a turned IMU the wrong way round"
                found.append(f"{path_text((*path, 'pose'))}: {why}. Mount it unrotated.")
        return found

    @property
    def steps(self) -> int:
        """Steps of an episode after warm-up."""
        return round(self.duration_s * self.fps)

    @property
    def saved_frames(self) -> int:
        """Saved frames of an episode: steps 0, n, 2n, …."""
        return SavedSteps(self.save_every).count(self.steps)

    @property
    def sensors(self) -> tuple[Sensor, ...]:
        """All requested sensors of the ego."""
        return self.rig.all_sensors

    def seen_by(self, agent: AnyAgent) -> Config:
        """This configuration with an agent's rig in place of the ego's, and no agents."""
        return self.model_copy(update={"rig": agent.rig, "agents": ()})

    def without_variants(self) -> Config:
        """This configuration as it is without variants; what they have in common stays."""
        server = self.server
        if isinstance(server, EmbeddedServerConfig):
            server = server.model_copy(update={"wet_grip": "on" if self.wet_grip else "off"})
        return self.model_copy(update={"variants": {}, "server": server})

    def as_variant(self, name: str) -> Config:
        """This configuration with what one variant has in place of its own, and no variants.

        Raises:
            KeyError: there is none of that name.
        """
        variant = self.variants[name]
        own = {key: value for key, value in variant if value is not None}
        return self.without_variants().model_copy(update=own)

    @property
    def wet_grip(self) -> bool:
        """Whether water on the road takes grip of the tyres."""
        return has_wet_grip(self)

    @property
    def planned_episodes(self) -> int:
        """Number of episodes, each variant counted."""
        return self.episodes * max(1, len(self.variants))

    def number_of(self, index: int, variant: str | None) -> int:
        """Number of an episode among all that are planned, from 0, its variants in a row.

        Args:
            index: of the episode in the configuration.
            variant: name of its variant; None: it has none.

        Raises:
            ValueError: there is no such variant.
        """
        names = (*self.variants,) or (None,)
        return index * len(names) + names.index(variant)

    def sensors_of_all_variants(self) -> list[tuple[tuple[str | int, ...], Sensor]]:
        """As ``located_sensors``, then those of rigs that variants have of their own."""
        found = self.located_sensors()
        for name, variant in self.variants.items():
            if variant.rig is not None:
                varied = self.model_copy(update={"rig": variant.rig, "agents": ()})
                inside = varied.located_sensors()
                found += [(("variants", name, *path), sensor) for path, sensor in inside]
        return found

    def located_sensors(self) -> list[tuple[tuple[str | int, ...], Sensor]]:
        """The ego's sensors, then the agents', each with its place in the configuration."""
        rigs: list[tuple[tuple[str | int, ...], Rig]] = [(("rig",), self.rig)]
        rigs += [(("agents", i, "rig"), agent.rig) for i, agent in enumerate(self.agents)]
        found: list[tuple[tuple[str | int, ...], Sensor]] = []
        for path, rig in rigs:
            found += [((*path, "preset"), sensor) for sensor in rig.preset_sensors]
            found += [((*path, "sensors", i), sensor) for i, sensor in enumerate(rig.sensors)]
        return found

    def located_drivers(self) -> list[tuple[tuple[str | int, ...], Driver]]:
        """Who drives the ego and the agents' cars, each with its place in the configuration."""
        found: list[tuple[tuple[str | int, ...], Driver]] = [(("ego", "driver"), self.ego.driver)]
        for position, agent in enumerate(self.agents):
            if isinstance(agent, VehicleAgent):
                found.append((("agents", position, "driver"), agent.driver))
        return found

    @property
    def labelled_cameras(self) -> tuple[str, ...]:
        """Ids of the cameras that get labels, in the rig's order."""
        return tuple(sensor.id for sensor in self.sensors if self._is_labelled(sensor))

    @property
    def colour_cameras(self) -> list[str]:
        """Ids of the ``rgb`` cameras, in the rig's order."""
        return [sensor.id for sensor in self.sensors if sensor.kind == "rgb"]

    @property
    def labelled_lidars(self) -> tuple[str, ...]:
        """Ids of the LiDARs whose points can be labelled by a twin, in the rig's order."""
        chosen = self.labels.lidars
        return tuple(
            sensor.id
            for sensor in self.sensors
            if sensor.row.content == POINTS
            and not sensor.row.recorded
            and (chosen == "all" or sensor.id in chosen)
        )


def _check_names(field: str, names: Literal["all"] | tuple[str, ...], known: set[str]) -> None:
    """Sensors that ``labels`` names exist and can be labelled."""
    for position, name in enumerate(() if names == "all" else names):
        if name not in known:
            message, hint = unknown(field.removesuffix("s"), name, known)
            raise problem(message, hint, "labels", field, position)


def _check_intervals(path: tuple[str | int, ...], attributes: SensorAttributes) -> None:
    """The intervals at which a V2X sensor sends; what is left out is CARLA's default."""
    shortest_s = getattr(attributes, "gen_cam_min_s", None)
    longest_s = getattr(attributes, "gen_cam_max_s", None)
    shortest_s = _GEN_CAM_MIN_S if shortest_s is None else shortest_s
    longest_s = _GEN_CAM_MAX_S if longest_s is None else longest_s
    if shortest_s > longest_s:
        raise problem(
            f"{shortest_s:g} s is above the longest interval, {longest_s:g} s.",
            "Give a gen_cam_min_s up to gen_cam_max_s.",
            *path,
            "attributes",
            "gen_cam_min_s",
        )
