"""Calls that a server does not answer: a map that loads, a spawn of a server held still."""

from __future__ import annotations

import signal
from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector.world import WorldSession
from carstage.spec import TimingSpec, WeatherSpec
from raw_client import RawClient
from running_simulator import RunningSimulator

AS_PLANNED = [True, False, [True, 0.1], True, 0.01, 10, 0.0, True, 3000.0, 2000.0, True]
LET_GO_S = 1.5
"""Longer than the server waits before it lets a world go."""


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


@pytest.mark.end_to_end
def test_a_server_that_does_not_answer_is_not_taken_for_an_occupied_place(
    simulator: RunningSimulator,
) -> None:
    client = carla.Client(simulator.host, simulator.port)
    client.set_timeout(10.0)
    spec: Any = SimpleNamespace()
    session = WorldSession(client, spec, 10.0)
    session.world = client.get_world()
    library = session.world.get_blueprint_library()
    blueprint = library.find("vehicle.tesla.model3")
    places = session.world.get_map().get_spawn_points()
    first = session.try_spawn(blueprint, places[0])
    mounted = session.try_spawn(library.find("static.prop.box01"), carla.Transform(), first)
    try:
        assert session.try_spawn(blueprint, places[0]) is None  # that place is taken
        assert mounted.parent.id == first.id
        client.set_timeout(0.5)
        simulator.process.send_signal(signal.SIGSTOP)
        with pytest.raises(RuntimeError, match="time-out"):
            session.try_spawn(blueprint, places[1])
    finally:
        simulator.process.send_signal(signal.SIGCONT)
        client.set_timeout(10.0)
        # The spawn that ran out of time is carried out once the server goes on.
        gone = [one for one in session.world.get_actors() if one.type_id == blueprint.id]
        client.apply_batch_sync(
            [carla.command.DestroyActor(one.id) for one in (*gone, mounted)], False
        )


@pytest.mark.end_to_end
def test_world_of_a_client_that_just_died_is_taken_over_before_the_map_is_loaded(
    simulator: RunningSimulator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its server would let it go a second later, which might be while the map is loaded."""
    load = WorldSession._load

    def load_later(session: WorldSession, name: str) -> Any:
        with pytest.raises(RuntimeError, match="time-out"):
            session.world.wait_for_tick(LET_GO_S)
        return load(session, name)

    monkeypatch.setattr(WorldSession, "_load", load_later)
    timing, weather = TimingSpec("sync", True, 0.01, 10, "wait"), WeatherSpec(None, {}, "auto")
    spec: Any = SimpleNamespace(
        map="Stage01", map_layers=None, timing=timing, step_s=0.1, weather=weather
    )
    client = carla.Client(simulator.host, simulator.port)
    client.set_timeout(20.0)
    with RawClient(simulator.host, simulator.port) as dying:
        dying.value("set_episode_settings", AS_PLANNED)
        dying.value("tick_cue")
    with WorldSession(client, spec, 20.0) as session:
        assert session.world.get_settings().synchronous_mode
