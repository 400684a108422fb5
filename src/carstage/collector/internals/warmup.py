"""The ticks before the recorded ones: traffic gets going, exposure settles, streams come up."""

from __future__ import annotations

import logging
import time
from typing import Callable, Mapping, Optional, Tuple

from carstage.collector.internals.errors import RecordingError
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
        scene: what is stepped; it knows which sensors do not measure in every tick.
        pipeline: where the sensors deliver; it is started here.
        episode: its number of ticks and its sensors.
        listening_ticks: how many of the ticks sensors are listened to in; None: all.
        events: gets the progress.
        stop: asked between ticks.
        patience_s: how long recorded frames are waited for.
        clock_s: monotonic time.

    Raises:
        RecordingError: sensors that rest did not begin in the tick from which they count.
    """
    spec = episode.spec
    ticks = spec.warmup_ticks
    begin_listening = 0 if listening_ticks is None else max(0, ticks - listening_ticks)
    own_timelines = not spec.timing.sensor_sync
    frame = 0
    left_s = WAIT_S
    resting = scene.resting
    aside = {*resting.streams, *resting.own}
    # Of those that are not listened to yet nothing is waited for.
    later = dict.fromkeys(resting.own, -1)
    measured = dict.fromkeys(resting.streams, -1)
    for number in range(ticks + 1):
        stop.check()
        pipeline.check()
        if number == begin_listening:
            scene.listen(pipeline.callback, lambda stream: stream not in aside)
        if number == resting.begin and resting.streams:
            scene.listen(pipeline.callback, resting.streams.__contains__)
        due = {name for name in later if resting.own[name] == number}
        if due:
            scene.listen(pipeline.callback, due.__contains__)
            later = {name: -1 for name in later if name not in due}
        if number == ticks:
            break
        frame = scene.step(None).frame
        if resting.measure_in(number):
            measured = dict.fromkeys(resting.streams, frame)
        events.warm_up(episode.episode_id, tick=number, ticks=ticks)
        if number >= begin_listening:
            begin_s = clock_s()
            if own_timelines:
                # A sensor need not measure now: any data show its stream.
                lacking = pipeline.wait_delivered(0, left_s, later)
                left_s = max(0.0, left_s - (clock_s() - begin_s))
            else:
                timeout_s = max(WAIT_S, patience_s) if number == ticks - 1 else WAIT_S
                lacking = _await_frame(pipeline, stop, frame, timeout_s, measured)
            if lacking:
                _log.info("warm-up frame %d: nothing yet from %s", frame, ", ".join(lacking))
    _require_in_step(pipeline, measured)
    pipeline.begin(frame)


def _require_in_step(pipeline: Pipeline, measured: Mapping[str, int]) -> None:
    for name, expected in measured.items():
        if pipeline.newest(name) != expected:
            raise RecordingError(
                "%s began to measure in another step than it was to." % name,
                "The machine is too busy; a retry starts anew.",
            )


def _await_frame(
    pipeline: Pipeline,
    stop: StopRequest,
    frame: int,
    timeout_s: float,
    measured: Mapping[str, int],
) -> Tuple[str, ...]:
    """The sensors that have not delivered a frame in time; ends early if somebody asks to.

    Of those in ``measured`` it is another frame.
    """
    left_s = timeout_s
    while True:
        lacking = pipeline.wait_delivered(frame, min(WAIT_S, left_s), measured)
        left_s -= WAIT_S
        if not lacking or left_s <= 0.0:
            return lacking
        stop.check()
        pipeline.check()
