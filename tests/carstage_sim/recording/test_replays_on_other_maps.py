"""A log of a map that must be baked first: its caller waits, the simulation thread does not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from carstage_sim.maps import Bake, MapSamplingError
from carstage_sim.maps.loading import TownSource
from carstage_sim.recording.replay_actors import ReplayOptions
from carstage_sim.wire.handlers import recorder
from carstage_sim.wire.handlers.registry import LATER

OPTIONS = ReplayOptions()


class Caller:
    """A call to a simulation of ``Here`` that notes which map is loaded.

    Attributes:
        due: what was put off.
        answers: what the caller was told later.
        loaded: names of maps.
    """

    def __init__(self, bake: Bake | MapSamplingError) -> None:
        self.due: list[Any] = []
        self.answers: list[str] = []
        self.loaded: list[str] = []
        self._bake = bake
        self.world = SimpleNamespace(town=SimpleNamespace(name="Here"))
        self.connection = SimpleNamespace(closed=False)
        self.session = SimpleNamespace(
            after=lambda _delay_s, action: self.due.append(action),
            episode_began=lambda _quiet_s: None,
        )
        self.simulation = SimpleNamespace(
            maps=("Here", "There"),
            prepare=self._prepare,
            load=lambda name, reset_settings: self.loaded.append(name),
            recordings=SimpleNamespace(
                map_of=lambda _name: "Carla/Maps/There",
                path=lambda name: f"/logs/{name}",
                replay=lambda _name, _world, _options: "Total time recorded: 1\n",
            ),
        )

    def _prepare(self, _name: str) -> Bake:
        if isinstance(self._bake, Exception):
            raise self._bake
        return self._bake

    def conclude(self, handle: Any) -> None:
        self.answers.append(handle())


@pytest.fixture
def bake() -> Bake:
    return Bake(TownSource("There", ""))


def replayed(caller: Caller) -> Any:
    return recorder._text(lambda: recorder._on_its_map(cast(Any, caller), "a.log", OPTIONS))


def test_a_replay_waits_for_the_bake_of_its_map(bake: Bake) -> None:
    caller = Caller(bake)
    assert replayed(caller) is LATER
    caller.due.pop()()
    assert not caller.loaded
    bake.end()
    caller.due.pop()()
    assert caller.loaded == ["There"]
    assert caller.answers == [
        "Replaying File: /logs/a.log\nLoading map Carla/Maps/There\nTotal time recorded: 1\n"
    ]


def test_a_map_that_cannot_be_baked_is_told_as_a_map_that_is_missing(bake: Bake) -> None:
    refused = "Replaying File: /logs/a.log\nCould not load mapfile Carla/Maps/There: no lanes\n"
    assert replayed(Caller(MapSamplingError("no lanes"))) == refused
    caller = Caller(bake)
    replayed(caller)
    bake.end("no lanes")
    caller.due.pop()()
    assert caller.answers == [refused]
    assert not caller.loaded
