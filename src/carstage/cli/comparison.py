"""``carstage bench frames|cameras|lidars|objects|totals|all|codecs``: next to other programs."""

from __future__ import annotations

import dataclasses
import shlex
import signal
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import timedelta
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer

from carstage.cli.bench import bench_app, report_verdict
from carstage.cli.output import Json, command, note
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from carstage.bench.comparison.presets import Experiment


class PresetName(str, Enum):
    """How much is measured."""

    QUICK = "quick"
    DOCS = "docs"
    PAPER = "paper"


PresetOption = Annotated[
    PresetName,
    typer.Option(
        "--preset",
        help="quick: minutes, shows that it runs; docs: up to 90 minutes, what the documentation "
        "publishes; paper: the paper's parameters, days.",
    ),
]
Server = Annotated[
    str | None,
    typer.Option(
        metavar="HOST:PORT",
        help="A CARLA server that runs already. Without it the embedded simulator is started with "
        "frames that repeat, so that the server is not what is measured.",
    ),
]
Repeat = Annotated[
    int | None, typer.Option(min=1, help="Runs of every program at every value, not the preset's.")
]
Out = Annotated[
    Path,
    typer.Option(
        help="Folder of the results; the same command again continues where it ended.",
    ),
]
Values = Annotated[
    list[int] | None,
    typer.Option("--value", min=0, help="Measure at this value only. Repeatable."),
]
Frames = Annotated[int | None, typer.Option(min=2, help="Of each run, not the preset's.")]
Programs = Annotated[
    list[str] | None,
    typer.Option("--program", help="Compare this program only. Repeatable."),
]
Minutes = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        help="Begin no further run after that time and report what there is; the same command "
        "again continues.",
    ),
]
Scratch = Annotated[
    Path | None,
    typer.Option(
        help="Existing folder for what programs write, on the disk to be measured; default: --out.",
        exists=True,
    ),
]
_OUT = Path("benchmark")
_FRAMES_OF: Final = {
    "cameras": "camera_frames",
    "lidars": "lidar_frames",
    "objects": "object_frames",
    "totals": "totals_frames",
}


_EXPERIMENTS: Final[dict[Experiment, str]] = {
    "frames": "Seconds per frame of the paper's rig, labelled, by the number of frames.",
    "cameras": "What each further camera adds, by every program.",
    "lidars": "What each further LiDAR of 100,000 points adds.",
    "objects": "What further vehicles and pedestrians add, labelled.",
    "totals": "The whole time against a client that ticks and drops everything: the limit.",
}


def _add_command(experiment: Experiment, text: str) -> None:
    """A command for one experiment."""

    @bench_app.command(experiment, help=text)
    @command
    def run(
        preset: PresetOption = PresetName.QUICK,
        server: Server = None,
        repeat: Repeat = None,
        out: Out = _OUT,
        value: Values = None,
        frames: Frames = None,
        program: Programs = None,
        minutes: Minutes = None,
        scratch: Scratch = None,
        json: Json = False,
    ) -> int:
        changes: dict[str, Any] = {} if repeat is None else {"repeats": repeat}
        if value:
            name = "totals_cameras" if experiment == "totals" else experiment
            changes[name] = tuple(sorted(value))
        if frames is not None:
            if experiment == "frames":
                raise BadInputError("--frames: here it is what varies.", "Use --value.")
            changes[_FRAMES_OF[experiment]] = frames
        again = _command_line(
            experiment, preset, server=server, repeat=repeat, value=value, frames=frames,
            program=program,
        )  # fmt: skip
        place = Place(out, server, scratch)
        return _compare([experiment], preset, changes, place, program, minutes, json, again)


for _experiment, _text in _EXPERIMENTS.items():
    _add_command(_experiment, _text)


@bench_app.command("all")
@command
def all_(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    program: Programs = None,
    minutes: Minutes = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Every experiment of the comparison, by one command."""
    changes = {} if repeat is None else {"repeats": repeat}
    again = _command_line("all", preset, server=server, repeat=repeat, program=program)
    place = Place(out, server, scratch)
    return _compare(list(_EXPERIMENTS), preset, changes, place, program, minutes, json, again)


@bench_app.command()
@command
def codecs(
    rounds: Annotated[int, typer.Option(min=1, help="How often each encodes.")] = 7,
    json: Json = False,
) -> int:
    """What each encoder costs on the same frames, and how large its files are."""
    from carstage.bench.codecs import measure_codecs
    from carstage.cli.progress import watch_steps

    with watch_steps("Encoders", "encoders") as progress:
        verdict = measure_codecs(rounds=rounds, progress=progress)
    return report_verdict(verdict, json)


class Place(NamedTuple):
    """Where results go, which server is used, and where programs write."""

    out: Path
    server: str | None
    scratch: Path | None


def _compare(
    experiments: Sequence[Experiment],
    preset_name: PresetName,
    changes: Mapping[str, Any],
    place: Place,
    programs: list[str] | None,
    minutes: float | None,
    json: bool,
    again: str,
) -> int:
    from carstage.bench.comparison import PRESETS, Campaign, judge, write_report
    from carstage.cli.progress import watch_steps

    preset = dataclasses.replace(PRESETS[preset_name.value], **changes)
    campaign = Campaign(
        preset,
        experiments,
        place.out,
        programs=programs,
        server=_address(place.server),
        scratch=place.scratch,
    )
    done = len(campaign.trials) - len(campaign.left)
    if done:
        note(f"{done} of {len(campaign.trials)} runs are in {place.out} already.")
    if campaign.left:
        estimate = timedelta(seconds=round(campaign.estimate_s))
        note(f"{len(campaign.left)} runs to go, about {estimate} on this machine.")
    with watch_steps("Runs", "runs") as progress, _ending_on_request():
        campaign.run(progress, minutes)
    for program, reason in campaign.left_out.items():
        note(f"{program} was left out: {reason}.")
    if campaign.left and not campaign.left_out:
        note(f"{len(campaign.left)} runs are left; the same command continues.")
    measured = list(campaign.results.values())
    verdict = judge(preset, measured, again, campaign.machine)
    for path in write_report(place.out, preset, campaign.machine, measured, verdict):
        note(f"Wrote {path}")
    return report_verdict(verdict, json)


def _command_line(name: str, preset: PresetName, **options: object) -> str:
    """The command that measures the same once more, for the record; not where its files go."""
    words = ["carstage", "bench", name, "--preset", preset.value]
    for option, given in options.items():
        values = given if isinstance(given, list) else [] if given is None else [given]
        for value in values:
            words += [f"--{option}", str(value)]
    return shlex.join(words)


def _address(text: str | None) -> tuple[str, int] | None:
    if text is None:
        return None
    host, separator, port = text.rpartition(":")
    if not separator or not host or not port.isdecimal():
        raise BadInputError(f"--server: {text!r} is no address.", "Write HOST:PORT.")
    return host, int(port)


@contextmanager
def _ending_on_request() -> Iterator[None]:
    """A stretch in which SIGTERM is an exception, so that what is measured ends, too."""
    before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
