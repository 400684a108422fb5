"""The episode's world: loaded anew, timed as planned, and given back on every way out."""

from __future__ import annotations

import logging
import time
from typing import Any, Callable, List, Tuple

import carla

from carstage.collector.client import answers
from carstage.collector.internals.errors import ran_out_of_time
from carstage.collector.internals.plan import DEFAULT_LOAD_TIMEOUT_S
from carstage.collector.maps import find_map, layers_of
from carstage.collector.timing import keep_clock, keeps_timing, release_timing, take_clock
from carstage.collector.weather import Weather
from carstage.spec import EpisodeSpec

GIVE_BACK_TIMEOUT_S = 5.0

_log = logging.getLogger(__name__)


class WorldSession:
    """A freshly loaded world under our clock; a context manager.

    The map is loaded even when it is loaded already: only a fresh episode starts with the same
    actor ids, frame numbers and random states, so that every attempt records the same.

    Args:
        client: ``carla.Client``.
        spec: the episode.
        timeout_s: the client's timeout, restored after giving back.
        load_timeout_s: how long loading the map may take.
    """

    def __init__(
        self,
        client: Any,
        spec: EpisodeSpec,
        timeout_s: float,
        load_timeout_s: float = DEFAULT_LOAD_TIMEOUT_S,
    ) -> None:
        self.client = client
        self._spec = spec
        self._timeout_s = timeout_s
        self._load_timeout_s = max(timeout_s, load_timeout_s)
        self._give_backs: List[Tuple[str, Callable[[], object]]] = []
        self.world: Any = None
        self.map: Any = None
        self.weather: Any = None

    def __enter__(self) -> WorldSession:
        name = find_map(self.client, self._spec.map)
        self.world = self.client.get_world()
        original = self.world.get_settings()
        # One step after the clock is given back, so that the server carries out what was destroyed.
        self.on_exit("one more step", lambda: self.world.wait_for_tick(GIVE_BACK_TIMEOUT_S))
        self.on_exit("settings", lambda: release_timing(self.world, original))
        try:
            # The clock first: a world that is loaded while the server runs freely has taken a
            # number of steps, of lengths that nobody planned, before it is under our clock.
            take_clock(self.world, self._spec)
            self.world = self._load(name)
            keep_clock(self.world, self._spec)
            self.weather = Weather(self.world, self._spec.weather)
            self.map = self.world.get_map()
        except BaseException:
            self._give_back()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._give_back()

    def _load(self, name: str) -> Any:
        """Load a map: the one call that may last minutes on a sound server."""
        layers = layers_of(self._spec.map_layers)
        self.client.set_timeout(self._load_timeout_s)
        try:
            return self.client.load_world(name, False, layers)
        finally:
            self.client.set_timeout(self._timeout_s)

    def try_spawn(self, blueprint: Any, transform: Any, attach_to: Any = None) -> Any:
        """Spawn an actor; None where the server has no room for it.

        ``World.try_spawn_actor`` gives None as well when the server does not answer in time, as
        after a laptop slept. The actor may stand there then, the next place would be tried, and
        the episode would go on with other actors than its plan has.

        Raises:
            RuntimeError: the server did not answer in time.
        """
        try:
            return self.world.spawn_actor(blueprint, transform, attach_to)
        except RuntimeError as error:
            if ran_out_of_time(error):
                raise
            return None

    def on_exit(self, what: str, give_back: Callable[[], object]) -> None:
        """Have something given back at the end; the last one taken is given back first."""
        self._give_backs.append((what, give_back))

    def destroy_on_exit(self, what: str, actor: Any) -> None:
        """Have an actor destroyed at the end, also one that no frame has shown yet.

        ``Actor.destroy`` does nothing for such an actor: the client takes it for dead.
        """
        command = carla.command.DestroyActor(actor.id)
        self.on_exit(what, lambda: self.client.apply_batch_sync([command], False))

    def leave_to_others(self) -> None:
        """Give back nothing that another client has taken over meanwhile.

        In another world our actors' ids are theirs. In ours, settings that they have changed stay.
        """
        if self.client.get_world().id != self.world.id:
            self._give_backs.clear()
        elif not keeps_timing(self.world, self._spec):
            ours = ("settings", "one more step")
            self._give_backs = [one for one in self._give_backs if one[0] not in ours]

    def _give_back(self) -> None:
        """Give everything back, whatever fails: a server that died must not hide why.

        A server that is gone is asked for nothing: each call would wait for its timeout, and the
        Traffic Manager's thread ends the whole process when its calls fail.
        """
        give_back_s = min(GIVE_BACK_TIMEOUT_S, self._timeout_s)
        try:
            alive = answers(self.client, give_back_s)
            while alive and self._give_backs:
                what, give_back = self._give_backs.pop()
                begin_s = time.monotonic()
                try:
                    give_back()
                except RuntimeError as error:
                    _log.warning("giving back failed (%s): %s", what, error)
                if time.monotonic() - begin_s >= give_back_s:
                    alive = answers(self.client, give_back_s)
            if not alive:
                self._give_backs.clear()
                _log.error("the server is gone: nothing can be given back")
        finally:
            self.client.set_timeout(self._timeout_s)
