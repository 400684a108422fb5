"""``carstage runs``: the runs of a dataset, and what can be done with them afterwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from json import dumps as json_text
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from carstage.cli.output import (
    Debug,
    Json,
    command,
    confirmed,
    dataset_address,
    folder,
    note,
    result,
    result_json,
)

if TYPE_CHECKING:
    from carstage.runs.comparing import DifferingSetting, RunFigures
    from carstage.runs.launching import RunOptions

runs_app = typer.Typer(
    help="List and compare the runs of a dataset; resume, stop, rename and delete them.",
    no_args_is_help=True,
)

Dataset = Annotated[
    Path,
    typer.Argument(
        metavar="DIR|URL", help="Folder of the dataset, or its address.", callback=dataset_address
    ),
]
RunName = Annotated[str, typer.Argument(metavar="RUN", help="The run, as `runs list` names it.")]
Work = Annotated[
    Path | None,
    typer.Option("--work", metavar="DIR", help="As the run was given it.", callback=folder),
]
Yes = Annotated[bool, typer.Option("--yes", help="Do not ask.")]


def _work(dataset: Path, work: Path | None) -> Path:
    from carstage.runs.preflight import work_folder

    return work_folder(dataset, work)


def _folder(dataset: Path, run: str, work: Path | None) -> Path:
    from carstage.runs.keeping import run_folder

    return run_folder(_work(dataset, work), run)


@runs_app.command("list")
@command
def list_runs(
    dataset: Dataset, work: Work = None, json: Json = False, debug: Debug = False
) -> None:
    """Print the runs of a dataset, newest first."""
    del debug
    from carstage.runs.keeping import label_of
    from carstage.runs.reading import liveness, read_document

    found: list[dict[str, Any]] = []
    for path in sorted((_work(dataset, work) / "runs").glob("*/status.json"), reverse=True):
        status: dict[str, Any] = read_document(path) or {}
        plan = read_document(path.with_name("plan.json")) or {}
        name = label_of(path.parent) or (plan.get("config") or {}).get("name", "")
        alive = liveness(status)
        state = status.get("state") if alive in ("ended", "running") else alive
        found.append({"run_id": path.parent.name, "name": name, "state": state, "alive": alive,
                      "episodes": status.get("episodes"), "message": status.get("message"),
                      "folder": str(path.parent)})  # fmt: skip
    if json:
        result_json({"runs": found})
        return
    for run in found:
        counts: dict[str, int] = run["episodes"] or {}
        done = counts.get("committed", 0) + counts.get("skipped", 0)
        total = counts.get("total", 0)
        result(f"{run['run_id']}  {run['state']:<11}  {done} of {total} episodes  {run['name']}")
    if not found:
        note("No run of this machine has recorded there.")


@runs_app.command("compare")
@command
def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="FOLDER...", help="Folders of two or more runs, as `runs list --json` has them."
        ),
    ],
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Print what several runs took, and which of their settings differ."""
    del debug
    from dataclasses import asdict

    from carstage.errors import BadInputError
    from carstage.runs.comparing import differing_settings, run_figures
    from carstage.runs.keeping import settings_of

    for place in runs:
        if not (place / "status.json").is_file():
            raise BadInputError(
                f"{place} is no run's folder: it has no status.json.",
                "Name folders such as datasets/demo/runs/RUN; `carstage runs list DIR` lists them.",
            )
    if len(runs) < 2:
        raise BadInputError("One run has nothing to be compared with.", "Name a second folder.")
    figures = [run_figures(place) for place in runs]
    settings = differing_settings([settings_of(place) for place in runs])
    if json:
        result_json(
            {
                "runs": [asdict(one) for one in figures],
                "settings": [asdict(one) for one in settings],
            }
        )
        return
    result("\n".join(_compared(figures, settings)))


def _compared(figures: Sequence[RunFigures], settings: Sequence[DifferingSetting]) -> list[str]:
    """Figures and settings as columns, one for each run."""
    rows = [["", *(one.run_id for one in figures)]]
    for title, text in _FIGURES:
        rows.append([title, *(text(one) for one in figures)])
    rows += [[one.path, *(_value(value) for value in one.values)] for one in settings]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = ["  ".join(map(str.ljust, row, widths)).rstrip() for row in rows]
    return lines if settings else [*lines, "No setting differs."]


_FIGURES: tuple[tuple[str, Callable[[RunFigures], str]], ...] = (
    ("name", lambda one: one.name),
    ("state", lambda one: one.state),
    ("took", lambda one: _shown(one.took_s, "{:.1f} s")),
    ("episodes", lambda one: f"{one.episodes} of {one.planned}"),
    ("failed", lambda one: str(one.failed)),
    ("saved frames", lambda one: str(one.frames)),
    ("saved frames per second", lambda one: _shown(one.frames_s, "{:.2f}")),
    ("CPU, mean", lambda one: _shown(one.cpu_cores, "{:.2f} cores")),
    ("memory, at most", lambda one: _shown(one.memory_bytes, "{:.0f} MB", 1e-6)),
    ("written to disks", lambda one: _shown(one.written_bytes, "{:.0f} MB", 1e-6)),
)


def _shown(value: float | None, form: str, factor: float = 1.0) -> str:
    return "-" if value is None else form.format(value * factor)


def _value(value: Any) -> str:
    """A setting's value in a cell."""
    if value is None:
        return "-"
    return value if isinstance(value, str) else json_text(value)


@runs_app.command("resume")
@command
def resume(
    dataset: Dataset,
    run: RunName,
    retries: Annotated[
        int, typer.Option("--retries", min=0, max=100, help="Further attempts of an episode.")
    ] = 2,
    append: Annotated[
        bool, typer.Option("--append", help="Record also beside episodes of other settings.")
    ] = False,
    workers: Annotated[
        str, typer.Option("--workers", metavar="N|auto", help="As of `carstage run`.")
    ] = "1",
    catalog: Annotated[
        str | None, typer.Option("--catalog", metavar="URL", help="As of `carstage run`.")
    ] = None,
    work: Work = None,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """Record what a run has left: stopped, failed or killed, it goes on with the same settings."""
    del debug
    from carstage.cli.app import record
    from carstage.config import check_config
    from carstage.errors import BadInputError
    from carstage.runs.allotment import parse_workers
    from carstage.runs.keeping import settings_of, share_of
    from carstage.runs.launching import RunOptions
    from carstage.runs.reading import liveness, read_document

    place = _folder(dataset, run, work)
    if liveness(read_document(place / "status.json") or {}) in ("running", "stalled"):
        raise BadInputError(f"Run {run} goes on.", "Wait for its end, or stop it first.")
    given = RunOptions(retries, append, parse_workers(workers), catalog)
    options = _as_of_run(given) | {"work": work, "shard": share_of(place)}
    return record(check_config(dict(settings_of(place))), dataset, json=json, **options)


def _as_of_run(options: RunOptions) -> dict[str, Any]:
    return {"retries": options.retries, "append": options.append, "workers": options.workers,
            "catalog": options.catalog}  # fmt: skip


@runs_app.command("stop")
@command
def stop(dataset: Dataset, run: RunName, work: Work = None, debug: Debug = False) -> None:
    """Ask a run to stop: the first time it finishes its frame, the second time it ends at once."""
    del debug
    from carstage.runs.launching import ask_to_stop
    from carstage.runs.reading import read_document

    ask_to_stop(read_document(_folder(dataset, run, work) / "status.json") or {})
    note(f"Run {run} was asked to stop.")


@runs_app.command("rename")
@command
def rename(
    dataset: Dataset,
    run: RunName,
    name: Annotated[str, typer.Argument(metavar="NAME", help="How it shall be shown.")],
    work: Work = None,
    debug: Debug = False,
) -> None:
    """Show a run by another name; what it recorded stays as it is."""
    del debug
    from carstage.runs.keeping import rename_run

    rename_run(_folder(dataset, run, work), name)


@runs_app.command("delete")
@command
def delete(
    dataset: Dataset, run: RunName, yes: Yes = False, work: Work = None, debug: Debug = False
) -> None:
    """Remove a run's logs, plan and raw recordings; its episodes stay in the dataset."""
    del debug
    from carstage.errors import BadInputError
    from carstage.runs.keeping import remove_run

    place = _folder(dataset, run, work)
    if not (yes or confirmed(f"{place}", "Remove it? This cannot be undone.")):
        raise BadInputError(f"Run {run} was not removed.", "Say yes, or add --yes.")
    remove_run(place)
    note(f"Removed run {run}.")
