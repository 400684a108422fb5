"""The commands. Heavy modules are imported inside them, so that ``--help`` is quick."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.main import get_command_name
from typer.models import CommandInfo

from carstage.cli import comparison  # noqa: F401 - adds its commands to bench_app
from carstage.cli.bench import bench_app
from carstage.cli.campaign import campaign_app
from carstage.cli.catalog import catalog_app
from carstage.cli.configuration import read_configuration
from carstage.cli.dataset import dataset_app
from carstage.cli.estimate import estimate
from carstage.cli.export import export
from carstage.cli.gui import gui
from carstage.cli.loading import loading
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
from carstage.cli.record import record as record_command
from carstage.cli.rig import rig_app
from carstage.cli.runs import runs_app
from carstage.cli.split import split

if TYPE_CHECKING:
    from carstage.config import Config
    from carstage.runs import RunResult

app = typer.Typer(
    name="carstage",
    help="Labelled, verified, multi-sensor driving datasets from the CARLA simulator.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
config_app = typer.Typer(help="Write, check and describe configurations.", no_args_is_help=True)
app.add_typer(config_app, name="config")
app.add_typer(bench_app, name="bench")
app.add_typer(campaign_app, name="campaign")
app.command()(estimate)
app.add_typer(catalog_app, name="catalog")
app.command()(export)
app.command()(gui)
app.command("record")(record_command)
app.command()(split)
app.add_typer(rig_app, name="rig")
app.add_typer(runs_app, name="runs")
app.add_typer(dataset_app, name="dataset")

DEMO_FOLDER = Path("datasets/demo")


def narrowed(arguments: list[str]) -> typer.Typer:
    """The command line with one command alone, where its name is the first argument.

    Typer makes the parsers of all commands whenever one is called: 22 ms of CPU against 1 ms.

    Args:
        arguments: of the process, without its name.
    """
    commands = [one for one in app.registered_commands if [_name_of(one)] == arguments[:1]]
    groups = [one for one in app.registered_groups if [one.name] == arguments[:1]]
    if not commands and not groups:
        return app
    alone = copy.copy(app)
    alone.registered_commands, alone.registered_groups = commands, groups
    return alone


def _name_of(command_info: CommandInfo) -> str | None:
    """What a command is called on the command line."""
    function = command_info.callback
    return command_info.name or (get_command_name(function.__name__) if function else None)


Out = Annotated[
    Path,
    typer.Option(
        "--out",
        metavar="DIR|URL",
        help="Folder of the dataset, or s3://, gs://, az:// and a bucket; created if missing.",
        callback=dataset_address,
    ),
]
Work = Annotated[
    Path | None,
    typer.Option(
        "--work",
        metavar="DIR",
        help="Folder of this machine for raw recordings and logs. Default: that of --out, or one "
        "in the user's cache.",
        callback=folder,
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Override one value, e.g. --set fps=20. Repeatable."
    ),
]
Retries = Annotated[
    int, typer.Option("--retries", min=0, max=100, help="Further attempts of a failed episode.")
]
Append = Annotated[
    bool,
    typer.Option(
        "--append",
        help="Record also beside episodes of other settings, versions or environments.",
    ),
]


def _version(wanted: bool) -> None:
    if wanted:
        from carstage import __version__

        result(f"carstage {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="Print the version."),
    ] = False,
    debug: Debug = False,
) -> None:
    del version, debug


@app.command()
@command
def demo(
    out: Out = DEMO_FOLDER,
    settings: Settings = None,
    json: Json = False,
    retries: Retries = 2,
    append: Append = False,
    debug: Debug = False,
) -> int:
    """Record the demonstration: five seconds in town with eight sensors, labelled."""
    del debug
    with loading():
        from carstage.config import load_demo

        configured = load_demo(settings or ())
    return record(configured, out, json=json, report=True, retries=retries, append=append)


@app.command()
@command
def run(
    config: Annotated[
        Path,
        typer.Argument(help="The configuration, YAML; -: standard input.", metavar="CONFIG"),
    ],
    out: Out,
    settings: Settings = None,
    json: Json = False,
    retries: Retries = 2,
    append: Append = False,
    shard: Annotated[
        str | None,
        typer.Option(
            "--shard",
            metavar="I/N",
            help="Record the I-th of N shares of the episodes alone, for one of N machines.",
        ),
    ] = None,
    catalog: Annotated[
        str | None,
        typer.Option(
            "--catalog",
            metavar="URL",
            help="Also write what is committed to this catalog; default: CARSTAGE_CATALOG, if set.",
        ),
    ] = None,
    workers: Annotated[
        str,
        typer.Option(
            "--workers",
            metavar="N|auto",
            help="Servers on this machine, each recording an episode; the bytes stay the same.",
        ),
    ] = "1",
    ray_address: Annotated[
        str | None,
        typer.Option(
            "--ray-address",
            metavar="ADDRESS|auto|local",
            help="Workers on the nodes of this Ray cluster (needs the extra `ray`).",
        ),
    ] = None,
    ray_resources: Annotated[
        str | None,
        typer.Option(
            "--ray-resources",
            metavar="JSON",
            help='What each worker takes of the Ray cluster, such as {"CPU": 2, "GPU": 0.5}.',
        ),
    ] = None,
    run_id: Annotated[
        str | None,
        typer.Option("--run-id", hidden=True, help="Name of the run's folder."),
    ] = None,
    work: Work = None,
    debug: Debug = False,
) -> int:
    """Record a configuration into a dataset; the same command again continues where it ended."""
    del debug
    with loading():
        from carstage.runs.allotment import parse_workers

        configured = read_configuration(config, settings or ())
    options: dict[str, Any] = {"retries": retries, "append": append}
    options |= {"shard": shard, "run_id": run_id, "work": work, "catalog": catalog}
    if ray_address is None:
        if ray_resources is not None:
            from carstage.errors import BadInputError

            raise BadInputError("--ray-resources goes with --ray-address.", "Give both, or none.")
        options["workers"] = parse_workers(workers)
    else:
        from carstage.execution.ray_slots import RayExecutor, parse_resources

        wanted = parse_workers(workers)
        count = None if wanted == "auto" else wanted
        options["executor"] = RayExecutor(
            count, ray_address, parse_resources(ray_resources or "{}")
        )
    return record(configured, out, json=json, report=False, **options)


def record(config: Config, out: Path, *, json: bool, report: bool = False, **options: Any) -> int:
    """Record, say how it went, and give the command's exit code."""
    with loading():
        from carstage.cli.progress import watch_run
        from carstage.runs import run as record_config
        from carstage.runs.continuing import OtherSettingsError

    def recorded() -> RunResult:
        with watch_run() as on_event:
            return record_config(config, out, on_event, **options)

    try:
        ended = recorded()
    except OtherSettingsError as error:
        if not confirmed(error.message, "Record into it all the same?"):
            raise
        options["append"] = True
        ended = recorded()
    report_path = None
    if report and ended.exit_code == 0:
        with loading():
            from carstage.report import write_report

        note("Writing the report.")
        report_path = write_report(ended.dataset)
    if ended.state == "interrupted":
        note(
            f"Interrupted: {ended.committed + ended.skipped} of {ended.total} episodes are in the "
            "dataset. The same command again continues with the rest."
        )
    for episode_id, reason in ended.failures.items():
        note(f"Episode {episode_id} failed: {reason}")
    if not json:
        if ended.committed + ended.skipped:
            result(f"Dataset: {ended.dataset}")
        elif ended.state != "interrupted":
            note("Nothing was recorded.")
        if report_path is not None:
            result(f"Report:  {report_path}")
    else:
        document = ended.to_json()
        if report_path is not None:
            document["report"] = str(report_path)
        result_json(document)
    return ended.exit_code


@config_app.command("init")
@command
def config_init(
    file: Annotated[Path | None, typer.Argument(help="Where to; left out: stdout.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file.")] = False,
    debug: Debug = False,
) -> None:
    """Print the default configuration with a comment for each key."""
    del debug
    from carstage.config import config_template
    from carstage.errors import BadInputError

    if file is None:
        result(config_template().rstrip("\n"))
        return
    if file.exists() and not force:
        raise BadInputError(f"{file} exists already.", "Name another file or add --force.")
    try:
        file.write_text(config_template(), "utf-8")
    except OSError as error:
        raise BadInputError(
            f"{file} cannot be written: {error.strerror}.", "Name another file."
        ) from error
    note(f"Wrote {file}. Record it with: carstage run {file} --out DIR")


@config_app.command("check")
@command
def config_check(
    file: Annotated[Path, typer.Argument(help="The configuration, YAML.")],
    settings: Settings = None,
    offline: Annotated[
        bool,
        typer.Option(
            "--offline", help="Leave out what only a server that is not embedded could tell."
        ),
    ] = False,
    json: Json = False,
    debug: Debug = False,
) -> None:
    """Check a configuration as a run would, and print what it would record."""
    del debug
    from carstage.cli.describe import describe_config
    from carstage.config import load_config

    summary, text = describe_config(load_config(file, settings or ()), offline=offline)
    if json:
        result_json(summary)
    else:
        result(text)


@config_app.command("presets")
@command
def config_presets(json: Json = False, debug: Debug = False) -> None:
    """List the rigs that ship with Car-STAGE, for `rig: {preset: NAME}`."""
    del debug
    from carstage.cli.describe import describe_presets

    summary, text = describe_presets()
    if json:
        result_json(summary)
    else:
        result(text)


@config_app.command("schema")
@command
def config_schema_(debug: Debug = False) -> None:
    """Print the JSON schema of configurations."""
    del debug
    import json

    from carstage.config import config_schema

    result(json.dumps(config_schema(), indent=1, ensure_ascii=False))


Dataset = Annotated[
    Path,
    typer.Argument(
        help="Folder of the dataset, or its address.", metavar="DIR|URL", callback=dataset_address
    ),
]


@app.command()
@command
def validate(
    dataset: Dataset,
    json: Json = False,
    html: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE", help="Also write the verdict as a page."),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=0, help="Processes; 0: this one only. Default: CPU cores."),
    ] = None,
    debug: Debug = False,
) -> int:
    """Recompute from the files whether a dataset is what it says it is."""
    del debug
    with loading():
        from carstage.cli.describe import describe_problem, describe_validation
        from carstage.cli.progress import watch_frames
        from carstage.report import write_validation
        from carstage.validation import validate_dataset

    with watch_frames("Checking") as progress:
        report = validate_dataset(dataset, progress=progress, workers=workers)
    for problem in report.problems:
        note(describe_problem(problem))
    if html is not None:
        _write(html, lambda: write_validation(dataset, report, html))
    result(report.to_json() if json else describe_validation(dataset, report))
    return 0 if report.ok else 1


def _write(file: Path, write: Callable[[], object]) -> None:
    from carstage.errors import BadInputError

    try:
        write()
    except OSError as error:
        raise BadInputError(
            f"{file} cannot be written: {error.strerror}.", "Name another file."
        ) from error


@app.command()
@command
def report(
    dataset: Dataset,
    html: Annotated[
        Path | None,
        typer.Option(
            "--html",
            metavar="FILE",
            help="Where to; default DIR/report.html, of a remote dataset NAME-report.html here.",
        ),
    ] = None,
    films: Annotated[
        bool, typer.Option("--films", help="Add films with boxes (needs the extra `video`).")
    ] = False,
    debug: Debug = False,
) -> None:
    """Write report.html: pictures with boxes, maps, LiDAR from above, statistics, validation."""
    del debug
    with loading():
        from carstage.report import report_file, write_report

    target = html or report_file(dataset)
    _write(target, lambda: write_report(dataset, target, films=films))
    result(str(target))


@app.command(
    context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    add_help_option=False,
)
def sim() -> None:
    """Start the embedded simulator; everything after ``sim`` goes to it (see ``sim --help``)."""
    raise AssertionError("main() hands this command to the simulator's own process")


@app.command()
@command
def doctor(
    out: Out = Path(),
    server: Annotated[
        str | None,
        typer.Option(
            "--server",
            metavar="SERVER",
            help="Also put a server to the self-test: `embedded`, HOST:PORT, or the folder of a "
            "CARLA release. --set server.KEY=VALUE sets the rest.",
        ),
    ] = None,
    settings: Settings = None,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """Check this machine: Python, client wheel, simulator, disk, ports, what dead runs left."""
    del debug
    from carstage.cli.doctor import examine, server_setting

    findings = examine(out)
    if not json:
        for finding in findings:
            result(finding.line())
    ok = all(finding.ok for finding in findings)
    document: dict[str, object] = {"checks": [finding.to_json() for finding in findings]}
    if server is not None:
        from carstage.config import load_demo
        from carstage.runs import examine_server

        verdict = examine_server(load_demo([server_setting(server), *(settings or ())]), note)
        document["self_test"] = verdict.to_json()
        ok = ok and verdict.ok
        if not json:
            result(f"Self-test of CARLA {verdict.server} with the client {verdict.client}:")
            for check in verdict.checks:
                result(check.line())
    if json:
        result_json({"ok": ok, **document})
    return 0 if ok else 1
