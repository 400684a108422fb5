from __future__ import annotations

from dataclasses import replace
from typing import cast

from carstage_sim.wire.claims import SynchronousClaims
from carstage_sim.wire.rpc import Connection
from carstage_sim.world.controls import EpisodeSettings

FREE = EpisodeSettings(max_substeps=3)
SYNCHRONOUS = replace(FREE, synchronous_mode=True)
ONE, OTHER = (cast("Connection", object()) for _ in range(2))


def test_last_holder_that_leaves_gives_the_world_back() -> None:
    claims = SynchronousClaims()
    claims.served(ONE, FREE, SYNCHRONOUS, claims=True)
    claims.served(OTHER, SYNCHRONOUS, SYNCHRONOUS, claims=True)
    assert claims.left(ONE) is False
    assert claims.left(OTHER) is True
    assert claims.before == FREE


def test_client_that_only_asks_holds_nothing() -> None:
    claims = SynchronousClaims()
    claims.served(ONE, FREE, SYNCHRONOUS, claims=True)
    claims.served(OTHER, SYNCHRONOUS, SYNCHRONOUS, claims=False)
    assert claims.left(OTHER) is False
    assert claims.held
    assert claims.left(ONE) is True


def test_world_that_was_set_free_has_no_holder() -> None:
    claims = SynchronousClaims()
    claims.served(ONE, FREE, SYNCHRONOUS, claims=True)
    claims.served(OTHER, SYNCHRONOUS, FREE, claims=True)
    assert not claims.held
    assert claims.left(ONE) is False
