"""What an OpenDRIVE file says about signals: where they stand, which lanes they govern, when.

Read from the JSON record that ``carstage_sim.maps.opendrive`` writes beside the lane samples.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

TRIGGER_LENGTH_M = 3.0
TRIGGER_GAP_M = 1.5
"""As in CARLA (``TrafficLightComponent.cpp``): a vehicle that reaches into the volume is at the
light, so it stops with its bumper between the volume's near end and the signal."""

LIGHT, STOP, YIELD, SPEED_LIMIT = "1000001", "206", "205", "274"
"""Signal types that are built (LibCarla ``road/SignalType.cpp``)."""

Vector3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class GovernedLane:
    """A driving lane at the place where a signal holds.

    Attributes:
        road_id, lane_id: OpenDRIVE's.
        junction_id: the junction that the lane lies in or leads to, -1 for none.
        width_m: of the lane.
        stop, yaw_deg: where the signal holds, with the direction of travel.
        line, line_yaw_deg: where a stop line ends, with the direction of travel: of a signal within
            a junction, where its lane enters the junction.
        before, before_yaw_deg: the middle of the trigger, on the lane outside the junction.
    """

    road_id: int
    lane_id: int
    junction_id: int
    width_m: float
    stop: Vector3
    yaw_deg: float
    before: Vector3
    before_yaw_deg: float
    line: Vector3
    line_yaw_deg: float


@dataclass(frozen=True, slots=True)
class Signal:
    """One signal.

    Attributes:
        signal_id: the OpenDRIVE id; clients match landmarks and actors by it.
        kind: OpenDRIVE type.
        value: what a sign says (km/h of a limit), -1 for nothing.
        location, yaw_deg: pose, in CARLA's frame.
        lanes: what it governs.
    """

    signal_id: str
    kind: str
    value: float
    location: Vector3
    yaw_deg: float
    lanes: tuple[GovernedLane, ...]


@dataclass(frozen=True, slots=True)
class Controller:
    """Signals of a junction that switch together; controllers of one junction take turns."""

    junction_id: int
    signals: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class PaintedArrow:
    """An arrow on the road.

    Attributes:
        ways: where it leads: ``left``, ``right``, ``straight``.
        location, yaw_deg: its middle, and where it points, in CARLA's frame.
        length_m, width_m: of the rectangle around it.
    """

    ways: frozenset[str]
    location: Vector3
    yaw_deg: float
    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True)
class SignalPlan:
    """All that a map says apart from its lanes.

    Attributes:
        geo_reference: latitude and longitude of the origin in degrees.
        signals: every signal, by id.
        controllers: in the order of their turns.
        turns: for lanes that end in a junction, by (road, lane): ``left``, ``right``, ``straight``.
        arrows: those that the file has as objects.
    """

    geo_reference: tuple[float, float]
    signals: tuple[Signal, ...]
    controllers: tuple[Controller, ...]
    turns: Mapping[tuple[int, int], frozenset[str]]
    arrows: tuple[PaintedArrow, ...] = ()

    def of_kind(self, kind: str) -> list[Signal]:
        """The signals of an OpenDRIVE type."""
        return [signal for signal in self.signals if signal.kind == kind]


def signal_plan(record: NDArray[np.generic]) -> SignalPlan:
    """The plan in a record of ``carstage_sim.maps.opendrive``."""
    content: dict[str, Any] = json.loads(record.tobytes())
    return SignalPlan(
        geo_reference=(content["geo_reference"][0], content["geo_reference"][1]),
        signals=tuple(_signal(entry) for entry in content["signals"]),
        controllers=tuple(
            Controller(entry["junction_id"], tuple(entry["signals"]))
            for entry in content["controllers"]
        ),
        turns={(road, lane): frozenset(turns) for road, lane, turns in content["turns"]},
        arrows=tuple(
            PaintedArrow(
                **{
                    **entry,
                    "ways": frozenset(entry["ways"]),
                    "location": tuple(entry["location"]),
                }
            )
            for entry in content["arrows"]
        ),
    )


def _signal(entry: dict[str, Any]) -> Signal:
    lanes = tuple(
        GovernedLane(**{**lane, **{name: tuple(lane[name]) for name in ("stop", "before", "line")}})
        for lane in entry["lanes"]
    )
    return Signal(**{**entry, "location": tuple(entry["location"]), "lanes": lanes})
