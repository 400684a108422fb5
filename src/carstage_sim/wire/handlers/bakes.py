"""Calls that need a town which may have to be baked: they wait, the world does not."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from carstage_sim.maps import Bake
from carstage_sim.wire.handlers.registry import LATER, Call

logger = logging.getLogger(__name__)

_POLL_S = 0.05


def once_finished(call: Call, bake: Bake, go_on: Callable[[], Any]) -> Any:
    """Go on at once if a town is there; otherwise the world runs on until it is.

    Returns:
        What ``go_on`` returns, or ``LATER``; then the call is answered with it later.
    """
    if bake.finished:
        return go_on()

    def look() -> None:
        if call.connection.closed:
            logger.info("who asked for %s is gone: it is not loaded", bake.source.name)
            call.simulation.bakes.leave(bake)
        elif bake.finished:
            call.conclude(go_on)
        else:
            call.session.after(_POLL_S, look)

    call.session.after(_POLL_S, look)
    return LATER
