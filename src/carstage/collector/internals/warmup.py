"""The ticks before the recorded ones: traffic gets going, exposure settles, streams come up."""

from __future__ import annotations

import logging
import time
from typing import Callable, Optional, Tuple

from carstage.collector.internals.events import EventStream
from carstage.collector.internals.plan import EpisodePlan
from carstage.collector.internals.scene import Scene
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.processing import Pipeline

WAIT_S = 2.0
"""How long the sensors' first data are waited for: in each tick but the last, or, where sensors
have timelines of their own, in all ticks together."""

_log = logging.getLogger(__name__)


def warm_up(
    scene: Scene,
    pipeline: Pipeline,
    episode: EpisodePlan,
    listening_ticks: Optional[int],
    events: EventStream,
    stop: StopRequest,
    patience_s: float = WAIT_S,
    clock_s: Callable[[], float] = time.monotonic,
) -> None:
    """Make the ticks of the warm-up, the last ones with all sensors listening.

    The number of ticks never depends on what arrives when, so that every attempt begins at the
    same frame. A sensor's stream may come up a moment after ``listen``: the first data are waited
    for here, before they count. In the last tick they are waited for as long as those that count:
    what the warm-up leaves behind on a busy machine would make these late.

    Args:
        scene: what is stepped.
        pipeline: where the sensors deliver; it is started here.
        episode: its number of ticks and its sensors.
        listening_ticks: how many of the ticks sensors are listened to in; None: all.
        events: gets the progress.
        stop: asked between ticks.
        patience_s: how long recorded frames are waited for.
        clock_s: monotonic time.
    """
    spec = episode.spec
    ticks = spec.warmup_ticks
    begin_listening = 0 if listening_ticks is None else max(0, ticks - listening_ticks)
    own_timelines = not spec.timing.sensor_sync
    frame = 0
    left_s = WAIT_S
    for number in range(ticks + 1):
        stop.check()
        pipeline.check()
        if number == begin_listening:
            scene.listen(pipeline.callback)
        if number == ticks:
            break
        frame = scene.step(None).frame
        events.warm_up(episode.episode_id, tick=number, ticks=ticks)
        if number >= begin_listening:
            begin_s = clock_s()
            if own_timelines:
                # A sensor need not measure now: any data show its stream.
                lacking = pipeline.wait_delivered(0, left_s)
                left_s = max(0.0, left_s - (clock_s() - begin_s))
            else:
                timeout_s = max(WAIT_S, patience_s) if number == ticks - 1 else WAIT_S
                lacking = _await_frame(pipeline, stop, frame, timeout_s)
            if lacking:
                _log.info("warm-up frame %d: nothing yet from %s", frame, ", ".join(lacking))
    pipeline.begin(frame)


def _await_frame(
    pipeline: Pipeline, stop: StopRequest, frame: int, timeout_s: float
) -> Tuple[str, ...]:
    """The sensors that have not delivered a frame in time; ends early if somebody asks to."""
    left_s = timeout_s
    while True:
        lacking = pipeline.wait_delivered(frame, min(WAIT_S, left_s))
        left_s -= WAIT_S
        if not lacking or left_s <= 0.0:
            return lacking
        stop.check()
        pipeline.check()
