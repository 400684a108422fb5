from __future__ import annotations

from dataclasses import replace
from typing import cast

from carstage_sim.wire.rpc import Connection
from carstage_sim.wire.synchronous_owners import SynchronousOwners
from carstage_sim.world.controls import EpisodeSettings

FREE = EpisodeSettings(max_substeps=3)
SYNCHRONOUS = replace(FREE, synchronous_mode=True)
ONE, OTHER = (cast("Connection", object()) for _ in range(2))


def test_last_holder_that_leaves_gives_the_world_back() -> None:
    owners = SynchronousOwners()
    owners.served(ONE, FREE, SYNCHRONOUS, takes_over=True)
    owners.served(OTHER, SYNCHRONOUS, SYNCHRONOUS, takes_over=True)
    assert owners.left(ONE) is False
    assert owners.left(OTHER) is True
    assert owners.before == FREE


def test_client_that_only_asks_holds_nothing() -> None:
    owners = SynchronousOwners()
    owners.served(ONE, FREE, SYNCHRONOUS, takes_over=True)
    owners.served(OTHER, SYNCHRONOUS, SYNCHRONOUS, takes_over=False)
    assert owners.left(OTHER) is False
    assert owners.owned
    assert owners.left(ONE) is True


def test_world_that_was_set_free_has_no_holder() -> None:
    owners = SynchronousOwners()
    owners.served(ONE, FREE, SYNCHRONOUS, takes_over=True)
    owners.served(OTHER, SYNCHRONOUS, FREE, takes_over=True)
    assert not owners.owned
    assert owners.left(ONE) is False
