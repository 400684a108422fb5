"""Ticks that survive a lost wake-up inside the client wheel, see ``TickWatch``."""

from __future__ import annotations

from collections.abc import Collection
from types import TracebackType
from typing import Any

from carstage.collector.internals.traffic_manager_wakeup import TickWatch


class WatchedClock:
    """Ticks a world, and wakes its Traffic Manager when it missed its cue; a context manager.

    Args:
        world: ``carla.World`` in synchronous mode.
        port: of the Traffic Manager in this process.
        manager: its threads, from ``started_threads``.
    """

    def __init__(self, world: Any, port: int, manager: Collection[int]) -> None:
        self._world = world
        self._port = port
        self._manager = manager

    def __enter__(self) -> WatchedClock:
        self._watch = TickWatch(self._world, self._port, self._manager)
        return self

    def __exit__(
        self,
        _type: type[BaseException] | None,
        _value: BaseException | None,
        _traceback: TracebackType | None,
    ) -> None:
        self._watch.stop()

    @property
    def wake_ups(self) -> int:
        """How often the Traffic Manager missed its cue."""
        return self._watch.wake_ups

    def tick(self) -> int:
        """One tick of the world; its frame number."""
        with self._watch.over_a_tick():
            return int(self._world.tick())

    def apply_settings(self, settings: Any) -> None:
        """Use other settings of the world; CARLA 0.9.13's client ticks once with them."""
        with self._watch.over_a_tick():
            self._world.apply_settings(settings)
