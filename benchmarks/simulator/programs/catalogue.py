"""Which of CARLA's programs are run, with which arguments, and what others lack here.

Paths are those of ``PythonAPI`` in CARLA's sources and releases. Programs that draw into a window
for as long as nobody closes it are interrupted after some seconds, as a user does with Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

MOST_SECONDS = 300.0
"""A program that runs to its end may take so long, unless its entry says otherwise."""


@dataclass(frozen=True, slots=True)
class Program:
    """How one program is run.

    Attributes:
        path: below the folder.
        arguments: what it is called with.
        interrupt: it goes on until it is interrupted, rather than to an end of its own.
        seconds: how long it may take to its end; None takes :data:`MOST_SECONDS`. Of one that is
            interrupted: how long it runs; None takes the runner's.
        lacks: why it is not run at all; empty where it is.
        with_server_of: path of a program whose server, and folder, it goes on with.
        towns: maps of CARLA's that it drives in.
        actors: patterns of actor types that the world holds when it is interrupted, with the least
            number of each.
        files: what it reads: names in its folder, with their text.
    """

    path: str
    arguments: tuple[str, ...] = ()
    interrupt: bool = False
    seconds: float | None = None
    lacks: str = ""
    with_server_of: str = ""
    towns: tuple[str, ...] = ()
    actors: tuple[tuple[str, int], ...] = ()
    files: tuple[tuple[str, str], ...] = field(default=(), repr=False)

    @property
    def name(self) -> str:
        """Path and arguments, as they are shown."""
        return " ".join((self.path, *self.arguments))


_SMALL = ("--res", "320x180")
_LOG = "programs.log"
_RECORDING = "examples/start_recording.py"
_OF_LOG = ("-f", _LOG)
_OSM = (
    '<osm version="0.6"><bounds minlat="48.99" minlon="8.99" maxlat="49.01" maxlon="9.01"/>'
    '<node id="1" lat="49.000" lon="9.000"/><node id="2" lat="49.001" lon="9.000"/>'
    '<node id="3" lat="49.002" lon="9.001"/>'
    '<way id="9"><nd ref="1"/><nd ref="2"/><nd ref="3"/>'
    '<tag k="highway" v="residential"/><tag k="lanes" v="2"/></way></osm>\n'
)
_EGO = (("vehicle.*", 1),)

EXAMPLES = (
    Program(
        "examples/automatic_control.py",
        ("--agent", "Behavior", *_SMALL),
        interrupt=True,
        actors=(*_EGO, ("sensor.*", 4)),
    ),
    Program(
        "examples/automatic_control.py",
        ("--agent", "Basic", "--loop", "--sync", *_SMALL),
        interrupt=True,
        actors=(*_EGO, ("sensor.*", 4)),
    ),
    Program(
        "examples/automatic_control.py",
        ("--agent", "Constant", *_SMALL),
        interrupt=True,
        actors=(*_EGO, ("sensor.*", 4)),
    ),
    Program("examples/bounding_boxes.py", _SMALL, interrupt=True, actors=(*_EGO, ("sensor.*", 2))),
    Program("examples/client_bounding_boxes.py", interrupt=True, actors=(*_EGO, ("sensor.*", 1))),
    Program("examples/draw_skeleton.py", _SMALL, interrupt=True, actors=(("walker.*", 1),)),
    Program("examples/dynamic_weather.py", interrupt=True),
    Program(
        "examples/generate_traffic.py",
        ("-n", "20", "-w", "10"),
        interrupt=True,
        actors=(("vehicle.*", 15), ("walker.*", 5)),
    ),
    Program(
        "examples/generate_traffic.py",
        ("-n", "15", "-w", "10", "--asynch"),
        interrupt=True,
        actors=(("vehicle.*", 10), ("walker.*", 5)),
    ),
    Program("examples/get_component_test.py"),
    Program("examples/invertedai_traffic.py", lacks="an online service of Inverted AI, and a key"),
    Program("examples/lidar_to_camera.py", ("--frames", "30", "--res", "340x210")),
    Program(
        "examples/manual_control.py",
        ("--autopilot", "--sync", *_SMALL),
        interrupt=True,
        actors=(*_EGO, ("sensor.*", 4)),
    ),
    Program("examples/manual_control_carsim.py", lacks="a server that was built with CarSim"),
    Program("examples/manual_control_chrono.py", lacks="a server that was built with Chrono"),
    Program(
        "examples/manual_control_fisheye.py",
        lacks="wide-angle cameras, which came after CARLA 0.9.16",
    ),
    Program("examples/manual_control_steeringwheel.py", lacks="a steering wheel"),
    Program("examples/no_rendering_mode.py", _SMALL, interrupt=True),
    Program("examples/open3d_lidar.py", lacks="a screen with OpenGL, for Open3D's window"),
    Program("examples/ros2/ros2_native.py", lacks="ROS 2, which the embedded simulator lacks"),
    Program("examples/rss/manual_control_rss.py", lacks="a client that was built with RSS"),
    Program("examples/rss/rss_sensor.py", lacks="a client that was built with RSS"),
    Program("examples/rss/rss_visualization.py", lacks="a client that was built with RSS"),
    Program("examples/sensor_synchronization.py", interrupt=True, actors=(("sensor.*", 3),)),
    Program(
        _RECORDING,
        ("-n", "10", "-d", "0.5", "-f", _LOG),
        interrupt=True,
        actors=(("vehicle.*", 10),),
    ),
    Program("examples/show_recorder_file_info.py", _OF_LOG, with_server_of=_RECORDING),
    Program("examples/show_recorder_collisions.py", _OF_LOG, with_server_of=_RECORDING),
    Program("examples/show_recorder_actors_blocked.py", _OF_LOG, with_server_of=_RECORDING),
    Program("examples/start_replaying.py", (*_OF_LOG, "-d", "5"), with_server_of=_RECORDING),
    Program("examples/synchronous_mode.py", interrupt=True, actors=(*_EGO, ("sensor.*", 2))),
    Program("examples/test_addsecondvx.py", interrupt=True, actors=(("sensor.*", 1),)),
    Program("examples/tutorial.py"),
    Program("examples/tutorial_gbuffer.py"),
    Program("examples/V2XDemo.py", _SMALL, interrupt=True, actors=(*_EGO, ("sensor.*", 4))),
    Program("examples/vehicle_gallery.py", interrupt=True, actors=_EGO),
    Program("examples/vehicle_physics.py"),
    Program(
        "examples/visualize_multiple_sensors.py",
        ("--sync", "--res", "640x360"),
        interrupt=True,
        actors=(*_EGO, ("sensor.*", 4)),
    ),
)

UTILITIES = (
    Program("util/apply_texture.py", ("--list",)),
    Program(
        "util/check_collisions_substepping.py", interrupt=True, seconds=60.0, towns=("Town03",)
    ),
    Program("util/check_lidar_bb.py", interrupt=True, seconds=60.0, towns=("Town03",)),
    Program("util/check_map.py"),
    Program(
        "util/check_raycast_sensors_determinism.py",
        interrupt=True,
        seconds=60.0,
        towns=("Town03",),
    ),
    Program("util/config.py", ("--list",)),
    Program("util/config.py", ("--inspect",)),
    Program("util/config.py", ("--map", "Stage02", "--weather", "ClearNoon", "--fps", "20")),
    Program("util/config.py", ("--list-blueprints", "vehicle.*")),
    Program("util/environment.py", ("--sun", "sunset", "--weather", "rain")),
    Program("util/extract_spawn_points.py", ("-o", ".")),
    Program("util/lane_explorer.py", interrupt=True),
    Program(
        "util/osm_to_xodr.py", ("-i", "town.osm", "-o", "town.xodr"), files=(("town.osm", _OSM),)
    ),
    Program("util/performance_benchmark.py", ("--show_scenarios",)),
    Program(
        "util/raycast_sensor_testing.py",
        ("--sync", "--res", "640x360", "-ln", "1", "-sln", "1", "-rn", "1"),
        interrupt=True,
        actors=(("sensor.*", 3),),
    ),
    Program("util/test_connection.py"),
    Program("util/tools/generate_video_from_frames.py", lacks="pictures of its user, and FFmpeg"),
    Program(
        "util/vehicle_physics_tester.py",
        ("--all",),
        interrupt=True,
        seconds=60.0,
        towns=("Town05",),
    ),
)

PROGRAMS = (*EXAMPLES, *UTILITIES)

SMOKE_FOLDER = "test/smoke"
_ALL_TOWNS = ("Town01", "Town02", "Town03", "Town04", "Town05", "Town10HD")


@dataclass(frozen=True, slots=True)
class SmokeModule:
    """One file of CARLA's smoke tests.

    Attributes:
        name: of the module below :data:`SMOKE_FOLDER`.
        towns: maps that its cases load, besides the one to which all return.
        seconds: how long its cases may take together.
        lacks: why it is not run at all; empty where it is.
    """

    name: str
    towns: tuple[str, ...] = ()
    seconds: float = 900.0
    lacks: str = ""


HOME_TOWN = "Town03"
"""The map that every case loads at its end."""

_UNUSUAL = {
    "test_collision_sensor": SmokeModule(
        "test_collision_sensor", lacks="a wall of CARLA's own Town03, which OpenDRIVE does not have"
    ),
    "test_map": SmokeModule("test_map", _ALL_TOWNS),
    "test_spawnpoints": SmokeModule("test_spawnpoints", _ALL_TOWNS, seconds=1800.0),
    "test_vehicle_physics": SmokeModule("test_vehicle_physics", ("Town05",), seconds=1800.0),
}


def smoke_module(name: str) -> SmokeModule:
    """What is known of a module of the smoke tests."""
    return _UNUSUAL.get(name, SmokeModule(name))


def towns_of(programs: Iterable[Program], modules: Iterable[SmokeModule]) -> tuple[str, ...]:
    """CARLA's towns that these need, each once, sorted."""
    of_programs = {town for program in programs for town in program.towns}
    run = [module for module in modules if not module.lacks]
    of_modules = {town for module in run for town in (HOME_TOWN, *module.towns)}
    return tuple(sorted(of_programs | of_modules))
