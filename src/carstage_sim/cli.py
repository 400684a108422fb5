"""Options of the server, in our spelling and in that of CARLA's start script."""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from carstage_sim.maps import BakeLimits
from carstage_sim.render.gpu.device import Choice
from carstage_sim.render.quality import Quality
from carstage_sim.sensors.looping import Looping
from carstage_sim.wire.dialect import DIALECTS

_WITHOUT_EFFECT = (
    "-RenderOffScreen",
    "-nosound",
    "-carla-server",
    "-benchmark",
    "-windowed",
    "-opengl",
    "-vulkan",
    "-nullrhi",
    "-prefernvidia",
    "-unattended",
    "-log",
    "-stdout",
    "-FullStdOutLogOutput",
)
_WITHOUT_EFFECT_VALUED = ("-ResX", "-ResY", "-carla-secondary-port")
_FIRST_MAP = "Stage01"
_MOST_FRAMES_PER_S = 1000.0
_HIGHEST_PORT = 65535


@dataclass(frozen=True, slots=True)
class Options:
    """What the server is started with.

    Attributes:
        port: RPC port, 0 for a free one.
        streaming_port: 0 for a free one.
        maps: OpenDRIVE files, and folders of them, to offer.
        aliases: names that stand for maps.
        bake_limits: what the bake of a map for a client may take.
        plugins: modules to import, which register sensors.
        threads: threads of the numeric kernels, None for all cores.
        loop: how each sensor repeats its first frames, None for no repetition.
        recordings: folder of the recorder's logs, None for the one in the cache.
        absolute_paths: whether clients' absolute paths stand for places below it.
        pace_hz: most ticks per second in synchronous mode, None for as many as can be.
        quality: of colour pictures.
        device: what casts rays and makes pictures.
        wet_grip: whether water on the road takes grip of the tyres.
        frames_per_s: pace of the free run in asynchronous mode.
        exit_with_parent: end when the process that started this one is gone.
        parent_pid: id of that process; None: the parent that the server finds itself with.
        describe: print what there is, as JSON, and end.
        lanes: print the lanes of this map, as JSON, and end.
        vehicle: print the shape of the vehicle with this blueprint id, as JSON, and end.
    """

    host: str
    port: int
    streaming_port: int
    map_name: str
    maps: tuple[Path, ...]
    aliases: dict[str, str]
    bake_limits: BakeLimits
    plugins: tuple[str, ...]
    threads: int | None
    loop: Looping | None
    recordings: Path | None
    absolute_paths: bool
    pace_hz: float | None
    quality: Quality
    device: Choice
    wet_grip: bool
    protocol: str
    frames_per_s: float
    exit_with_parent: bool
    parent_pid: int | None
    describe: bool
    lanes: str | None
    vehicle: str | None
    log_level: str


class _Parser(argparse.ArgumentParser):
    """An argument parser that names the nearest option for one that it does not know."""

    def in_our_case(self, text: str) -> str:
        """An argument with the letters of the option that it means: CARLA looks at no case."""
        name, equals, value = text.partition("=")
        if not text.startswith("-") or text.startswith("--"):
            return text
        known = (option for action in self._actions for option in action.option_strings)
        meant = next((option for option in known if option.lower() == name.lower()), name)
        return f"{meant}{equals}{value}"

    def refuse_unknown(self, unknown: Sequence[str]) -> None:
        known = [option for action in self._actions for option in action.option_strings]
        text = f"unknown option {unknown[0]}"
        by_folded = {option.lower(): option for option in known}
        nearest = difflib.get_close_matches(unknown[0].split("=")[0].lower(), by_folded, 1, 0.0)
        self.error(f"{text}; did you mean {by_folded[nearest[0]]}?" if nearest else text)


def _parser() -> _Parser:
    parser = _Parser(
        prog="python -m carstage_sim",
        description="The embedded simulator: a headless server that the carla client drives.",
        epilog="Options of CARLA's start script are understood; those about windows and sound "
        "have no effect. `bake TOWN...` computes maps ahead: see `bake --help`.",
        allow_abbrev=False,
    )
    parser.add_argument("--host", default="127.0.0.1", help="address to listen on")
    parser.add_argument(
        "--port",
        "-carla-rpc-port",
        "-carla-port",
        "-carla-world-port",
        "-world-port",
        type=_port,
        default=2000,
        help="RPC port; 0 takes a free one (default: 2000)",
    )
    parser.add_argument(
        "--streaming-port",
        "-carla-streaming-port",
        type=_port,
        help="streaming port (default: the one above --port)",
    )
    parser.add_argument(
        "start_map",
        nargs="?",
        metavar="MAP",
        help="map to begin with, as for CARLA's start script; also with a folder before it",
    )
    parser.add_argument("--map", dest="map_name", help="map to begin with (default: Stage01)")
    _add_map_sources(parser)
    _add_bake_limits(parser)
    parser.add_argument(
        "--plugin",
        dest="plugins",
        action="append",
        default=[],
        metavar="MODULE",
        help="a Python module to import, which registers sensors of its own; may be repeated",
    )
    parser.add_argument(
        "--seed",
        type=int,
        default=0,
        help="accepted for scripts; nothing here is random but sensor noise, which every sensor "
        "seeds by its noise_seed attribute",
    )
    parser.add_argument(
        "--device",
        choices=("auto", "cpu", "gpu"),
        default="cpu",
        help="what casts rays and makes pictures; gpu needs the extra `gpu`, auto takes a card if "
        "there is one (default: cpu)",
    )
    parser.add_argument(
        "--recordings",
        type=Path,
        metavar="DIR",
        help="the folder of start_recorder and replay_file; nothing is written or read elsewhere "
        "(default: recordings, in the cache folder)",
    )
    parser.add_argument(
        "--absolute-paths",
        choices=("below", "refuse"),
        default="below",
        help="what becomes of clients' absolute paths of recordings: below that folder, or refused "
        "(default: below)",
    )
    parser.add_argument(
        "--threads",
        type=_count,
        help="threads that compute (default: all cores; of 8, all but one)",
    )
    parser.add_argument(
        "--loop",
        type=_count,
        metavar="N",
        help="each sensor renders N frames once and then sends them in turn, at any pace",
    )
    parser.add_argument(
        "--loop-noise",
        type=_deviation,
        default=0.0,
        metavar="SIGMA",
        help="with --loop: normal noise on colour pictures, as of a camera, in steps of 0 to 255 "
        "(default: 0)",
    )
    parser.add_argument(
        "--pace",
        type=_rate,
        metavar="HZ",
        help="in synchronous mode at most so many ticks per second, as from a server that draws",
    )
    parser.add_argument(
        "--quality",
        "-quality-level",
        "-quality_level",
        type=_quality,
        default=Quality.LOW,
        help="of colour pictures: low, or epic, which costs up to 2.5 times as much (default: low)",
    )
    parser.add_argument(
        "--wet-grip",
        choices=("on", "off"),
        default="on",
        help="whether water on the road takes grip of the tyres, which in CARLA it does not "
        "(default: on)",
    )
    parser.add_argument("--protocol", default="0.9.16", choices=tuple(DIALECTS))
    parser.add_argument(
        "--fps",
        "-fps",
        dest="frames_per_s",
        type=_rate,
        default=30.0,
        help="frames per second in asynchronous mode (default: 30)",
    )
    parser.add_argument(
        "--exit-with-parent",
        type=int,
        nargs="?",
        const=0,
        metavar="PID",
        help="end when the process that started the server is gone; with its id also when it "
        "goes before the server has looked who it is",
    )
    parser.add_argument(
        "--describe", action="store_true", help="print maps and blueprints as JSON and end"
    )
    parser.add_argument(
        "--lanes", metavar="MAP", help="print the lanes of this map as JSON and end"
    )
    parser.add_argument(
        "--vehicle", metavar="ID", help="print the shape of this vehicle as JSON and end"
    )
    parser.add_argument(
        "--log-level", default="warning", choices=("debug", "info", "warning", "error")
    )
    for option in _WITHOUT_EFFECT:
        parser.add_argument(
            option, dest="_", action="store_true", default=False, help=argparse.SUPPRESS
        )
    for option in _WITHOUT_EFFECT_VALUED:
        parser.add_argument(option, dest="_", default=None, help=argparse.SUPPRESS)
    return parser


def _add_map_sources(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--maps",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="an OpenDRIVE file (NAME.xodr), or a folder of them, to offer; may be repeated",
    )
    parser.add_argument(
        "--alias",
        dest="aliases",
        type=_alias,
        action="append",
        default=[],
        metavar="NAME=MAP",
        help="let programs that ask for NAME get MAP; may be repeated",
    )


def _add_bake_limits(parser: argparse.ArgumentParser) -> None:
    usual = BakeLimits()
    parser.add_argument(
        "--bake-seconds",
        type=_count,
        default=int(usual.seconds),
        metavar="S",
        help="how long a map that a client asks for may bake (default: %(default)s)",
    )
    parser.add_argument(
        "--bake-memory",
        type=_count,
        default=usual.memory_mb,
        metavar="MB",
        help="how much memory such a bake may take (default: %(default)s)",
    )


@dataclass(frozen=True, slots=True)
class BakeTask:
    """What ``bake`` is to do.

    Attributes:
        names: maps to bake; none means all that are offered.
        maps, aliases: as in :class:`Options`.
    """

    names: tuple[str, ...]
    maps: tuple[Path, ...]
    aliases: dict[str, str]


def parse_bake(argv: Sequence[str]) -> BakeTask:
    """What follows ``bake`` on a command line.

    Raises:
        SystemExit: with status 2 and a sentence on stderr when something is wrong.
    """
    parser = _Parser(
        prog="python -m carstage_sim bake",
        description="Compute ahead what a server computes when it first loads a map: the town, its "
        "acceleration structure, machine code, and the shapes of vehicles and walkers.",
        allow_abbrev=False,
    )
    parser.add_argument(
        "names", nargs="*", metavar="TOWN", help="maps to bake (default: all that are offered)"
    )
    _add_map_sources(parser)
    namespace, unknown = parser.parse_known_args(argv)
    if unknown:
        parser.refuse_unknown(unknown)
    names = tuple(name.rsplit("/", 1)[-1] for name in namespace.names)
    return BakeTask(names, tuple(namespace.maps), dict(namespace.aliases))


def parse_options(argv: Sequence[str] | None) -> Options:
    """Options of a command line; None takes the process's own.

    Raises:
        SystemExit: with status 2 and a sentence on stderr when something is wrong.
    """
    parser = _parser()
    given = sys.argv[1:] if argv is None else argv
    namespace, unknown = parser.parse_known_args(
        [parser.in_our_case(text) for text in _joined(given)]
    )
    if unknown:
        parser.refuse_unknown(unknown)
    map_name = namespace.map_name or namespace.start_map or _FIRST_MAP
    streaming_port = namespace.streaming_port
    if streaming_port is None:
        streaming_port = namespace.port + 1 if namespace.port else 0
    if streaming_port > _HIGHEST_PORT:
        parser.error(f"no port above {namespace.port}: choose a lower --port or a --streaming-port")
    return Options(
        host=namespace.host,
        port=namespace.port,
        streaming_port=streaming_port,
        map_name=map_name.rsplit("/", 1)[-1],
        maps=tuple(namespace.maps),
        aliases=dict(namespace.aliases),
        bake_limits=BakeLimits(float(namespace.bake_seconds), namespace.bake_memory),
        plugins=tuple(namespace.plugins),
        threads=namespace.threads,
        loop=Looping(namespace.loop, namespace.loop_noise) if namespace.loop else None,
        recordings=namespace.recordings,
        absolute_paths=namespace.absolute_paths == "below",
        pace_hz=namespace.pace,
        quality=namespace.quality,
        device=namespace.device,
        wet_grip=namespace.wet_grip == "on",
        protocol=namespace.protocol,
        frames_per_s=namespace.frames_per_s,
        exit_with_parent=namespace.exit_with_parent is not None,
        parent_pid=namespace.exit_with_parent or None,
        describe=namespace.describe,
        lanes=namespace.lanes,
        vehicle=namespace.vehicle,
        log_level=namespace.log_level,
    )


def _joined(given: Sequence[str]) -> list[str]:
    """A command line in which ``-ResX= 800``, as some programs write it, is one word."""
    words: list[str] = []
    for word in given:
        if words and words[-1].startswith("-") and words[-1].endswith("=") and word[:1] != "-":
            words[-1] += word
        else:
            words.append(word)
    return words


def _port(text: str) -> int:
    value = int(text)
    if not 0 <= value <= _HIGHEST_PORT:
        raise argparse.ArgumentTypeError(f"{value} is no port: 0 to {_HIGHEST_PORT}")
    return value


def _alias(text: str) -> tuple[str, str]:
    name, separator, target = text.partition("=")
    if not (separator and name and target):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=MAP")
    return name, target


def _quality(text: str) -> Quality:
    try:
        return Quality(text.lower())
    except ValueError:
        names = " or ".join(quality.value for quality in Quality)
        raise argparse.ArgumentTypeError(f"{text!r} is not {names}") from None


def _count(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is too few: at least 1")
    return value


def _deviation(text: str) -> float:
    value = float(text)
    if not 0.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{value:g} is no deviation from 0 to 100")
    return value


def _rate(text: str) -> float:
    value = float(text)
    if not 0.0 < value <= _MOST_FRAMES_PER_S:
        raise argparse.ArgumentTypeError(f"{text} is no rate: above 0, at most 1000")
    return value
