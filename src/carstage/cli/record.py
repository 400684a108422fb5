"""``carstage record``: beside a program that ticks the world itself."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carstage.cli.output import (
    Debug,
    Json,
    command,
    dataset_address,
    folder,
    note,
    result,
    result_json,
)


@command
def record(
    server: Annotated[
        str, typer.Option("--server", metavar="HOST:PORT", help="The server of the other program.")
    ],
    ego: Annotated[
        str,
        typer.Option(
            "--ego",
            metavar="ROLE|ID|FILTER",
            help="The vehicle that carries the rig: its role_name (as `hero`), its actor id, or a "
            "pattern of blueprints (as `vehicle.*`).",
        ),
    ],
    rig: Annotated[
        str,
        typer.Option(
            "--rig",
            metavar="PRESET|FILE",
            help="A rig that ships with Car-STAGE (`config presets`), or a configuration; its "
            "rig, labels and output count.",
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="DIR|URL",
            help="Folder of the dataset, or s3://, gs://, az:// and a bucket.",
            callback=dataset_address,
        ),
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="KEY=VALUE", help="Override one value, e.g. --set save_every=2."
        ),
    ] = None,
    wait: Annotated[
        float,
        typer.Option("--wait", metavar="SECONDS", min=1.0, help="How long an ego is waited for."),
    ] = 120.0,
    episodes: Annotated[
        int | None,
        typer.Option("--episodes", min=1, help="End after so many; default: when no ego comes."),
    ] = None,
    catalog: Annotated[
        str | None, typer.Option("--catalog", metavar="URL", help="As of `carstage run`.")
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option("--work", metavar="DIR", help="As of `carstage run`.", callback=folder),
    ] = None,
    json: Json = False,
    debug: Debug = False,
) -> int:
    """Record the ego of another program that ticks the server; one episode per life of the ego.

    Start it before or after the program. It never ticks and changes no setting; Ctrl-C ends it and
    commits what is whole. The world must be in synchronous mode with a fixed step.
    """
    del debug
    from carstage.cli.progress import watch_run
    from carstage.runs import record_beside

    with watch_run() as on_event:
        ended = record_beside(
            server,
            ego,
            rig,
            out,
            on_event,
            settings=tuple(settings or ()),
            wait_s=wait,
            episodes=episodes,
            catalog=catalog,
            work=work,
        )
    for episode_id, reason in ended.failures.items():
        note(f"Episode {episode_id} failed: {reason}")
    if json:
        result_json(ended.to_json())
    elif ended.committed:
        result(f"Dataset: {ended.dataset}")
    else:
        note("Nothing was recorded.")
    return ended.exit_code
