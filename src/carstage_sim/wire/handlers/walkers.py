"""Walkers: control."""

from __future__ import annotations

from typing import Any

from carstage_sim.wire import values
from carstage_sim.wire.handlers.registry import Call, handles_void
from carstage_sim.world.errors import ActorTypeError
from carstage_sim.world.state import ActorKind


@handles_void("apply_control_to_walker")
def _apply_control_to_walker(call: Call, actor_id: int, control: list[Any]) -> None:
    if call.world.live(actor_id).kind is not ActorKind.WALKER:
        raise ActorTypeError(actor_id)
    call.world.control_walker(actor_id, values.walker_control(control))
