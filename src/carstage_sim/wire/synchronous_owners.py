"""Who keeps the world in synchronous mode, so that it can be let go when they are gone.

CARLA leaves a world that waits for ticks waiting for ever when the program that ticked it dies, and
with it every other client. Here the world belongs to the connections that asked for synchronous
mode or have ticked since; an idle one keeps it, the end of the last one gives it back.
"""

from __future__ import annotations

from carstage_sim.wire.rpc import Connection
from carstage_sim.world.controls import EpisodeSettings


class SynchronousOwners:
    """The connections that own the world."""

    def __init__(self) -> None:
        self._owners: set[Connection] = set()
        self._before = EpisodeSettings()

    @property
    def before(self) -> EpisodeSettings:
        """The settings that the world had when it was last free."""
        return self._before

    @property
    def owned(self) -> bool:
        """Whether any connection owns the world."""
        return bool(self._owners)

    def served(
        self,
        connection: Connection,
        before: EpisodeSettings,
        after: EpisodeSettings,
        *,
        takes_over: bool,
    ) -> None:
        """Take note of a call.

        Args:
            connection: who called.
            before, after: the world's settings around the call.
            takes_over: whether the call makes its connection an owner: a tick, or settings.
        """
        self.changed(before, after)
        if takes_over and after.synchronous_mode:
            self._owners.add(connection)

    def changed(self, before: EpisodeSettings, after: EpisodeSettings) -> None:
        """Take note of the world's settings around what may have changed them."""
        if not before.synchronous_mode and after.synchronous_mode:
            self._before = before
        if not after.synchronous_mode:
            self._owners.clear()

    def left(self, connection: Connection) -> bool:
        """A client is gone; whether it was the last owner of the world."""
        if connection not in self._owners:
            return False
        self._owners.remove(connection)
        return not self._owners
