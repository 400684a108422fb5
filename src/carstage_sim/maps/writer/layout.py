"""From a plan to a road network: how far crossings reach, the roads between them, their paths."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field

from carstage_sim.maps.writer.alignment import Point
from carstage_sim.maps.writer.arms import Arm, setbacks
from carstage_sim.maps.writer.builder import NetworkBuilder
from carstage_sim.maps.writer.junctions import add_crossing
from carstage_sim.maps.writer.motorways import add_motorway, ramp_ends
from carstage_sim.maps.writer.network import Contact, RoadNetwork
from carstage_sim.maps.writer.plan import Crossing, Roundabout, TownPlan
from carstage_sim.maps.writer.ramps import RampEnd, Terminal
from carstage_sim.maps.writer.roundabouts import add_roundabout
from carstage_sim.maps.writer.streets import street_arm, street_road, stub


def build_network(plan: TownPlan) -> RoadNetwork:
    """The road network of a plan; deterministic, ids ascend in the plan's order.

    Raises:
        ValueError: if the plan cannot be built, with the place.
    """
    builder = NetworkBuilder()
    nodes = _nodes(plan)
    for node in nodes:
        _reserve(builder, plan, node)
    _add_streets(builder, plan, nodes)
    _add_motorways(builder, plan, nodes)
    for node in nodes:
        if node.circle:
            ids = [end.junction_id for end in node.streets]
            add_roundabout(builder, node.circle, ids, node.arms, node.height_m)
        else:
            junction_id, control = node.streets[0].junction_id, node.crossing.control
            add_crossing(
                builder,
                junction_id,
                node.center,
                node.arms,
                control,
                node.height_m,
                turn_limit_kmh=plan.turn_limit_kmh,
            )
    return builder.network(plan.name, plan.latitude_deg, plan.longitude_deg)


@dataclass(slots=True)
class _StreetEnd:
    """One end of a street of the plan, with what its crossing takes from it."""

    street: int
    contact: Contact
    setback_m: float = 0.0
    junction_id: int = -1


@dataclass(slots=True)
class _RampFoot:
    """One end of a ramp, with what its crossing takes from it."""

    end: RampEnd
    setback_m: float = 0.0


@dataclass(slots=True)
class _Node:
    """A point of the plan where streets end; it collects the arms of its junction."""

    center: Point
    crossing: Crossing
    circle: Roundabout | None
    height_m: float
    streets: list[_StreetEnd]
    ramps: list[_RampFoot]
    arms: list[Arm] = field(default_factory=list)


def _nodes(plan: TownPlan) -> list[_Node]:
    """All points where streets end, from south to north and west to east."""
    ends: dict[Point, list[_StreetEnd]] = defaultdict(list)
    for index, street in enumerate(plan.streets):
        ends[street.points[0]].append(_StreetEnd(index, "start"))
        ends[street.points[-1]].append(_StreetEnd(index, "end"))
    ramps: dict[Point, list[_RampFoot]] = defaultdict(list)
    for motorway in plan.motorways:
        for ramp in ramp_ends(motorway):
            ramps[ramp.center].append(_RampFoot(ramp))
    stray = set(ramps) - set(ends)
    if stray:
        raise ValueError(f"{plan.name}: no street ends at the ramps at {sorted(stray)}")
    crossings = {crossing.center: crossing for crossing in plan.crossings}
    circles = {circle.center: circle for circle in plan.roundabouts}
    nodes = []
    for center in sorted(ends, key=lambda p: (p[1], p[0])):
        crossing = crossings.get(center, Crossing(center))
        height_m = plan.ground_m(center) + crossing.height_m
        circle = circles.get(center)
        nodes.append(_Node(center, crossing, circle, height_m, ends[center], ramps.get(center, [])))
    return nodes


def _reserve(builder: NetworkBuilder, plan: TownPlan, node: _Node) -> None:
    """Decides how far a crossing reaches, and numbers its junctions."""
    if node.circle:
        for end in node.streets:
            end.setback_m, end.junction_id = node.circle.mouth_m, builder.next_junction_id()
        return
    stubs = [stub(plan.streets[end.street], end.contact) for end in node.streets]
    stubs += [ramp.end.stub for ramp in node.ramps]
    radius_m = node.crossing.kerb_radius_m or plan.kerb_radius_m
    junction_id = builder.next_junction_id()
    back_m = setbacks(stubs, radius_m)
    for end, setback_m in zip(node.streets, back_m, strict=False):
        end.setback_m, end.junction_id = setback_m, junction_id
    for ramp, setback_m in zip(node.ramps, back_m[len(node.streets) :], strict=True):
        ramp.setback_m = setback_m


def _add_streets(builder: NetworkBuilder, plan: TownPlan, nodes: list[_Node]) -> None:
    places = {(end.street, end.contact): (node, end) for node in nodes for end in node.streets}
    made: dict[tuple[int, Contact], Arm] = {}
    for index, street in enumerate(plan.streets):
        (first, begin), (last, end) = places[index, "start"], places[index, "end"]
        road = builder.add_road(
            street_road(
                plan,
                street,
                builder.next_road_id(),
                (begin.setback_m, end.setback_m),
                (begin.junction_id, end.junction_id),
                (first.height_m, last.height_m),
            )
        )
        made[index, "start"] = street_arm(road, street, "start")
        made[index, "end"] = street_arm(road, street, "end")
    for node in nodes:
        node.arms += [made[end.street, end.contact] for end in node.streets]


def _add_motorways(builder: NetworkBuilder, plan: TownPlan, nodes: list[_Node]) -> None:
    terminals = {
        ramp.end: Terminal(ramp.end, ramp.setback_m, node.streets[0].junction_id, node.height_m)
        for node in nodes
        for ramp in node.ramps
    }
    for motorway in plan.motorways:
        made = add_motorway(builder, motorway, terminals)
        for node in nodes:
            node.arms += [made[ramp.end] for ramp in node.ramps if ramp.end in made]
