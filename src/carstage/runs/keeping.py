"""Folders of runs that have ended: found, renamed, removed, and what they recorded with."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.files.whole import write_whole
from carstage.runs.reading import liveness, read_document
from carstage.storage.disk import disk_error
from carstage.storage.keeping import check_label

FOLLOWING_PLAN = "logs/following-plan.json"
"""In the folder of a run that recorded beside another program: what its collector was asked."""
LABEL_FILE = "label.json"
"""In the folder of a run that was renamed: the name that it is shown by."""
_MOST_NAMED = 5


def run_folder(work: Path, run_id: str) -> Path:
    """The folder of a run.

    Args:
        work: what holds the folder ``runs``.
        run_id: its id.

    Raises:
        BadInputError: there is none; says which there are.
    """
    runs = work / "runs"
    known = sorted((path.parent.name for path in runs.glob("*/status.json")), reverse=True)
    if run_id in known:
        return runs / run_id
    some = ", ".join(known[:_MOST_NAMED]) or "none"
    raise BadInputError(
        f"{work} has no run {run_id!r}.",
        f"Its newest runs: {some}. Of a dataset in an object store name --work, if it was given.",
    )


def settings_of(folder: Path) -> Mapping[str, Any]:
    """The configuration that a run has recorded, as ``dump_config`` gave it.

    Raises:
        BadInputError: the run has ended before it was planned.
    """
    plan = read_document(folder / "plan.json")
    config = None if plan is None else plan.get("config")
    if not isinstance(config, dict):
        raise BadInputError(
            f"Run {folder.name} keeps no configuration: it has ended before it was planned.",
            "Start it from its configuration file: carstage run CONFIG --out DIR.",
        )
    return config


def share_of(folder: Path) -> str | None:
    """Which share of the configuration's episodes a run records, as ``2/8``; None: all.

    Raises:
        BadInputError: it recorded beside another program, which alone could make its rest.
    """
    if (folder / FOLLOWING_PLAN).exists():
        raise BadInputError(
            f"Run {folder.name} recorded what another program drove: it has no rest to go on with.",
            "Record the next drive: carstage record RIG --out DIR.",
        )
    share = (read_document(folder / "plan.json") or {}).get("shard")
    return share if isinstance(share, str) else None


def label_of(folder: Path) -> str | None:
    """The name that a run was given afterwards, if it was."""
    document = read_document(folder / LABEL_FILE)
    name = None if document is None else document.get("name")
    return name if isinstance(name, str) else None


def rename_run(folder: Path, name: str) -> None:
    """Show a run by another name; what it recorded stays as it is.

    Raises:
        BadInputError: the name cannot be used.
        StorageError: it cannot be written.
    """
    content = json.dumps({"name": check_label(name)}, ensure_ascii=False).encode()
    try:
        write_whole(folder / LABEL_FILE, content)
    except OSError as error:
        raise disk_error(error, str(folder / LABEL_FILE)) from error


def remove_run(folder: Path) -> None:
    """Remove the folder of a run that goes on no more; its episodes stay in the dataset.

    Raises:
        BadInputError: it goes on.
        StorageError: it cannot be removed.
    """
    status = read_document(folder / "status.json")
    if status is not None and liveness(status) in ("running", "stalled"):
        raise BadInputError(f"Run {folder.name} goes on.", "Stop it first.")
    try:
        # First what makes it a run: one of which a part is left is none any more.
        (folder / "status.json").unlink(missing_ok=True)
        shutil.rmtree(folder)
    except OSError as error:
        raise disk_error(error, str(folder)) from error


def runs_that_go_on(work: Path) -> list[str]:
    """Ids of the runs of a work folder that go on."""
    found = []
    for path in sorted((work / "runs").glob("*/status.json")):
        status = read_document(path)
        if status is not None and liveness(status) in ("running", "stalled"):
            found.append(path.parent.name)
    return found
