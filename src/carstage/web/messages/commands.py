"""What a user can do here, as the command that does the same."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from carstage.web.messages.base import DatasetId, Label, Message, Name, Place, RunId
from carstage.web.messages.jobs import ExportRequest
from carstage.web.messages.runs import MOST_COMPARED, RunStart


class StartCommand(Message):
    """Begin a run."""

    do: Literal["start"]
    run: RunStart


class RunCommand(Message):
    """Go on with a run, stop it, remove it, or say how far its campaign is."""

    do: Literal["resume", "stop", "delete-run", "campaign-report"]
    run_id: RunId


class CompareRunsCommand(Message):
    """Compare runs."""

    do: Literal["compare-runs"]
    run_ids: Annotated[list[RunId], Field(min_length=2, max_length=MOST_COMPARED)]


class RecordAgainCommand(Message):
    """Record the same into another dataset."""

    do: Literal["duplicate"]
    run_id: RunId
    dataset: Place


class RenameRunCommand(Message):
    """Show a run by another name."""

    do: Literal["rename-run"]
    run_id: RunId
    name: Label


class DatasetCommand(Message):
    """Validate a dataset, write its report, or remove it."""

    do: Literal["validate", "report", "delete-dataset"]
    dataset: DatasetId


class RenameDatasetCommand(Message):
    """Give a dataset another name."""

    do: Literal["rename-dataset"]
    dataset: DatasetId
    name: Label


class ExportCommand(Message):
    """Export a dataset."""

    do: Literal["export"]
    dataset: DatasetId
    export: ExportRequest


class KeptExportCommand(Message):
    """Remove an export."""

    do: Literal["delete-export"]
    name: Name


class RenameExportCommand(Message):
    """Give an export's folder another name."""

    do: Literal["rename-export"]
    name: Name
    new_name: Name


class CommandRequest(Message):
    """What the command shall do."""

    command: Annotated[
        StartCommand
        | RunCommand
        | CompareRunsCommand
        | RecordAgainCommand
        | RenameRunCommand
        | DatasetCommand
        | RenameDatasetCommand
        | ExportCommand
        | KeptExportCommand
        | RenameExportCommand,
        Field(discriminator="do"),
    ]


class CommandText(Message):
    """A command for a shell on the machine of this server."""

    text: str
