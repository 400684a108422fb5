"""A session gives back what it changed, whichever of its steps fails."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from benchmarks.simulator import session
from benchmarks.simulator.session import synchronous_session


class World:
    """A world that cannot be loaded again."""

    def __init__(self) -> None:
        self.synchronous_mode = False

    def get_settings(self) -> SimpleNamespace:
        return SimpleNamespace(synchronous_mode=self.synchronous_mode)

    def apply_settings(self, settings: Any) -> None:
        self.synchronous_mode = settings.synchronous_mode


def test_a_session_that_cannot_begin_leaves_no_server_in_synchronous_mode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    world = World()

    def reload_world(_reset_settings: bool) -> World:
        assert world.synchronous_mode
        raise RuntimeError("time-out")

    client = SimpleNamespace(
        set_timeout=lambda _seconds: None, get_world=lambda: world, reload_world=reload_world
    )
    monkeypatch.setattr(session.carla, "Client", lambda *_address: client)
    with (
        pytest.raises(RuntimeError, match="time-out"),
        synchronous_session(1, delta_s=0.05, seed=1),
    ):
        pass
    assert not world.synchronous_mode
