"""Maps from above: what is known of which server's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from running_simulator import RunningSimulator
from sites import Site


def asked(site: Site, server: dict[str, Any], name: str) -> dict[str, Any]:
    answer = site.client.post("/api/map", json={"server": server, "map": name})
    assert answer.status_code == 200, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_a_town_of_the_embedded_simulator_has_lanes_and_spawn_points(site: Site) -> None:
    town = asked(site, {"kind": "embedded"}, "Carla/Maps/Stage01")
    assert (town["map"], town["note"]) == ("Stage01", "")
    assert len(town["spawn_points"]) == 214
    assert len(town["lanes"]) == len(town["lane_widths_m"]) == len(town["lane_heights_m"])
    for lane, heights_m in zip(town["lanes"], town["lane_heights_m"], strict=True):
        assert len(lane) == len(heights_m)
    assert "no map Atlantis" in asked(site, {"kind": "embedded"}, "Atlantis")["note"]


@pytest.mark.end_to_end
def test_of_a_server_that_runs_its_own_spawn_points_are_shown(
    site: Site, simulator: RunningSimulator
) -> None:
    server = {"kind": "remote", "host": simulator.host, "port": simulator.port}
    loaded = asked(site, server, "Stage01")
    own = asked(site, {"kind": "embedded"}, "Stage01")
    np.testing.assert_allclose(loaded["spawn_points"], own["spawn_points"], atol=0.011)
    assert loaded["lanes"] == [], "never the embedded ones for another server"
    assert "not known" in loaded["note"]
    other = asked(site, server, "Town10HD")
    assert other["spawn_points"] == []
    assert "Stage01 loaded" in other["note"]


def test_what_cannot_be_asked_is_said(site: Site) -> None:
    nobody = asked(site, {"kind": "remote", "port": 1024}, "Town01")
    assert "127.0.0.1:1024" in nobody["note"]
    release = asked(site, {"kind": "carla", "path": "/opt/carla"}, "Town01")
    assert "when it runs" in release["note"]
    wrong = site.client.post("/api/map", json={"server": {"kind": "moon"}, "map": "Town01"})
    assert wrong.status_code == 422
