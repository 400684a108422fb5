"""Who keeps the world in synchronous mode, so that it can be let go when they are gone.

CARLA leaves a world that waits for ticks waiting for ever when the program that ticked it dies, and
with it every other client. Here the world belongs to the connections that asked for synchronous
mode or have ticked since; an idle one keeps it, the end of the last one gives it back.
"""

from __future__ import annotations

from carstage_sim.wire.rpc import Connection
from carstage_sim.world.controls import EpisodeSettings


class SynchronousClaims:
    """The connections that hold the world."""

    def __init__(self) -> None:
        self._holders: set[Connection] = set()
        self._before = EpisodeSettings()

    @property
    def before(self) -> EpisodeSettings:
        """The settings that the world had when it was last free."""
        return self._before

    @property
    def held(self) -> bool:
        """Whether anybody holds the world."""
        return bool(self._holders)

    def served(
        self,
        connection: Connection,
        before: EpisodeSettings,
        after: EpisodeSettings,
        *,
        claims: bool,
    ) -> None:
        """Take note of a call.

        Args:
            connection: who called.
            before, after: the world's settings around the call.
            claims: whether it was one that claims the world: a tick, or settings.
        """
        self.changed(before, after)
        if claims and after.synchronous_mode:
            self._holders.add(connection)

    def changed(self, before: EpisodeSettings, after: EpisodeSettings) -> None:
        """Take note of the world's settings around what may have changed them."""
        if not before.synchronous_mode and after.synchronous_mode:
            self._before = before
        if not after.synchronous_mode:
            self._holders.clear()

    def left(self, connection: Connection) -> bool:
        """A client is gone; whether it was the last that held the world."""
        if connection not in self._holders:
            return False
        self._holders.remove(connection)
        return not self._holders
