"""Preview through a sensor."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from carstage.web.messages.base import Document, Message


class PreviewRequest(Message):
    """A picture through one sensor of a configuration that need not be saved.

    Attributes:
        config: what the picture's server, map, weather and ego are taken from.
        sensor: one entry of ``rig.sensors``; any camera, LiDAR or radar.
        width: of the picture; cameras keep the shape of theirs.
    """

    config: Document
    sensor: Document
    width: Annotated[int, Field(ge=64, le=1280)] = 640


class PreviewWarm(Message):
    """Which server pictures will come from: the section ``server`` of a configuration."""

    server: Document = Field(default_factory=dict)


class PreviewPending(Message):
    """No picture yet: ask again in a moment.

    Attributes:
        state: ``starting``: the simulator starts; ``busy``: pictures for others are being made.
    """

    state: Literal["starting", "busy"]
    message: str
