"""``python -m carstage_sim``: starts the server and says on stdout when it is ready."""

from __future__ import annotations

import atexit
import gc
import json
import logging
import os
import resource
import signal
import sys
from collections.abc import Sequence
from contextlib import ExitStack

from carstage_sim.cache import prune
from carstage_sim.cli import Options, parse_bake, parse_options
from carstage_sim.compiling import COMPILING_LOG, PicturesCompiled
from carstage_sim.describe.map_lanes import map_lanes
from carstage_sim.describe.offers import describe
from carstage_sim.describe.vehicle_shape import UnknownVehicleError, vehicle_shape
from carstage_sim.kernels import do_without_scipy
from carstage_sim.maps import MapCatalogue, MapFileError, MapSamplingError, UnknownTownError
from carstage_sim.prebake import prebake
from carstage_sim.recording.folder import RecordingsFolder, default_recordings
from carstage_sim.render.gpu.device import NoGpuError
from carstage_sim.sensors.plugins import PluginError, import_plugins
from carstage_sim.server import Server
from carstage_sim.simulation import Simulation
from carstage_sim.wire.dialect import dialect
from carstage_sim.wire.errors import BadAddressError, PortInUseError
from carstage_sim.wire.socket_loop import bind

_BAD_INPUT = 2
_SWITCH_S = 0.001
"""Threads let each other go on after that: a call needs several turns, a picture some more."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the server until SIGTERM or SIGINT, or bake maps; the exit status of the process."""
    arguments = sys.argv[1:] if argv is None else argv
    if arguments[:1] == ["bake"]:
        return _bake(arguments[1:])
    options = parse_options(arguments)
    prune()
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger("carstage_sim").setLevel(options.log_level.upper())
    if options.log_level == "warning":
        # These take a while; whoever waits wants to know for what.
        for name in ("carstage_sim.maps.baking", COMPILING_LOG):
            logging.getLogger(name).setLevel(logging.INFO)
    try:
        import_plugins(options.plugins)
        maps = MapCatalogue(options.maps, options.aliases, bake_limits=options.bake_limits)
        if options.describe:
            print(json.dumps(describe(options.protocol, maps)), flush=True)
            return 0
        if options.lanes is not None:
            print(json.dumps(map_lanes(maps.load(options.lanes))), flush=True)
            return 0
        if options.vehicle is not None:
            print(json.dumps(vehicle_shape(options.vehicle)), flush=True)
            return 0
        _serve(options, maps)
    except (
        BadAddressError, PortInUseError, UnknownTownError, MapFileError, MapSamplingError,
        NoGpuError, PluginError, UnknownVehicleError,
    ) as error:  # fmt: skip
        print(f"carstage_sim: {error}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:  # before the server was ready
        return 0
    return 0


def _bake(arguments: Sequence[str]) -> int:
    task = parse_bake(arguments)
    logging.basicConfig(format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    try:
        maps = MapCatalogue(task.maps, task.aliases)
        with PicturesCompiled() as compiled:
            whole = prebake(
                maps,
                task.names,
                lambda line: print(line, flush=True),
                await_rays=compiled.wait,
            )
    except (MapFileError, UnknownTownError) as error:
        print(f"carstage_sim: {error}", file=sys.stderr)
        return _BAD_INPUT
    return 0 if whole else _BAD_INPUT


def _serve(options: Options, maps: MapCatalogue) -> None:
    parent_pid = (options.parent_pid or os.getppid()) if options.exit_with_parent else None
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    # What is there at the end ends with the process: Python need not look through it for garbage.
    atexit.register(gc.freeze)
    _, most_descriptors = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (most_descriptors, most_descriptors))
    sys.setswitchinterval(_SWITCH_S)
    with ExitStack() as resources:
        # Reserved at once, so that a taken port is refused before the work of warming up; clients
        # are accepted only when everything is warm.
        rpc_socket = resources.enter_context(bind(options.host, options.port))
        streaming_socket = resources.enter_context(bind(options.host, options.streaming_port))
        spoken = dialect(options.protocol)
        compiled = resources.enter_context(PicturesCompiled())
        do_without_scipy()
        simulation = resources.enter_context(
            Simulation(
                options.map_name,
                maps=maps,
                threads=options.threads,
                loop=options.loop,
                projection=spoken.projection,
                quality=options.quality,
                device=options.device,
                wet_grip=options.wet_grip,
                recordings=RecordingsFolder(
                    options.recordings or default_recordings(), options.absolute_paths
                ),
            )
        )
        simulation.warm_up(compiled.wait)
        server = resources.enter_context(
            Server(
                simulation,
                spoken,
                rpc_socket=rpc_socket,
                streaming_socket=streaming_socket,
                frames_per_s=options.frames_per_s,
                pace_hz=options.pace_hz,
                parent_pid=parent_pid,
            )
        )
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda _number, _frame: server.stop())
        print(
            f"carstage_sim ready rpc={options.host}:{server.rpc_port} "
            f"streaming={server.streaming_port} map={options.map_name} "
            f"protocol={options.protocol} pid={os.getpid()}",
            flush=True,
        )
        server.run()


if __name__ == "__main__":
    sys.exit(main())
