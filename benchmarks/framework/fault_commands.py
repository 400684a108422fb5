"""The commands that break, disturb and interrupt runs, and look at what is left."""

from __future__ import annotations

from typing import Annotated

import typer

from benchmarks.registry import Scratch, benchmark, report
from carstage.cli.output import Json, note


@benchmark("faults", takes="90 minutes")
def faults(
    n: Annotated[int, typer.Option("--n", min=1, help="Faults to draw.")] = 200,
    seed: Annotated[int, typer.Option(help="What they are drawn from.")] = 0,
    kind: Annotated[
        list[str] | None, typer.Option(help="Only faults of this kind. Repeatable.")
    ] = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="Begin no further trial after that time.")
    ] = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether tiny runs, disturbed at random, end well and commit what is right."""
    from dataclasses import asdict

    from benchmarks.framework.faults import run_campaign, table, table_text

    verdict, trials = run_campaign(
        count=n, seed=seed, kinds=kind or (), scratch=scratch, minutes=minutes, notify=note
    )
    rows = {"kinds": table(trials), "trials": [asdict(trial) for trial in trials]}
    return report(verdict, json, table_text(trials), **rows)


@benchmark("io-errors", takes="40 minutes")
def io_errors(
    n: Annotated[int, typer.Option("--n", min=1, help="Calls to fail.")] = 330,
    seed: Annotated[int, typer.Option(help="What they are drawn from.")] = 0,
    minutes: Annotated[
        float | None, typer.Option(min=0.1, help="Begin no further trial after that time.")
    ] = None,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether runs end well when single calls of the system fail; needs strace."""
    from dataclasses import asdict

    from benchmarks.framework.faults import run_io_errors, table_text

    verdict, trials = run_io_errors(
        count=n, seed=seed, scratch=scratch, minutes=minutes, notify=note
    )
    return report(verdict, json, table_text(trials), trials=[asdict(trial) for trial in trials])


@benchmark("crash-states", takes="20 minutes")
def crash_states(
    completions: Annotated[
        int, typer.Option(min=0, help="States at which the same command is given again.")
    ] = 160,
    most_states: Annotated[
        int | None, typer.Option(min=1, help="Look at no more states; default: at all.")
    ] = None,
    seed: Annotated[int, typer.Option(help="What is drawn by chance is drawn from it.")] = 0,
    scratch: Scratch = None,
    json: Json = False,
) -> int:
    """Whether readers and the next run cope with all that a power cut may leave; needs strace."""
    from benchmarks.framework.crash_states import measure_crash_states, to_json

    verdict, trials = measure_crash_states(
        completions=completions, most_states=most_states, seed=seed, scratch=scratch, notify=note
    )
    return report(verdict, json, trials=[to_json(trial) for trial in trials])


@benchmark("busy-machine", takes="40 minutes")
def busy_machine(
    demos: Annotated[int, typer.Option(min=1, help="Recorded under load.")] = 20,
    per_core: Annotated[int, typer.Option(min=1, help="Busy processes for each core.")] = 3,
    seconds: Annotated[float, typer.Option(min=0.1, help="Simulated, of each demo.")] = 5.0,
    json: Json = False,
) -> int:
    """Whether demos on a busy machine have the files of one on a calm machine."""
    from benchmarks.framework.busy_machine import measure_busy_machine
    from carstage.cli.progress import watch_steps

    with watch_steps("Demos", "demos") as progress:
        verdict = measure_busy_machine(demos, per_core, seconds, progress)
    return report(verdict, json)


@benchmark("interrupting", takes="60 minutes")
def interrupting(
    trials: Annotated[int, typer.Option(min=1, help="Runs that are interrupted.")] = 30,
    per_core: Annotated[int, typer.Option(min=1, help="Busy processes for each core.")] = 3,
    seed: Annotated[int, typer.Option(help="Of the moments.")] = 1,
    json: Json = False,
) -> int:
    """How fast a run ends when it is asked to, on a busy machine, and that nothing is lost."""
    from benchmarks.framework.interrupting import measure_interrupting
    from carstage.cli.progress import watch_steps

    with watch_steps("Trials", "trials") as progress:
        verdict = measure_interrupting(trials, per_core, seed, progress)
    return report(verdict, json)


@benchmark("odd-machines", takes="5 minutes")
def odd_machines(json: Json = False) -> int:
    """Whether a run on odd machines has the same bytes, or says why it cannot be."""
    from benchmarks.framework.odd_machines import measure_odd_machines, rows_json, rows_text
    from carstage.cli.progress import watch_steps

    with watch_steps("Machines", "machines") as progress:
        verdict, rows = measure_odd_machines(progress=progress)
    return report(verdict, json, rows_text(rows), machines=rows_json(rows))


@benchmark("two-hosts", takes="30 minutes")
def two_hosts(
    schedules: Annotated[int, typer.Option("--n", min=1, help="How many.")] = 50,
    seed: Annotated[int, typer.Option(help="What they are drawn from.")] = 1,
    json: Json = False,
) -> int:
    """Whether two hosts on one folder commit each episode once, whatever holds or kills them."""
    from benchmarks.framework.two_hosts import measure_two_hosts
    from carstage.cli.progress import watch_steps

    with watch_steps("Schedules", "schedules") as progress:
        verdict = measure_two_hosts(schedules, seed, progress)
    return report(verdict, json)


@benchmark("undamaged", takes="5 minutes")
def undamaged(
    datasets: Annotated[int, typer.Option(min=1, help="To record and validate.")] = 20,
    json: Json = False,
) -> int:
    """Whether validation finds no error in datasets that nobody damaged."""
    from benchmarks.framework.undamaged import measure_undamaged
    from carstage.cli.progress import watch_steps

    with watch_steps("Datasets", "datasets") as progress:
        verdict = measure_undamaged(datasets, progress)
    return report(verdict, json)


@benchmark("chaos", takes="20 minutes")
def chaos(
    episodes: Annotated[int, typer.Option(min=1, help="Short ones.")] = 60,
    workers: Annotated[int, typer.Option(min=1, help="Of the run.")] = 4,
    seed: Annotated[int, typer.Option(help="Of the faults.")] = 1,
    every_s: Annotated[float, typer.Option(min=1.0, help="Mean seconds between kills.")] = 12.0,
    json: Json = False,
) -> int:
    """Whether many workers fill an object store exactly once while everything breaks."""
    from benchmarks.framework.chaos import measure_chaos
    from carstage.cli.progress import watch_steps

    with watch_steps("Episodes", "episodes") as progress:
        verdict = measure_chaos(episodes, workers, seed, every_s, progress)
    return report(verdict, json)
