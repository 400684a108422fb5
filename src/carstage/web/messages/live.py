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


class WatchMessage(Message):
    """Which run a client looks at, and whether it wants pictures."""

    type: Literal["watch"]
    run_id: RunId | None = None
    previews: bool = False


PressedName = Annotated[
    str, Field(pattern=r"^(up|down|left|right|space|[a-z]|[,.]|button\d{1,2})$")
]
Position = Annotated[float, Field(ge=-1, le=1, allow_inf_nan=False)]


class DriveMessage(Message):
    """What is pressed at a client's device, for the run that it drives; the newest one counts.

    Attributes:
        sender: the page, by a random name.
        sequence: number of the message, of that page.
        held: keys and buttons that are down: SDL's names of keys, ``button`` and its number.
        presses: how often each went down so far.
        axes: where each axis stands; those of a pad are numbered as SDL does.
    """

    type: Literal["drive"]
    run_id: RunId
    sender: Annotated[str, Field(pattern=r"^[0-9a-z-]{1,40}$")]
    sequence: Annotated[int, Field(ge=0, le=2**53)]
    held: Annotated[list[PressedName], Field(max_length=64)]
    presses: Annotated[
        dict[PressedName, Annotated[int, Field(ge=0, le=2**53)]], Field(max_length=64)
    ]
    axes: Annotated[list[Position], Field(max_length=64)]


class ClientMessage(RootModel[Annotated[WatchMessage | DriveMessage, Field(discriminator="type")]]):
    """Any message of a client."""
