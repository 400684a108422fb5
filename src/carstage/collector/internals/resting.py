"""Sensors that do not measure in every step: from which tick on they are listened to.

Cameras rest in steps that are not saved, so that the server need not draw for nothing. Sensors with
a rate of their own begin so that they measure in the first recorded step. Only where the server
promises that ``sensor_tick`` counts whole steps from the first in which somebody listens, as the
embedded simulator does. CARLA adds up times and may drift.
"""

from __future__ import annotations

from math import ceil
from types import MappingProxyType
from typing import Dict, FrozenSet, Mapping, NamedTuple, Optional

from carstage.spec import EpisodeSpec
from carstage.spec.timing import SavedSteps

_WITHOUT_MEMORY = frozenset(
    "sensor.camera." + name
    for name in ("rgb", "depth", "semantic_segmentation", "instance_segmentation", "normals")
)
"""Blueprints of which a picture does not depend on earlier ones."""
MOST_STEPS = 100_000
"""After ten times as many, the server's sums of steps and of intervals may be a microsecond apart,
which is all that it lets them be."""

_SLACK = 1e-6


class Resting(NamedTuple):
    """Which sensors measure in every n-th step alone.

    Attributes:
        streams: theirs; none: every sensor measures in every step.
        every: n.
        interval_s: simulated time of n steps.
        begin: the tick of the warm-up from which on they are listened to. The saved ones are
            whole multiples of n later.
        own: by sensor with a rate of its own, the tick of the warm-up from which on it is listened
            to, to measure in the first recorded step.
    """

    streams: FrozenSet[str] = frozenset()
    every: int = 1
    interval_s: float = 0.0
    begin: int = 0
    own: Mapping[str, int] = MappingProxyType({})

    def measure_in(self, warmup_tick: int) -> bool:
        """Whether they measure in a tick of the warm-up."""
        since = warmup_tick - self.begin
        return since >= 0 and SavedSteps(self.every).index(since) is not None


NONE_RESTS = Resting()


def resting_sensors(
    spec: EpisodeSpec, exact_sensor_tick: bool, listening_ticks: Optional[int]
) -> Resting:
    """The sensors of an episode that may rest in steps that are not saved, or have own rates.

    None rest where the warm-up is shorter than what lies between two saved steps, in very long
    episodes, and where a driver may look at what they see.

    Args:
        spec: the episode.
        exact_sensor_tick: whether the server promises what is asked for above.
        listening_ticks: ticks of the warm-up in which sensors are listened to; None: all.
    """
    every, ticks = spec.save_every, spec.warmup_ticks
    if exact_sensor_tick and not spec.timing.sensor_sync:
        least = 0 if listening_ticks is None else max(0, ticks - listening_ticks)
        return Resting(own=_own_begins(spec, least))
    steers = any(one.driver is not None for one in [spec.ego, *(a.ego for a in spec.agents)])
    if not exact_sensor_tick or every == 1 or every > ticks or steers:
        return NONE_RESTS
    if not spec.timing.demands_all or ticks + spec.steps > MOST_STEPS:
        return NONE_RESTS
    wanted = ticks if listening_ticks is None else max(1, listening_ticks)
    saved = SavedSteps(every)
    periods = min(saved.count(wanted), saved.count(ticks + 1) - 1)
    streams = frozenset(
        name for name, sensor in spec.streams.items() if sensor.blueprint in _WITHOUT_MEMORY
    )
    return Resting(streams, every, every * spec.step_s, ticks - periods * every)


def _own_begins(spec: EpisodeSpec, least: int) -> Dict[str, int]:
    """``Resting.own``; no sensor begins before ``least``."""
    begins = {}
    for name, sensor in spec.streams.items():
        # Where that is no whole number, it measures in the step after it is due.
        steps = float(sensor.attributes.get("sensor_tick", "0")) / spec.step_s
        if steps > 1.0 + _SLACK:
            times = int((spec.warmup_ticks - least) / steps + _SLACK)
            begins[name] = spec.warmup_ticks - ceil(times * steps - _SLACK)
    return begins
