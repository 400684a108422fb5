"""Who waits for an ego is told what kept it away, whatever the server answers."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from carstage.collector.following import Follower, FollowPlan
from carstage.collector.internals.errors import SceneError
from carstage.collector.internals.plan import ServerPlan


class WorldlessClient:
    """Of a server that tells its version, and nothing of its world."""

    def set_timeout(self, seconds: float) -> None:
        pass

    def get_client_version(self) -> str:
        return "0.9.16"

    get_server_version = get_client_version

    def get_world(self) -> Any:
        raise RuntimeError("time-out of 20000ms while waiting for the simulator")


def test_a_server_that_tells_nothing_of_its_world_is_no_error_of_the_recorder() -> None:
    plan = FollowPlan(ServerPlan("127.0.0.1", 2000, 1.0, 1.0, 1), "hero", 0.0, None, "", 1, ())
    stop = SimpleNamespace(check=lambda: None)
    follower = Follower(WorldlessClient(), plan, None, stop, None)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match="no vehicle 'hero' appeared within 0 s") as caught:
        follower.record_all()
    assert "tells nothing of its world" in caught.value.hint
