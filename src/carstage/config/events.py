"""Events that happen to the ego on its way, placed ahead of it while the episode is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Literal

from pydantic import create_model, model_validator

from carstage.config.asked_events import Event
from carstage.config.fields import problem, setting
from carstage.spec import EVENT_SPECS, EventSpec, known_events

SLOWEST_PASSED_M_S = 1.0
"""A car that an oncoming one passes drives at least that fast."""


def _number(kind: str, name: str, title: str, description: str, unit: str | None) -> Any:
    """A number of an event; default and limits are the specification's."""
    field = next(each for each in fields(EVENT_SPECS[kind]) if each.name == name)
    return setting(
        field.default,
        title=title,
        description=description,
        unit=unit,
        group="ego",
        ge=field.metadata["low"],
        le=field.metadata["high"],
    )


def _at_s(kind: str) -> Any:
    return _number(kind, "at_s", "From", "Simulated time from which on a place is looked for.", "s")


def _kind(title: str, sentence: str) -> Any:
    return setting(title=title, description=sentence, group="ego")


class PedestrianCrosses(Event):
    """A pedestrian waits at the kerb ahead and crosses before the ego."""

    kind: Literal["pedestrian_crosses"] = _kind("Event", "A pedestrian crosses before the ego.")
    at_s: float = _at_s("pedestrian_crosses")
    distance_m: float = _number(
        "pedestrian_crosses", "distance_m", "Distance", "From the ego to where it crosses.", "m"
    )
    trigger_m: float = _number(
        "pedestrian_crosses", "trigger_m", "Trigger", "It steps out when the ego is this near.", "m"
    )
    speed_m_s: float = _number(
        "pedestrian_crosses", "speed_m_s", "Speed", "How fast it walks.", "m/s"
    )
    side: Literal["right", "left"] = setting(
        "right",
        title="Side",
        description="Side of the road, seen by the ego, from which it comes.",
        group="ego",
    )
    parked_car: bool = setting(
        False,
        title="Parked car",
        description="It steps out from behind a car at the kerb.",
        group="ego",
    )

    @model_validator(mode="after")
    def _check_trigger(self) -> PedestrianCrosses:
        _check_trigger(self.trigger_m, self.distance_m)
        return self


class HardBrakingLeader(Event):
    """A car drives ahead of the ego and brakes to a stop."""

    kind: Literal["hard_braking_leader"] = _kind("Event", "A car ahead of the ego brakes hard.")
    at_s: float = _at_s("hard_braking_leader")
    gap_m: float = _number(
        "hard_braking_leader", "gap_m", "Gap", "From the ego's front to its rear.", "m"
    )
    lead_s: float = _number(
        "hard_braking_leader", "lead_s", "Leads for", "How long it leads before it brakes.", "s"
    )
    deceleration_m_s2: float = _number(
        "hard_braking_leader", "deceleration_m_s2", "Deceleration", "How hard it brakes.", "m/s²"
    )
    stand_s: float = _number(
        "hard_braking_leader", "stand_s", "Stands for", "Then it drives on.", "s"
    )


class CutIn(Event):
    """A car in the lane beside the ego's moves over, closely ahead, and drives slower."""

    kind: Literal["cut_in"] = _kind("Event", "A car moves into the ego's lane, closely ahead.")
    at_s: float = _at_s("cut_in")
    gap_m: float = _number(
        "cut_in", "gap_m", "Gap", "From the ego's front to its rear, as it begins.", "m"
    )
    change_s: float = _number(
        "cut_in", "change_s", "Change", "How long it takes to move over.", "s"
    )
    slower_m_s: float = _number(
        "cut_in", "slower_m_s", "Slower by", "Than the ego, once it has moved over.", "m/s"
    )


class StoppedVehicle(Event):
    """A car stands in the ego's lane with its hazard lights on, then drives on."""

    kind: Literal["stopped_vehicle"] = _kind("Event", "A car stands in the ego's lane.")
    at_s: float = _at_s("stopped_vehicle")
    distance_m: float = _number(
        "stopped_vehicle", "distance_m", "Distance", "From the ego to where it stands.", "m"
    )
    trigger_m: float = _number(
        "stopped_vehicle", "trigger_m", "Trigger", "The event begins at this distance.", "m"
    )
    stand_s: float = _number(
        "stopped_vehicle", "stand_s", "Stands for", "From then on; then it drives on.", "s"
    )

    @model_validator(mode="after")
    def _check_trigger(self) -> StoppedVehicle:
        _check_trigger(self.trigger_m, self.distance_m)
        return self


class OncomingOvertaker(Event):
    """A car that comes towards the ego passes another one in the ego's lane, and moves back."""

    kind: Literal["oncoming_overtaker"] = _kind("Event", "An oncoming car passes another one.")
    at_s: float = _at_s("oncoming_overtaker")
    distance_m: float = _number(
        "oncoming_overtaker", "distance_m", "Distance", "From the ego, as it swings out.", "m"
    )
    speed_m_s: float = _number(
        "oncoming_overtaker", "speed_m_s", "Speed", "How fast it passes.", "m/s"
    )
    slower_m_s: float = _number(
        "oncoming_overtaker",
        "slower_m_s",
        "Slower by",
        "How much slower the other car drives; at least 1 m/s remain.",
        "m/s",
    )
    change_s: float = _number(
        "oncoming_overtaker", "change_s", "Change", "How long it moves over, and back.", "s"
    )

    @model_validator(mode="after")
    def _check_slower(self) -> OncomingOvertaker:
        most_m_s = self.speed_m_s - SLOWEST_PASSED_M_S
        if self.slower_m_s > most_m_s:
            raise problem(
                f"slower by {self.slower_m_s:g} m/s than {self.speed_m_s:g}, the other car stands.",
                f"Give at most {most_m_s:g}, or a larger speed_m_s.",
                "slower_m_s",
            )
        return self


class EmergencyVehicle(Event):
    """An emergency vehicle comes from behind, its lamps flashing, and passes or follows the ego."""

    kind: Literal["emergency_vehicle"] = _kind("Event", "An emergency vehicle comes from behind.")
    at_s: float = _at_s("emergency_vehicle")
    distance_m: float = _number(
        "emergency_vehicle", "distance_m", "Distance", "From the ego, as it appears.", "m"
    )
    faster_m_s: float = _number(
        "emergency_vehicle", "faster_m_s", "Faster by", "Than the ego, as it comes.", "m/s"
    )
    manner: Literal["pass", "follow"] = setting(
        "pass",
        title="Manner",
        description="What it does once it is near.",
        group="ego",
    )
    gap_m: float = _number(
        "emergency_vehicle", "gap_m", "Gap", "From it to the ego, as it follows.", "m"
    )
    follow_s: float = _number(
        "emergency_vehicle", "follow_s", "Follows for", "Once it is near.", "s"
    )

    @model_validator(mode="after")
    def _check_gap(self) -> EmergencyVehicle:
        if self.manner == "follow" and self.gap_m > self.distance_m:
            raise problem(
                f"{self.gap_m:g} m are more than distance_m, {self.distance_m:g} m.",
                f"Give at most {self.distance_m:g}, or a larger distance_m.",
                "gap_m",
            )
        return self


class WrongWayCyclist(Event):
    """A cyclist rides against the traffic, near the kerb of the ego's lane."""

    kind: Literal["wrong_way_cyclist"] = _kind("Event", "A cyclist comes in the ego's lane.")
    at_s: float = _at_s("wrong_way_cyclist")
    distance_m: float = _number(
        "wrong_way_cyclist", "distance_m", "Distance", "From the ego to where it is placed.", "m"
    )
    trigger_m: float = _number(
        "wrong_way_cyclist", "trigger_m", "Trigger", "The event begins at this distance.", "m"
    )
    speed_m_s: float = _number(
        "wrong_way_cyclist", "speed_m_s", "Speed", "How fast it rides.", "m/s"
    )
    kerb_m: float = _number(
        "wrong_way_cyclist", "kerb_m", "Kerb", "From the lane's right edge to its middle.", "m"
    )

    @model_validator(mode="after")
    def _check_trigger(self) -> WrongWayCyclist:
        _check_trigger(self.trigger_m, self.distance_m)
        return self


class RedLightRunner(Event):
    """A car crosses the junction ahead against red, while the ego has green."""

    kind: Literal["red_light_runner"] = _kind("Event", "A car crosses against red.")
    at_s: float = _at_s("red_light_runner")
    trigger_m: float = _number(
        "red_light_runner", "trigger_m", "Trigger", "From the ego to the junction.", "m"
    )
    speed_m_s: float = _number(
        "red_light_runner", "speed_m_s", "Speed", "How fast the car drives.", "m/s"
    )
    before_s: float = _number(
        "red_light_runner",
        "before_s",
        "Before",
        "So much earlier than the ego it is where their ways cross; negative: later.",
        "s",
    )


class WorksZone(Event):
    """Cones, a barrier and a sign narrow or close the ego's lane ahead."""

    kind: Literal["works_zone"] = _kind("Event", "Works narrow or close the ego's lane.")
    at_s: float = _at_s("works_zone")
    distance_m: float = _number(
        "works_zone", "distance_m", "Distance", "From the ego to the first cone.", "m"
    )
    trigger_m: float = _number(
        "works_zone", "trigger_m", "Trigger", "The event begins this far from the barrier.", "m"
    )
    length_m: float = _number(
        "works_zone", "length_m", "Length", "Of the works behind the barrier.", "m"
    )
    extent: Literal["narrow", "close"] = setting(
        "narrow",
        title="Extent",
        description="They narrow the lane, or they close it.",
        group="ego",
    )
    width_m: float = _number(
        "works_zone", "width_m", "Width", "What they take of a lane that they narrow.", "m"
    )
    speed_m_s: float = _number(
        "works_zone", "speed_m_s", "Speed", "How fast the ego passes at most.", "m/s"
    )

    @model_validator(mode="after")
    def _check_trigger(self) -> WorksZone:
        _check_trigger(self.trigger_m, self.distance_m)
        return self


def _check_trigger(trigger_m: float, distance_m: float) -> None:
    if trigger_m > distance_m:
        raise problem(
            f"{trigger_m:g} m are more than distance_m, {distance_m:g} m.",
            f"Give at most {distance_m:g}, or a larger distance_m.",
            "trigger_m",
        )


def section_of(spec: type[EventSpec]) -> type[Event]:
    """The section of a kind of another package, from its specification."""
    kind = spec().kind
    summary = (spec.__doc__ or kind).strip().splitlines()[0]
    given: dict[str, Any] = {"kind": (Literal[kind], _kind("Event", summary))}
    for each in fields(spec):
        if not each.init:
            continue
        if each.name == "at_s":
            given[each.name] = (float, _at_s(kind))
            continue
        unit = each.metadata.get("unit")
        suffix = "_" + unit.replace("/", "_").replace("²", "2") if unit else ""
        title = each.name.removesuffix(suffix).replace("_", " ").capitalize()
        sentence = each.metadata["sentence"] or f"{title}."
        if "known" in each.metadata:
            words = setting(each.default, title=title, description=sentence, group="ego")
            given[each.name] = (Literal[each.metadata["known"]], words)
        elif isinstance(each.default, bool):
            flag = setting(each.default, title=title, description=sentence, group="ego")
            given[each.name] = (bool, flag)
        else:
            given[each.name] = (float, _number(kind, each.name, title, sentence, unit))
    return create_model(
        spec.__name__, __base__=Event, __doc__=summary, __module__=__name__, **given
    )


EVENT_KINDS: Mapping[str, type[Event]] = {
    "pedestrian_crosses": PedestrianCrosses,
    "hard_braking_leader": HardBrakingLeader,
    "cut_in": CutIn,
    "stopped_vehicle": StoppedVehicle,
    "oncoming_overtaker": OncomingOvertaker,
    "emergency_vehicle": EmergencyVehicle,
    "wrong_way_cyclist": WrongWayCyclist,
    "red_light_runner": RedLightRunner,
    "works_zone": WorksZone,
    **{kind: section_of(spec) for kind, spec in known_events().items() if spec.collector},
}
"""The models by kind: those of Car-STAGE, then those that other packages register."""
