"""Loading a map has a patience of its own; every other call keeps the client's."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from carstage.collector.world import WorldSession
from carstage.spec import TimingSpec


class SlowClient:
    """A client that notes the timeout under which each call is made, and cannot load."""

    def __init__(self) -> None:
        self.timeout_s = 20.0
        self.loaded_under_s = 0.0

    def set_timeout(self, timeout_s: float) -> None:
        self.timeout_s = timeout_s

    def get_server_version(self) -> str:
        return "0.9.16"

    def get_available_maps(self) -> list[str]:
        return ["/Game/Carla/Maps/Town12"]

    def get_world(self) -> Any:
        return SimpleNamespace(
            get_settings=SimpleNamespace,
            apply_settings=lambda settings: None,
            wait_for_tick=lambda timeout_s: None,
        )

    def load_world(self, name: str, reset: bool, layers: Any) -> Any:
        del name, reset, layers
        self.loaded_under_s = self.timeout_s
        raise RuntimeError("time-out of 300000ms")


def test_loading_a_map_has_a_timeout_of_its_own() -> None:
    client = SlowClient()
    timing = TimingSpec("sync", True, 0.01, 10, "wait")
    spec: Any = SimpleNamespace(map="Town12", map_layers=None, timing=timing, step_s=0.1)
    with pytest.raises(RuntimeError), WorldSession(client, spec, 20.0, 300.0):
        pytest.fail("it was loaded")
    assert client.loaded_under_s == 300.0
    assert client.timeout_s == 20.0
