"""What goes over the WebSocket ``/api/live``.

The server sends text messages, each a ``LiveMessage``, and binary ones: 8 bytes of header
(channel u8, 3 bytes 0, tick u32 little endian), then a JPEG or float32 (see ``Channel``). Of a
channel only the newest picture is sent; none while the client has not sent ``watch`` with
``previews``.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, RootModel

from carstage.web.messages.base import Message, RunId
from carstage.web.messages.config import ConfigState
from carstage.web.messages.jobs import Job
from carstage.web.messages.runs import Channel, LoadPoint, LogLine, RunDetail, RunSummary, TickPoint


class SnapshotMessage(Message):
    """All that there is, first on every connection; ``run`` is the newest one."""

    type: Literal["snapshot"] = "snapshot"
    config: ConfigState
    runs: list[RunSummary]
    run: RunDetail | None
    jobs: list[Job]


class ConfigMessage(Message):
    """The shared configuration has changed; a client skips its own ``author``."""

    type: Literal["config"] = "config"
    config: ConfigState


class RunsMessage(Message):
    """The list of runs has changed: one came, went or moved in the queue."""

    type: Literal["runs"] = "runs"
    runs: list[RunSummary]


class RunMessage(Message):
    """The state of one run has changed."""

    type: Literal["run"] = "run"
    run_id: RunId
    run: RunSummary


class LogMessage(Message):
    """New lines of the watched run's log; ``reset``: these are all."""

    type: Literal["log"] = "log"
    run_id: RunId
    reset: bool = False
    lines: list[LogLine]


class TicksMessage(Message):
    """New tick times and loads of the watched run; ``reset``: these are all."""

    type: Literal["ticks"] = "ticks"
    run_id: RunId
    reset: bool = False
    ticks: list[TickPoint]
    loads: list[LoadPoint] = Field(default_factory=list)


class ChannelsMessage(Message):
    """Which channel of the binary messages is which sensor of the watched run."""

    type: Literal["channels"] = "channels"
    run_id: RunId
    channels: list[Channel]


class JobMessage(Message):
    """An export or a validation has come further."""

    type: Literal["job"] = "job"
    job: Job


class DatasetsMessage(Message):
    """The list of datasets, or the episodes of one, have changed: ask for them anew."""

    type: Literal["datasets"] = "datasets"


class LiveMessage(
    RootModel[
        Annotated[
            SnapshotMessage
            | ConfigMessage
            | RunsMessage
            | RunMessage
            | LogMessage
            | TicksMessage
            | ChannelsMessage
            | JobMessage
            | DatasetsMessage,
            Field(discriminator="type"),
        ]
    ]
):
    """Any text message of the server."""


class ClientMessage(Message):
    """What a client sends: which run it looks at, and whether it wants pictures."""

    type: Literal["watch"] = "watch"
    run_id: RunId | None = None
    previews: bool = False
