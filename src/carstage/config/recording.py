"""How an episode is stepped, labelled, converted and kept, and on which server."""

from __future__ import annotations

from math import ceil
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Discriminator, Field, Strict

from carstage.config.fields import Names, Section, problem, setting
from carstage.config.supervision import restart_every as _restart_every

#: CARLA's bounds of physics sub-steps (documentation of the synchronous mode and the time step).
MAX_SUBSTEPS = 16
PREFERRED_SUBSTEP_S = 0.01
_SLACK_S = 1e-9


class Substepping(NamedTuple):
    """Physics sub-steps within one step of the world."""

    max_substep_delta_time_s: float
    max_substeps: int


class ExplicitSubstepping(Section):
    """A pair for `timing.substepping`; their product must reach the time step, 1 / fps."""

    max_substep_delta_time_s: float = setting(
        PREFERRED_SUBSTEP_S,
        title="Longest sub-step",
        description="Longest physics sub-step.",
        unit="s",
        group="timing",
        gt=0,
        le=1,
    )
    max_substeps: int = setting(
        10,
        title="Sub-steps",
        description="Most physics sub-steps of one step.",
        group="timing",
        ge=1,
        le=MAX_SUBSTEPS,
    )


class Timing(Section):
    """Synchronisation and physics time."""

    mode: Literal["sync", "async"] = setting(
        "sync",
        title="Mode",
        description="`sync`: the server steps when the recorder says so; `async`: it runs freely.",
        group="timing",
    )
    sensor_sync: bool = setting(
        True,
        title="Sensors in step",
        description="Every sensor measures every step, and a frame waits for all of them; the "
        "world steps on meanwhile, as far as output.raw_queue_mb lets it. `false`: sensors may "
        "have a rate_hz of their own.",
        group="timing",
    )
    substepping: Literal["auto"] | ExplicitSubstepping = setting(
        "auto",
        title="Sub-stepping",
        description="Physics sub-steps; `auto` chooses them so that they reach 1 / fps.",
        group="timing",
    )
    on_incomplete: Literal["wait", "skip"] = setting(
        "wait",
        title="Incomplete frames",
        description="`wait`: wait for late sensors, record why; `skip`: go on (the paper's way).",
        group="timing",
    )
    warmup_ticks: int = setting(
        20,
        title="Warm-up",
        description="Steps before the first that is recorded.",
        unit="steps",
        group="timing",
        ge=0,
        le=10_000,
    )

    def substeps(self, fps: float) -> Substepping:
        """The sub-steps at ``fps``: the explicit ones, or as many of 10 ms as a step needs."""
        if isinstance(self.substepping, ExplicitSubstepping):
            return Substepping(
                self.substepping.max_substep_delta_time_s, self.substepping.max_substeps
            )
        step_s = 1.0 / fps
        count = min(MAX_SUBSTEPS, max(10, ceil(step_s / PREFERRED_SUBSTEP_S - _SLACK_S)))
        return Substepping(max(PREFERRED_SUBSTEP_S, step_s / count), count)

    def reaches(self, fps: float) -> bool:
        """Whether the sub-steps can fill one step at ``fps``."""
        longest_s, count = self.substeps(fps)
        return 1.0 / fps <= longest_s * count + _SLACK_S


class GroundTruth(Section):
    """What the label tables hold."""

    vehicles: bool = setting(True, title="Vehicles", description="Label vehicles.", group="labels")
    pedestrians: bool = setting(
        True, title="Pedestrians", description="Label pedestrians.", group="labels"
    )
    ego_motion: bool = setting(
        True,
        title="Ego motion",
        description="Record pose, speed and controls of the ego.",
        group="labels",
    )


LevelObjectKind = Literal[
    "parked_vehicles", "traffic_lights", "traffic_signs", "bridges", "buildings", "dynamic",
    "fences", "guard_rails", "other", "poles", "rail_tracks", "static", "terrain", "trains",
    "vegetation", "walls", "water",
]  # fmt: skip
"""What may be labelled of a level: CARLA's city object labels, those of vehicles as one."""
DEFAULT_LEVEL_OBJECTS: tuple[LevelObjectKind, ...] = (
    "parked_vehicles",
    "traffic_lights",
    "traffic_signs",
)


class Labels(Section):
    """How visibility is decided and which boxes are written."""

    method: Literal["stage_vo", "pixels", "both"] = setting(
        "both",
        title="Visibility method",
        basic=True,
        description="`stage_vo`: the paper's eight corners against depth; `pixels`: instance "
        "pixels; `both`: both, side by side.",
        group="labels",
    )
    boxes: Annotated[tuple[Literal["2d", "3d"], ...], Strict(strict=False)] = setting(
        ("2d", "3d"), title="Boxes", basic=True, description="Kinds of boxes.", group="labels"
    )
    cameras: Literal["all"] | Names = setting(
        "all",
        title="Labelled cameras",
        description="`all`: every rgb camera; or a list of sensor ids; `[]` labels none.",
        group="labels",
    )
    level_objects: Annotated[tuple[LevelObjectKind, ...], Strict(strict=False)] = setting(
        DEFAULT_LEVEL_OBJECTS,
        title="Level objects",
        description="What else is labelled of the town, by its boxes in the level. Parked "
        "vehicles, lights and signs are what a detector meets in traffic; they cost no sensor and "
        "little time. The rest is there on request: a town has thousands. `[]` labels actors "
        "alone.",
        group="labels",
    )
    min_visible_px: int = setting(
        10,
        title="Minimum visible pixels",
        description="Pixels from which an object is visible to the pixel method.",
        unit="px",
        group="labels",
        ge=1,
        le=1_000_000,
    )
    distance_origin: Literal["sensor", "ego"] = setting(
        "sensor",
        title="Distance from",
        description="Where max_distance_m counts from: the `sensor` (the paper's text) or the "
        "`ego` (its user interface).",
        group="labels",
    )
    stage_vo_tolerance_m: float = setting(
        0.0,
        title="STAGE-VO tolerance",
        description="How much nearer than a corner the depth must be to occlude it; 0 is the "
        "paper.",
        unit="m",
        group="labels",
        ge=0,
        le=10,
    )
    stage_vo_strict: bool = setting(
        False,
        title="STAGE-VO strict",
        description="Level 2 (the paper) instead of 3, unknown, when no corner is in the image.",
        group="labels",
    )
    stage_vo_vote: bool = setting(
        False,
        title="STAGE-VO vote",
        description="Compare a corner with its four diagonal neighbour pixels instead of its own.",
        group="labels",
    )


Port = Literal["auto"] | Annotated[int, Field(ge=1024, le=65_000)]


def _port(title: str, sentence: str) -> Any:
    return setting("auto", title=title, description=sentence, group="server")


SelfTest = Literal["auto", "on", "off", "require"]


def _self_test() -> Any:
    return setting(
        "auto",
        title="Self-test",
        description="Check before the run that the server's pictures, poses, codes and tags are "
        "what the labels take them for: `on`, `off`, or `require`, which refuses a server that "
        "fails; `auto`: `off` for the embedded simulator, `on` for others.",
        group="server",
    )


def _client_python() -> Any:
    return setting(
        "auto",
        title="Client's Python",
        description="Interpreter with the carla wheel of the server's version; `auto` finds it on "
        "PATH, among pyenv's versions and uv's.",
        group="server",
        min_length=1,
    )


def _create_client_env() -> Any:
    return setting(
        False,
        title="Create the client's Python",
        description="Where `auto` finds none, let uv make an environment with that wheel in the "
        "cache folder.",
        group="server",
    )


class EmbeddedServerConfig(Section):
    """The simulator that ships with Car-STAGE."""

    kind: Literal["embedded"] = setting(
        "embedded",
        title="Server",
        basic=True,
        description="The embedded simulator.",
        group="server",
    )
    port: Port = _port("Port", "First of two ports; `auto` finds free ones.")
    threads: Literal["auto"] | Annotated[int, Field(ge=1, le=1024)] = setting(
        "auto",
        title="Threads",
        description="Threads that draw; `auto`: all cores.",
        group="server",
    )
    carla_version: Literal["0.9.13", "0.9.14", "0.9.15", "0.9.16"] = setting(
        "0.9.16",
        title="CARLA version",
        description="The version of CARLA that it speaks and numbers its tags like.",
        group="server",
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()
    restart_every: int = _restart_every()


class CarlaServerConfig(Section):
    """A CARLA release on this machine, started and stopped by the run."""

    kind: Literal["carla"] = setting(
        title="Server", basic=True, description="CARLA, started by the run.", group="server"
    )
    path: str = setting(
        title="Path",
        description="Folder of the CARLA release, the one with CarlaUE4.sh.",
        group="server",
        min_length=1,
    )
    port: Port = _port("Port", "First of three ports; `auto` finds free ones.")
    arguments: Names = setting(
        ("-RenderOffScreen",),
        title="Arguments",
        description="More arguments of the start script.",
        group="server",
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()
    restart_every: int = _restart_every()


class RemoteServerConfig(Section):
    """A CARLA server that already runs, here or elsewhere; the run does not stop it."""

    kind: Literal["remote"] = setting(
        title="Server", basic=True, description="CARLA that already runs.", group="server"
    )
    host: str = setting(
        "127.0.0.1", title="Host", description="Its address.", group="server", min_length=1
    )
    port: Annotated[int, Field(ge=1, le=65_533)] = setting(
        2000, title="Port", description="Its RPC port.", group="server"
    )
    client_python: str = _client_python()
    create_client_env: bool = _create_client_env()
    self_test: SelfTest = _self_test()


ServerConfig = Annotated[
    EmbeddedServerConfig | CarlaServerConfig | RemoteServerConfig, Discriminator("kind")
]


class Conversion(Section):
    """How raw recordings become files."""

    mode: Literal["streaming", "deferred"] = setting(
        "streaming",
        title="Mode",
        description="`streaming`: while recording; `deferred`: after all episodes (the paper).",
        group="conversion",
    )
    workers: Literal["auto"] | Annotated[int, Field(ge=1, le=256)] = setting(
        "auto",
        title="Workers",
        description="Processes that convert; `auto`: one for each core, at most 8; of low "
        "priority.",
        group="conversion",
    )
    codecs: dict[str, str] = setting(
        dict,
        title="Codecs",
        description="Codec by sensor id, where it is not the kind's own.",
        group="conversion",
    )


class Output(Section):
    """How raw recordings are written, and what stays on disk."""

    keep_raw: bool = setting(
        False,
        title="Keep raw recordings",
        description="Keep the raw logs after they have been converted and verified.",
        group="output",
    )
    raw_store: Literal["chunklog", "mmap"] = setting(
        "chunklog",
        title="Raw store",
        description="Raw pictures in the log's records, or in memory-mapped files, one per camera "
        "and second (`mmap`, the paper's).",
        group="output",
    )
    raw_queue_mb: int = setting(
        256,
        title="Raw queue",
        description="Sensor data in memory that may wait for the disk; when more would, the tick "
        "waits.",
        unit="MB",
        group="output",
        ge=1,
        le=1_000_000,
    )


def check_substepping(timing: Timing, fps: float) -> None:
    """Refuse explicit sub-steps that cannot fill a step.

    Source: CARLA's documentation: fixed_delta_seconds <= max_substep_delta_time * max_substeps.

    Raises:
        PydanticCustomError: they cannot.
    """
    if not timing.reaches(fps):
        longest_s, count = timing.substeps(fps)
        raise problem(
            f"{count} sub-steps of at most {longest_s:g} s do not fill a step of {1.0 / fps:g} s.",
            f"Use `auto`, or max_substeps of at least {ceil(1.0 / fps / longest_s - _SLACK_S)}.",
            "timing",
            "substepping",
        )
