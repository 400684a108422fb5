"""``carstage gui``: the graphical interface in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from carstage.cli.output import Debug, command, folder, note, result


@command
def gui(
    datasets: Annotated[
        list[Path] | None,
        typer.Option(
            "--datasets",
            metavar="DIR|URL",
            help="Folder of datasets, or s3://, gs://, az:// and a bucket; new ones are made in "
            "the first. Repeatable. Default: ./datasets.",
        ),
    ] = None,
    work: Annotated[
        Path | None,
        typer.Option(
            "--work",
            metavar="DIR",
            help="Folder of this machine for raw recordings of runs into object stores. Default: "
            "one in the user's cache.",
            callback=folder,
        ),
    ] = None,
    host: Annotated[
        str,
        typer.Option("--host", help="Address to listen on; 0.0.0.0: all of this machine's."),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port; 0 takes a free one.")
    ] = 8321,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page in a browser.")
    ] = True,
    token: Annotated[
        bool,
        typer.Option(
            "--token/--no-token",
            help="Ask everybody for the token in the printed address. Without it, every user of "
            "this machine can start programs in your name; on loopback alone.",
        ),
    ] = True,
    debug: Debug = False,
) -> None:
    """Configure, place sensors, record, watch and browse in a browser."""
    del debug
    from carstage.storage import dataset_root
    from carstage.web.opening import open_in_browser
    from carstage.web.serving import serve

    def ready(url: str) -> None:
        result(f"Car-STAGE is at {url}")
        note("Ctrl-C ends the interface; runs go on.")
        if browser:
            open_in_browser(url)

    roots = tuple(map(dataset_root, datasets or [Path("datasets")]))
    serve(roots, host, port, ready, token=token, work=work)
