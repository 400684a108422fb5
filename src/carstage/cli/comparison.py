"""``carstage bench frames|cameras|lidars|objects|totals|all|codecs``: beside other programs."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from datetime import timedelta
from enum import Enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from carstage.cli.bench import Json, bench_app, report_verdict
from carstage.cli.output import command, note
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from carstage.bench.comparison import Preset
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
Frames = Annotated[
    int | None, typer.Option(min=2, help="Of each run, not the preset's; not for `frames`.")
]
Programs = Annotated[
    list[str] | None,
    typer.Option("--program", help="Compare this program only. Repeatable."),
]
Scratch = Annotated[
    Path | None,
    typer.Option(
        help="Existing folder for what programs write, on the disk to be measured; default: --out.",
        exists=True,
    ),
]
_OUT = Path("benchmark")


@bench_app.command("frames")
@command
def frames_(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    value: Values = None,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Seconds per frame of the paper's rig, labelled, by the number of frames."""
    return _compare(["frames"], preset, server, repeat, out, program, scratch, json, value)


@bench_app.command()
@command
def cameras(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    value: Values = None,
    frames: Frames = None,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """What each further camera adds, by every program."""
    return _compare(["cameras"], preset, server, repeat, out, program, scratch, json, value, frames)


@bench_app.command()
@command
def lidars(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    value: Values = None,
    frames: Frames = None,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """What each further LiDAR of 100,000 points adds."""
    return _compare(["lidars"], preset, server, repeat, out, program, scratch, json, value, frames)


@bench_app.command()
@command
def objects(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    value: Values = None,
    frames: Frames = None,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """What further vehicles and pedestrians add, labelled."""
    return _compare(["objects"], preset, server, repeat, out, program, scratch, json, value, frames)


@bench_app.command()
@command
def totals(
    preset: PresetOption = PresetName.DOCS,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    value: Values = None,
    frames: Frames = None,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """How far from the limit: the whole time against a client that ticks and drops everything."""
    return _compare(["totals"], preset, server, repeat, out, program, scratch, json, value, frames)


@bench_app.command("all")
@command
def all_(
    preset: PresetOption = PresetName.QUICK,
    server: Server = None,
    repeat: Repeat = None,
    out: Out = _OUT,
    program: Programs = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Every experiment of the comparison, by one command."""
    from carstage.bench.comparison import EXPERIMENTS

    return _compare(EXPERIMENTS, preset, server, repeat, out, program, scratch, json)


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


def _compare(
    experiments: Sequence[Experiment],
    preset_name: PresetName,
    server: str | None,
    repeat: int | None,
    out: Path,
    programs: list[str] | None,
    scratch: Path | None,
    json: bool,
    values: list[int] | None = None,
    frames: int | None = None,
) -> int:
    from carstage.bench.comparison import PRESETS, Campaign, judge, write_report
    from carstage.cli.progress import watch_steps

    preset = _changed(PRESETS[preset_name.value], experiments, repeat, values, frames)
    campaign = Campaign(
        preset, experiments, out, programs=programs, server=_address(server), scratch=scratch
    )
    done = len(campaign.trials) - len(campaign.left)
    if done:
        note(f"{done} of {len(campaign.trials)} runs are in {out} already.")
    if campaign.left:
        estimate = timedelta(seconds=round(campaign.estimate_s))
        note(f"{len(campaign.left)} runs to go, about {estimate} on this machine.")
    with watch_steps("Runs", "runs") as progress:
        campaign.run(progress)
    name = experiments[0] if len(experiments) == 1 else "all"
    measured = list(campaign.results.values())
    again = f"carstage bench {name} --preset {preset.name}"
    verdict = judge(preset, measured, again, campaign.machine)
    for path in write_report(out, preset, campaign.machine, measured, verdict):
        note(f"Wrote {path}")
    return report_verdict(verdict, json)


def _changed(
    preset: Preset,
    experiments: Sequence[Experiment],
    repeat: int | None,
    values: list[int] | None,
    frames: int | None,
) -> Preset:
    """A preset with what the command line says otherwise."""
    changes: dict[str, object] = {}
    if repeat is not None:
        changes["repeats"] = repeat
    (only,) = experiments if len(experiments) == 1 else (None,)
    if values:
        if only == "totals":
            changes["totals_cameras"] = tuple(sorted(values))
        elif only is not None:
            changes[only] = tuple(sorted(values))
    if frames is not None and only is not None:
        changes[f"{only.removesuffix('s') if only != 'totals' else only}_frames"] = frames
    return dataclasses.replace(preset, **changes)  # type: ignore[arg-type]


def _address(text: str | None) -> tuple[str, int] | None:
    if text is None:
        return None
    host, separator, port = text.rpartition(":")
    if not separator or not host or not port.isdecimal():
        raise BadInputError(f"--server: {text!r} is no address.", "Write HOST:PORT.")
    return host, int(port)
