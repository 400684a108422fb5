"""The command that draws the documentation's pictures again."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from benchmarks.registry import benchmark, report
from carstage.bench.verdict import Figure, Verdict
from carstage.cli.output import Json, note
from carstage.errors import BadInputError

if TYPE_CHECKING:
    from PIL import Image

Drawer = Callable[[], "Iterator[tuple[str, Image.Image]]"]
"""Gives the pictures that belong together, each with its file name."""

DRAWERS: Mapping[str, str] = {
    "demo": "benchmarks.pictures.recorded:demo",
    "surroundings": "benchmarks.pictures.recorded:surroundings",
    "level-labels": "benchmarks.pictures.recorded:level_labels",
    "towns": "benchmarks.pictures.towns:towns_from_above",
    "rendering": "benchmarks.pictures.towns:rendering",
}
"""Module and function of each drawer, which are imported when they draw."""
FOLDER = Path("docs/images")


@benchmark("pictures", takes="3 minutes")
def pictures(
    names: Annotated[
        list[str] | None, typer.Argument(help=f"Of {', '.join(DRAWERS)}; default: all.")
    ] = None,
    folder: Annotated[Path, typer.Option(help="Where they go.")] = FOLDER,
    json: Json = False,
) -> int:
    """Draws the documentation's pictures again, from fixed seeds."""
    from benchmarks.pictures.saving import save_pictures

    drawers = [drawer(name) for name in names or DRAWERS]
    written = []
    for draw in drawers:
        for path in save_pictures(draw(), folder):
            note(f"{path}  {path.stat().st_size / 1000:.0f} kB")
            written.append(str(path))
    return report(Verdict("pictures", (Figure("pictures", len(written)),), tuple(written)), json)


def drawer(name: str) -> Drawer:
    """What draws some pictures.

    Raises:
        BadInputError: nothing has this name.
    """
    if name not in DRAWERS:
        raise BadInputError(f"No pictures are called {name!r}.", f"There are {', '.join(DRAWERS)}.")
    module, _, function = DRAWERS[name].partition(":")
    found: Drawer = getattr(import_module(module), function)
    return found
