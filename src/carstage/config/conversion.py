"""How raw recordings become files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from carstage.config.fields import Section, setting


class Conversion(Section):
    """How raw recordings become files."""

    mode: Literal["streaming", "deferred"] = setting(
        "streaming",
        title="Mode",
        description="`streaming`: while recording; `deferred`: after all episodes (the paper).",
        group="conversion",
    )
    workers: Literal["auto"] | Annotated[int, Field(ge=1, le=256)] = setting(
        "auto",
        title="Workers",
        description="Processes that convert; `auto`: one for each core, at most 8; of low "
        "priority.",
        group="conversion",
    )
    codecs: dict[str, str] = setting(
        dict,
        title="Codecs",
        description="Codec by sensor id, where it is not the kind's own.",
        group="conversion",
    )
