"""The specification of one episode: all that decides its raw truth and its labels.

Planner, collector, labels, conversion and reader share this one tree of frozen dataclasses. It is
standard library only and runs on Python 3.8, as the collector needs it there. Storyboards have
modules of their own, ``storyboard`` and ``story_parts``, which few episodes need; nor do many need
those of ``events``, whose names wait until they are asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from carstage.spec.agents import (
    AGENT_KINDS,
    CARRIER_BLUEPRINT,
    MOST_AGENTS,
    AgentSeeds,
    AgentSpec,
    JunctionSpec,
    agent_of,
    is_agent_name,
    stream_of,
)
from carstage.spec.comfort import ComfortSpec
from carstage.spec.drivers import (
    ClassDriverSpec,
    Command,
    DeviceDriverSpec,
    DriverSpec,
    ReplayDriverSpec,
    RouteDriverSpec,
)
from carstage.spec.drones import (
    DroneSpec,
    EgoPlace,
    FollowSpec,
    GimbalSpec,
    OrbitSpec,
    WaypointsSpec,
)
from carstage.spec.episode import SPEC_VERSION, EpisodeSpec, Seeds
from carstage.spec.fields import Fields, SpecError
from carstage.spec.flash import FlashSpec
from carstage.spec.labels import BirdsEyeSpec, GroundTruthSpec, LabelsSpec
from carstage.spec.lenses import LensSpec
from carstage.spec.occupancy import OccupancySpec
from carstage.spec.road_users import GroupSpec, PedestriansSpec, TrafficSpec, VehiclesSpec
from carstage.spec.scenario import (
    AutopilotSpec,
    Control,
    OpenScenarioSpec,
    RecordedSpec,
    ReplayedActor,
    ReplaySpec,
    RouteSpec,
    ScenarioSpec,
    ScenicSpec,
    StationarySpec,
    StoryboardSpec,
)
from carstage.spec.scene import EgoSpec, Place, Stand, WeatherChange, WeatherSpec
from carstage.spec.sensors import (
    ATTACHMENTS,
    EGO,
    FOLLOW,
    ON_MAP,
    RIGID,
    PoseSpec,
    SensorSpec,
)
from carstage.spec.timing import SavedSteps, TimingSpec
from carstage.spec.variants import VariantSpec, is_variant_name

if TYPE_CHECKING:
    from carstage.spec.events import EVENT_SPECS, EventSpec, event_plugins, known_events

__all__ = [
    "AGENT_KINDS",
    "ATTACHMENTS",
    "CARRIER_BLUEPRINT",
    "EGO",
    "EVENT_SPECS",
    "FOLLOW",
    "MOST_AGENTS",
    "ON_MAP",
    "RIGID",
    "SPEC_VERSION",
    "AgentSeeds",
    "AgentSpec",
    "AutopilotSpec",
    "BirdsEyeSpec",
    "ClassDriverSpec",
    "ComfortSpec",
    "Command",
    "Control",
    "DeviceDriverSpec",
    "DriverSpec",
    "DroneSpec",
    "EgoPlace",
    "EgoSpec",
    "EpisodeSpec",
    "EventSpec",
    "Fields",
    "FlashSpec",
    "FollowSpec",
    "GimbalSpec",
    "GroundTruthSpec",
    "GroupSpec",
    "JunctionSpec",
    "LabelsSpec",
    "LensSpec",
    "OccupancySpec",
    "OpenScenarioSpec",
    "OrbitSpec",
    "PedestriansSpec",
    "Place",
    "PoseSpec",
    "RecordedSpec",
    "ReplayDriverSpec",
    "ReplaySpec",
    "ReplayedActor",
    "RouteDriverSpec",
    "RouteSpec",
    "SavedSteps",
    "ScenarioSpec",
    "ScenicSpec",
    "Seeds",
    "SensorSpec",
    "SpecError",
    "Stand",
    "StationarySpec",
    "StoryboardSpec",
    "TimingSpec",
    "TrafficSpec",
    "VariantSpec",
    "VehiclesSpec",
    "WaypointsSpec",
    "WeatherChange",
    "WeatherSpec",
    "agent_of",
    "event_plugins",
    "is_agent_name",
    "is_variant_name",
    "known_events",
    "stream_of",
]

_OF_EVENTS = ("EVENT_SPECS", "EventSpec", "event_plugins", "known_events")


def __getattr__(name: str) -> Any:
    if name in _OF_EVENTS:
        return getattr(import_module("carstage.spec.events"), name)
    raise AttributeError("module %r has no attribute %r" % (__name__, name))
