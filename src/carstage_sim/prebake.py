"""Everything that a server would compute at its first use, computed ahead: ``bake`` on the command
line makes towns, their acceleration structures, machine code and the shapes of all blueprints."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from carstage_sim.maps import MapCatalogue, MapFileError, MapSamplingError, Town
from carstage_sim.maps.loading import TownSource
from carstage_sim.sensors import WorldSensors
from carstage_sim.world.blueprints import catalogue
from carstage_sim.world.kernel_warmup import warm_up_mechanics
from carstage_sim.world.world import World

_LEAST_MINUTES_S = 90.0


def prebake(
    maps: MapCatalogue,
    names: Sequence[str],
    report: Callable[[str], None],
    clock: Callable[[], float] = time.monotonic,
    await_rays: Callable[[], None] = lambda: None,
) -> bool:
    """Bake maps, and what every map needs.

    Args:
        maps: the maps that there are.
        names: which to bake; none means all that are offered.
        report: called with each line of progress.
        clock: seconds, for the forecast of the remaining time.
        await_rays: as for ``WorldSensors.warm_up``.

    Returns:
        Whether all succeeded; one that fails is reported and the others go on.

    Raises:
        UnknownTownError: a name is no map's; nothing was baked.
    """
    wanted = list(dict.fromkeys(maps.resolve(name) for name in names or maps.names))
    whole = True
    pace = _Pace(clock)
    sources = dict[str, TownSource]()
    for name in wanted:
        try:
            sources[name] = maps.source(name)
        except MapFileError as error:
            report(f"{name}: {error}")
            whole = False
    missing = [source for source in sources.values() if not maps.is_baked(source)]
    pace.remaining = sum(len(source.opendrive) for source in missing)
    warm = False
    for number, (name, source) in enumerate(sources.items(), start=1):
        place = f"[{number}/{len(sources)}] {name}"
        baked = maps.is_baked(source)
        report(f"{place}: {'was baked before' if baked else 'baking' + pace.forecast()}")
        pace.begin()
        try:
            town = maps.load(name)
        except MapSamplingError as error:
            report(f"{place}: {error}")
            whole = False
            pace.end(len(source.opendrive))
            continue
        if not baked:
            seconds = pace.end(len(source.opendrive))
            report(
                f"{place}: {len(town.static_mesh.triangles) / 1e3:.0f} thousand triangles, "
                f"{len(town.spawn_points)} spawn points, {seconds:.0f} s{pace.forecast()}"
            )
        if not warm:
            report("machine code and the shapes of vehicles and walkers, once for all maps")
        _finish(town, None if warm else await_rays)
        warm = True
    return whole


def _finish(town: Town, await_rays: Callable[[], None] | None) -> None:
    """Store what a server of this town computes apart from the town itself.

    Args:
        town: of the server.
        await_rays: as for ``prebake``; None: what all towns have in common is there.
    """
    with WorldSensors(town) as sensors:
        if await_rays is not None:
            warm_up_mechanics(World(town, 1))
            for type_id in catalogue():
                sensors.expect(type_id)
            sensors.warm_up(await_rays)


class _Pace:
    """How long the rest will take, from what went before: a map's size tells its time roughly.

    Attributes:
        remaining: characters of OpenDRIVE that are not baked yet.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._begun_s = 0.0
        self._spent_s = 0.0
        self._done = 0
        self.remaining = 0

    def begin(self) -> None:
        self._begun_s = self._clock()

    def end(self, size: int) -> float:
        """Note that a map of some size is done; the seconds that it took."""
        seconds = self._clock() - self._begun_s
        self._spent_s += seconds
        self._done += size
        self.remaining -= size
        return seconds

    def forecast(self) -> str:
        """What is left, as the end of a sentence; nothing before there is a measure."""
        if not self._done or self.remaining <= 0:
            return ""
        left_s = self._spent_s / self._done * self.remaining
        if left_s < _LEAST_MINUTES_S:
            return f"; about {max(left_s, 1.0):.0f} s left"
        return f"; about {left_s / 60.0:.0f} min left"
