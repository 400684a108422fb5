"""Arms: the ends of roads at a junction, and how far from its middle they must end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from carstage_sim.maps.writer.alignment import Pose2, wrapped
from carstage_sim.maps.writer.network import Contact
from carstage_sim.maps.writer.plan import StreetProfile

_STRAIGHT_RAD = math.radians(40.0)
_FLAT_CORNER_RAD = math.radians(150.0)
"""Neighbouring arms that open wider than this have no corner between them."""
_SHARPEST_CORNER_RAD = math.radians(40.0)


@dataclass(frozen=True, slots=True)
class Side:
    """The lanes of an arm in one direction, from the reference line outwards.

    Attributes:
        lanes: driving lanes; 0 where nothing runs in this direction.
        lane_width_m: of each.
        gutter_m: width of the lane at the kerb.
        gutter_lane: number of the lane at the kerb, counted from the reference line; 0 without.
        sidewalk_m: width of the sidewalk, which is the next lane; 0 without.
        biking_m: width of the bicycle lane between driving lanes and gutter; 0 without.
    """

    lanes: int
    lane_width_m: float
    gutter_m: float
    gutter_lane: int = 0
    sidewalk_m: float = 0.0
    biking_m: float = 0.0

    @property
    def kerb_m(self) -> float:
        """Distance of the kerb from the reference line."""
        return self.lanes * self.lane_width_m + self.biking_m + self.gutter_m


def street_side(profile: StreetProfile) -> Side:
    """Either side of a street where it meets a junction: without parking bays."""
    between = 1 if profile.biking_width_m else 0
    return Side(
        profile.lanes,
        profile.lane_width_m,
        profile.gutter_width_m,
        profile.lanes + between + 1,
        profile.sidewalk_width_m,
        profile.biking_width_m,
    )


@dataclass(frozen=True, slots=True)
class Stub:
    """An arm before its length is known: a heading out of the junction and two sides."""

    heading_rad: float
    inbound: Side
    outbound: Side


@dataclass(frozen=True, slots=True)
class Arm:
    """Where a road meets a junction.

    Attributes:
        road_id, contact: the road and which of its ends is here.
        mouth: on the reference line where the junction begins, heading into the junction.
        inbound, outbound: cross-section, by direction.
        speed_limit_kmh: of the road.
        road_m: length of the road.
    """

    road_id: int
    contact: Contact
    mouth: Pose2
    inbound: Side
    outbound: Side
    speed_limit_kmh: int
    road_m: float

    def lane_id(self, index: int, *, inbound: bool) -> int:
        """OpenDRIVE id of the ``index``-th lane from the reference line, counted from 1."""
        return -index if inbound == (self.contact == "end") else index

    def driving_lanes(self, *, inbound: bool) -> tuple[int, int]:
        """Lowest and highest id of the driving lanes of one direction."""
        count = (self.inbound if inbound else self.outbound).lanes
        ids = sorted(self.lane_id(i, inbound=inbound) for i in (1, count))
        return ids[0], ids[-1]

    def station_m(self, before_mouth_m: float) -> float:
        """Station on the road of a place that far before the junction."""
        return self.road_m - before_mouth_m if self.contact == "end" else before_mouth_m

    @property
    def out(self) -> Pose2:
        """The mouth as traffic that leaves the junction sees it."""
        return self.mouth.turned(math.pi)

    def direction_to(self, target: Arm) -> str:
        """``left``, ``right`` or ``straight``: by the angle from heading in to heading out."""
        angle = wrapped(target.out.heading_rad - self.mouth.heading_rad)
        if abs(angle) < _STRAIGHT_RAD:
            return "straight"
        return "left" if angle > 0 else "right"


def setbacks(stubs: Sequence[Stub], kerb_radius_m: float) -> list[float]:
    """How far from the middle each arm ends: room for crossing kerbs and round corners.

    Raises:
        ValueError: if two arms meet at too sharp an angle.
    """
    order = sorted(range(len(stubs)), key=lambda i: wrapped(stubs[i].heading_rad))
    result = [0.0] * len(stubs)
    for index, following in zip(order, [*order[1:], order[0]], strict=True):
        one, two = stubs[index], stubs[following]
        opening = (two.heading_rad - one.heading_rad) % math.tau
        if one is two or opening > _FLAT_CORNER_RAD:
            continue
        if opening < _SHARPEST_CORNER_RAD:
            raise ValueError(f"arms at {math.degrees(opening):.0f} degrees meet too sharply")
        # Counter-clockwise of an arm's outward heading lies its inbound traffic.
        kerb_one, kerb_two = one.inbound.kerb_m, two.outbound.kerb_m
        rounding_m = kerb_radius_m / math.tan(opening / 2)
        sine, cosine = math.sin(opening), math.cos(opening)
        to_one = (kerb_two + kerb_one * cosine) / sine + rounding_m
        to_two = (kerb_one + kerb_two * cosine) / sine + rounding_m
        result[index] = max(result[index], to_one)
        result[following] = max(result[following], to_two)
    # Arms without a corner still need room for the paths between them.
    return [back_m or kerb_radius_m for back_m in result]
