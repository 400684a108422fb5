"""Who drives the ego: the Traffic Manager, our controller, a class, a person, or an old drive."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Discriminator, Strict, field_validator

from carstage.config.fields import Names, Section, problem, setting, shortened, unknown
from carstage.config.own_classes import Parameters, checked_class_name, parameters
from carstage.config.timing import Timing
from carstage.spec import ComfortSpec
from carstage.spec.comfort import COMFORT_RANGES
from carstage.spec.drivers import is_class_name

DRIVER_KINDS = ("autopilot", "route", "class", "keyboard", "gamepad", "wheel", "replay")
DRIVEN_SCENARIOS = ("autopilot", "route", "openscenario")
_PLACE = ("ego", "driver")


def _kind(description: str, default: Any = ...) -> Any:
    return setting(default, title="Driver", description=description, group="ego")


def _limit(name: str, title: str, description: str, unit: str) -> Any:
    least, most = COMFORT_RANGES[name]
    return setting(
        getattr(ComfortSpec, name), title=title, description=description, unit=unit, group="ego",
        ge=least, le=most,
    )  # fmt: skip


class AutopilotDriver(Section):
    """The Traffic Manager drives, as the scenario says."""

    kind: Literal["autopilot"] = _kind("The Traffic Manager drives.", "autopilot")
    comfort: bool = setting(
        False,
        title="Comfort",
        description="Whether it drives gently, within the limits below, unless surprised; needs "
        "`timing.mode: sync`. Off: as CARLA has it.",
        group="ego",
    )
    acceleration_m_s2: float = _limit(
        "acceleration_m_s2", "Acceleration",
        "Comfortable when getting faster, and slower for what is ahead.", "m/s²",
    )  # fmt: skip
    lateral_m_s2: float = _limit(
        "lateral_m_s2", "Acceleration across", "Comfortable in curves.", "m/s²"
    )
    jerk_m_s3: float = _limit(
        "jerk_m_s3", "Jerk", "How fast the wished acceleration changes.", "m/s³"
    )
    gap_s: float = _limit("gap_s", "Time gap", "To who drives ahead.", "s")


class RouteDriver(Section):
    """A small controller of Car-STAGE's own follows the scenario's route, or the road."""

    kind: Literal["route"] = _kind("A small controller follows the route.")
    speed_m_s: float | None = setting(
        None,
        title="Speed",
        description="At most so fast; left out: as fast as the speed limit allows.",
        unit="m/s",
        group="ego",
        gt=0,
        le=60,
    )
    turns: Annotated[tuple[Literal["left", "straight", "right"], ...], Strict(strict=False)] = (
        setting(
            (),
            title="Turns",
            description="Which way to take at the forks after the route, in this order; then "
            "straight on.",
            group="ego",
            max_length=1000,
        )
    )


class ClassDriver(Section):
    """A class of yours drives; see docs/how-to/drive-the-ego.md."""

    kind: Literal["class"] = _kind("A class of yours drives.")
    name: str = setting(
        title="Class",
        description="`module:Class`. `driver: module:Class` is short for this section.",
        group="ego",
        min_length=1,
    )
    folders: Names = setting(
        (".",),
        title="Folders",
        description="Where its module, and what that imports, is looked for after the installed "
        "packages; relative to the working directory.",
        group="ego",
    )
    parameters: Parameters = parameters("ego")

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        hint = "Write, for example, `my_driver:Slalom` for class Slalom of my_driver.py."
        return checked_class_name(name, hint)


class _Device(Section):
    """A person drives, in a window (extra `drive`) or in the page."""

    #: What an axis or a button of it does: names of keys.
    inputs: ClassVar[tuple[str, ...]] = ()

    camera: str | None = setting(
        None,
        title="Camera",
        description="Sensor whose pictures the window shows; left out: the first `rgb` camera.",
        group="ego",
        min_length=1,
    )
    where: Literal["window", "page"] = setting(
        "window",
        title="Where",
        description="Where you drive: in a window on the machine that records (extra `drive`), or "
        "in the page of the run.",
        group="ego",
    )
    take: int = setting(
        1,
        title="Take",
        description="Another number drives the same scene once more, as another episode.",
        group="ego",
        ge=1,
        le=1_000_000,
    )


class KeyboardDriver(_Device):
    """You drive by keyboard, with the keys of CARLA's manual_control.py."""

    kind: Literal["keyboard"] = _kind("You drive by keyboard.")


def _number_of(what: str, default: int, part: str) -> Any:
    return setting(
        default,
        title=f"{what} {part}",
        description=f"{what}: number of the {part}, from 0; devices differ.",
        group="ego",
        ge=0,
        le=63,
    )


class GamepadDriver(_Device):
    """You drive by gamepad: left stick and triggers."""

    inputs = ("steer_axis", "throttle_axis", "brake_axis", "reverse_button", "hand_brake_button")

    kind: Literal["gamepad"] = _kind("You drive by gamepad.")
    steer_axis: int = _number_of("Steering", 0, "axis")
    throttle_axis: int = _number_of("Throttle", 5, "axis")
    brake_axis: int = _number_of("Brake", 2, "axis")
    reverse_button: int = _number_of("Reverse", 1, "button")
    hand_brake_button: int = _number_of("Hand brake", 0, "button")


class WheelDriver(_Device):
    """You drive by steering wheel and pedals, as with CARLA's manual_control_steeringwheel.py."""

    inputs = GamepadDriver.inputs

    kind: Literal["wheel"] = _kind("You drive by steering wheel and pedals.")
    steer_axis: int = _number_of("Steering", 0, "axis")
    throttle_axis: int = _number_of("Throttle", 2, "axis")
    brake_axis: int = _number_of("Brake", 3, "axis")
    reverse_button: int = _number_of("Reverse", 5, "button")
    hand_brake_button: int = _number_of("Hand brake", 4, "button")


class ReplayDriver(Section):
    """The recorded commands of an episode drive once more.

    Map, traffic, scenario, timing and seeds are taken from there; sensors, weather, labels and
    conversion are this configuration's own.
    """

    kind: Literal["replay"] = _kind("The commands of a recorded episode drive.")
    episode: str = setting(
        title="Episode",
        description="Folder of an episode that a driver drove: "
        "`DATASET/episodes/<id>/<attempt>`, or `DATASET` if it has only one.",
        group="ego",
        min_length=1,
    )


def _long_form(data: Any) -> Any:
    """``driver: route`` and ``driver: module:Class`` are short for a section."""
    if not isinstance(data, str):
        return data
    if data in DRIVER_KINDS:
        return {"kind": data}
    if is_class_name(data):
        return {"kind": "class", "name": data}
    raise problem(
        f"{shortened(repr(data))} is neither a kind of driver nor a class of yours.",
        f"Known: {', '.join(DRIVER_KINDS)}; a class is module:Class, such as my_driver:Slalom.",
    )


DeviceDriver = KeyboardDriver | GamepadDriver | WheelDriver
Driver = Annotated[
    AutopilotDriver
    | RouteDriver
    | ClassDriver
    | KeyboardDriver
    | GamepadDriver
    | WheelDriver
    | ReplayDriver,
    Discriminator("kind"),
    BeforeValidator(_long_form),
]


def check_driver(driver: Section, scenario: Section, timing: Timing, cameras: list[str]) -> None:
    """Refuse a driver that does not go with the rest.

    Args:
        driver: the ego's.
        scenario: what the ego does.
        timing: how time runs.
        cameras: ids of the rig's ``rgb`` cameras.

    Raises:
        PydanticCustomError: the scenario moves the ego by itself, the world runs by the clock, or
            the rig has no camera to look through.
    """
    if isinstance(driver, AutopilotDriver):
        return
    kind = getattr(scenario, "kind", "")
    if kind not in DRIVEN_SCENARIOS:
        raise problem(
            f"in scenario {kind} nobody drives the ego.",
            f"Use scenario {' or '.join(DRIVEN_SCENARIOS[:2])}, or leave the driver out.",
            *_PLACE,
        )
    if timing.mode != "sync":
        raise problem(
            "a driver needs a world that waits for each step.",
            "Set timing.mode to sync, or leave the driver out.",
            *_PLACE,
        )
    if isinstance(driver, DeviceDriver):
        if not cameras:
            raise problem(
                "the window shows an rgb camera, and the rig has none.",
                "Add a sensor of kind rgb to the rig.",
                *_PLACE,
            )
        if driver.camera is not None and driver.camera not in cameras:
            raise problem(*unknown("rgb camera", driver.camera, cameras), *_PLACE, "camera")


def idle_comfort(driver: Section, scenario: Section, timing: Timing) -> list[str]:
    """What to say where ``comfort`` is asked for and nobody can drive so."""
    if not isinstance(driver, AutopilotDriver) or not driver.comfort:
        return []
    kind = getattr(scenario, "kind", "")
    if kind not in DRIVEN_SCENARIOS:
        return [f"ego.driver.comfort: in scenario {kind} nobody drives the ego; it does nothing."]
    if timing.mode != "sync":
        return ["ego.driver.comfort: only a world that waits for each step (timing.mode: sync) "
                "lets the ego be led; it does nothing."]  # fmt: skip
    return []
