"""Command line of the checks."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from benchmarks.simulator.budget import add_budget, check_budget
from benchmarks.simulator.client_process import TrialError
from benchmarks.simulator.conformance import add_conformance
from benchmarks.simulator.determinism import check_determinism
from benchmarks.simulator.fuzz import add_fuzz
from benchmarks.simulator.gpu_speed import add_gpu
from benchmarks.simulator.memory import add_memory
from benchmarks.simulator.render import add_render
from benchmarks.simulator.server_process import ServerError
from benchmarks.simulator.streaming import add_streaming
from benchmarks.simulator.traffic import check_traffic, judge_saved
from benchmarks.simulator.traffic.towns import CARLA_TOWNS, STAGES, carla_maps
from benchmarks.simulator.verdict import Campaign, Verdict
from benchmarks.simulator.walkers import check_walkers


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.simulator",
        description="Checks a server with the real carla client.",
    )
    checks = parser.add_subparsers(dest="check", required=True)

    traffic = checks.add_parser("traffic", help="vehicles flow without a pile-up")
    traffic.add_argument(
        "--full",
        action="store_true",
        help="100 vehicles and 50 walkers for 600 s in each of the stages and of CARLA's towns",
    )
    traffic.add_argument("--vehicles", type=int, help="in each town (default 30)")
    traffic.add_argument("--walkers", type=int, help="in each town (default 0)")
    traffic.add_argument("--seconds", type=float, help="simulated, in each town (default 120)")
    traffic.add_argument("--save", type=Path, help="folder to keep recordings in")
    traffic.add_argument("--judge", type=Path, help="judge a folder's recordings, drive nowhere")
    traffic.add_argument(
        "--base-types",
        nargs="+",
        default=["car"],
        choices=["car", "van", "truck", "bus", "motorcycle", "bicycle"],
    )

    determinism = checks.add_parser("determinism", help="two tries give the same frames")
    determinism.add_argument("--ticks", type=int, default=500)
    determinism.add_argument("--vehicles", type=int, default=50)
    determinism.add_argument("--walkers", type=int, default=10)
    determinism.add_argument("--tries", type=int, default=2)

    walkers = checks.add_parser("walkers", help="pedestrians keep to where they may walk")
    walkers.add_argument(
        "--full", action="store_true", help="50 walkers in each of the stages and of CARLA's towns"
    )
    walkers.add_argument("--walkers", type=int, help="in each town (default 20)")
    walkers.add_argument("--seconds", type=float, default=60.0, help="simulated, in each town")

    api = checks.add_parser("api", help="every name of the client does what the table says")
    api.add_argument("--only", default="", metavar="PART", help="names that contain this")
    api.add_argument("--verbose", action="store_true", help="say which trial is on")
    api.add_argument("--write", type=Path, metavar="FILE", help="write the table as Markdown")
    api.add_argument("--json", action="store_true", help="last line is a JSON object")

    for check in (determinism, api):
        check.add_argument("--map", help="map that the server starts with")
    for check in (traffic, walkers):
        check.add_argument("--towns", nargs="+", metavar="TOWN", help="these and no others")
        check.add_argument("--maps", type=Path, help="folder with OpenDRIVE files of CARLA's towns")
    for add in (
        add_budget,
        add_fuzz,
        add_streaming,
        add_memory,
        add_render,
        add_conformance,
        add_gpu,
    ):
        add(checks)
    for check in (traffic, determinism, walkers):
        check.add_argument("--fps", type=int, default=20)
        check.add_argument("--seed", type=int, default=7)
        check.add_argument("--json", action="store_true", help="last line is a JSON object")
    return parser


def _towns(arguments: argparse.Namespace, maps: Path | None) -> Sequence[str]:
    if arguments.towns:
        towns: Sequence[str] = arguments.towns
        return towns
    if not arguments.full:
        return STAGES[:1]
    return (*STAGES, *(CARLA_TOWNS if maps is not None else ()))


def _traffic(arguments: argparse.Namespace) -> Campaign:
    if arguments.judge is not None:
        return judge_saved(arguments.judge)
    vehicles, walkers, seconds = (100, 50, 600.0) if arguments.full else (30, 0, 120.0)
    with carla_maps(arguments.maps) as maps:
        return check_traffic(
            _towns(arguments, maps),
            vehicles=vehicles if arguments.vehicles is None else arguments.vehicles,
            walkers=walkers if arguments.walkers is None else arguments.walkers,
            seconds=seconds if arguments.seconds is None else arguments.seconds,
            fps=arguments.fps,
            seed=arguments.seed,
            base_types=tuple(arguments.base_types),
            server_arguments=() if maps is None else ("--maps", str(maps)),
            save_in=arguments.save,
        )


def _walkers(arguments: argparse.Namespace) -> Campaign:
    walkers = 50 if arguments.full else 20
    with carla_maps(arguments.maps) as maps:
        return check_walkers(
            _towns(arguments, maps),
            walkers=walkers if arguments.walkers is None else arguments.walkers,
            seconds=arguments.seconds,
            fps=arguments.fps,
            seed=arguments.seed,
            server_arguments=() if maps is None else ("--maps", str(maps)),
        )


def _determinism(arguments: argparse.Namespace) -> Verdict:
    return check_determinism(
        ticks=arguments.ticks,
        vehicles=arguments.vehicles,
        walkers=arguments.walkers,
        tries=arguments.tries,
        fps=arguments.fps,
        seed=arguments.seed,
        server_arguments=("--map", arguments.map) if arguments.map else (),
    )


def _api(arguments: argparse.Namespace) -> Verdict:
    # Its trials are many modules: other checks need not wait for them.
    from client_api import api_page, check_api

    if arguments.write is not None:
        arguments.write.write_text(api_page())
    return check_api(
        server_arguments=("--map", arguments.map) if arguments.map else (),
        only=arguments.only,
        verbose=arguments.verbose,
    )


_CHECKS: dict[str, Callable[[argparse.Namespace], Verdict | Campaign]] = {
    "traffic": _traffic,
    "determinism": _determinism,
    "budget": lambda arguments: check_budget(
        ticks=arguments.ticks, seed=arguments.seed, town=arguments.map
    ),
    "api": _api,
    "walkers": _walkers,
    **dict.fromkeys(
        ("fuzz", "streaming", "memory", "render", "conformance", "gpu"),
        lambda arguments: arguments.run(arguments),
    ),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one check; 0 when all targets are met, else 1."""
    arguments = _parser().parse_args(argv)
    verdict: Verdict | Campaign
    try:
        verdict = _CHECKS[arguments.check](arguments)
    except (ServerError, TrialError) as error:
        print(error, file=sys.stderr)
        verdict = Verdict(arguments.check, (), (str(error),), completed=False)
    print(verdict.text(), file=sys.stderr)
    if arguments.json:
        print(verdict.json(), flush=True)
    return 0 if verdict.ok else 1


if __name__ == "__main__":
    sys.exit(main())
