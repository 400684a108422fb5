"""What a run watches in the processes that record, and when it steps in."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from carstage.config.fields import Section, setting

Memory = Literal["auto"] | Annotated[int, Field(ge=64, le=16_000_000)]


def _memory(title: str, sentence: str) -> Any:
    return setting("auto", title=title, description=sentence, unit="MB", group="server")


class Supervision(Section):
    """When a server or a collector counts as lost; the episode is then recorded again."""

    hang_s: float = setting(
        20.0,
        title="Patience",
        description="A server that neither answers nor computes for so long has hung; a map may "
        "take ten times as long.",
        unit="s",
        group="server",
        ge=2,
        le=3600,
    )
    server_memory: Memory = _memory(
        "Memory of the server",
        "Resident memory at which a server that the run started is replaced; "
        "`auto`: three quarters of the machine's.",
    )
    collector_memory: Memory = _memory(
        "Memory of the collector",
        "Resident memory at which the collector is ended and the episode recorded again; "
        "`auto`: half of the machine's.",
    )


def restart_every() -> Any:
    """The setting ``restart_every`` of servers that a run starts."""
    return setting(
        0,
        title="Restart every",
        description="Episodes after which the server is started anew, against what it leaks; "
        "0: never.",
        unit="episodes",
        group="server",
        ge=0,
        le=100_000,
    )
