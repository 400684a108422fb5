"""The folder of an export: a hidden sibling while it is written, its own name when it is whole."""

from __future__ import annotations

import json
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.storage.remote_path import DatasetPath

DOCUMENT = "export.json"
FORMAT_VERSION = 1


def check_target(out: Path, dataset: DatasetPath, *, overwrite: bool) -> None:
    """Refuse a folder that the export may not become.

    Raises:
        BadInputError: it exists and may not be replaced, is no export although it shall be
            replaced, or the dataset and it lie in one another.
    """
    target, source = out.resolve(), dataset.resolve()
    if isinstance(source, Path) and (
        target == source or target in source.parents or source in target.parents
    ):
        raise BadInputError(
            f"{out} and the dataset {dataset} lie in one another.", "Name another folder."
        )
    if not out.exists() and not out.is_symlink():
        return
    if not overwrite:
        raise BadInputError(f"{out} exists already.", "Name another folder or add --overwrite.")
    if not (out / DOCUMENT).is_file() or out.is_symlink():
        raise BadInputError(
            f"{out} was not written by `carstage export`: it has no {DOCUMENT}.",
            "Remove it yourself or name another folder.",
        )


@contextmanager
def export_folder(out: Path) -> Iterator[Path]:
    """Give a new folder beside ``out`` that takes its place when the block succeeds.

    What fails leaves nothing behind, and what stood at ``out`` stays.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    token = secrets.token_hex(4)
    temporary = out.with_name(f".{out.name}.{token}.part")
    replaced = out.with_name(f".{out.name}.{token}.old")
    temporary.mkdir()
    try:
        yield temporary
        if out.exists():
            out.rename(replaced)
        temporary.rename(out)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        if replaced.exists() and not out.exists():
            replaced.rename(out)
        raise
    if replaced.exists():
        shutil.rmtree(replaced)


def write_document(folder: Path, document: Mapping[str, Any]) -> None:
    """Write ``export.json``: what was exported, from what, how."""
    content = {"format_version": FORMAT_VERSION, **document}
    (folder / DOCUMENT).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
