"""The queue of the frames that another program makes."""

from __future__ import annotations

import threading
import time
from types import SimpleNamespace
from typing import Any

import pytest

from carstage.collector.internals import followed_episode
from carstage.collector.internals.followed_episode import FrameQueue

EGO = 7


class Observer:
    """Knows a light and the ego."""

    def watch_lights(self, lights: Any) -> None:
        self.lights = list(lights)

    def states(self) -> dict[str, Any]:
        return {"ego": {"id": EGO}, "traffic_lights": {}}


class World:
    def get_actors(self) -> Any:
        return SimpleNamespace(filter=lambda pattern: ["light"])


def snapshot(frame: int) -> Any:
    return SimpleNamespace(frame=frame, find=lambda actor_id: object())


class CountedCondition(threading.Condition):
    """Counts how often it was told of something."""

    told = 0

    def notify_all(self) -> None:
        self.told += 1
        super().notify_all()


def test_frames_of_a_fast_world_come_in_their_order_and_wake_nobody_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(threading, "Condition", CountedCondition)
    frames = FrameQueue(World(), Observer(), EGO)  # type: ignore[arg-type]
    for number in range(100):
        frames.on_tick(snapshot(number))
    assert 1 <= frames._changed.told < 20  # type: ignore[attr-defined]
    taken = [frames.take(1.0) for _ in range(100)]
    assert [seen.snapshot.frame for seen in taken if seen is not None] == list(range(100))
    assert frames.take(0.01) is None


def test_who_took_a_batch_waits_for_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [100.0]
    clock = SimpleNamespace(perf_counter=lambda: now_s[0])
    monkeypatch.setattr(followed_episode, "time", clock)
    frames = FrameQueue(World(), Observer(), EGO)  # type: ignore[arg-type]
    frames.on_tick(snapshot(1))
    assert frames.take(0.0) is not None
    frames.on_tick(snapshot(2))  # comes while weather and lights are asked for
    begun_s = time.monotonic()
    assert frames.take(0.05) is not None
    assert time.monotonic() - begun_s >= 0.05
    now_s[0] += 1.0
    frames.on_tick(snapshot(3))
    begun_s = time.monotonic()
    assert frames.take(60.0) is not None
    assert time.monotonic() - begun_s < 60.0


def test_a_frame_that_told_nobody_is_found_when_the_wait_is_over() -> None:
    frames = FrameQueue(World(), Observer(), EGO)  # type: ignore[arg-type]
    frames.on_tick(snapshot(1))
    assert frames.take(1.0) is not None
    late = threading.Thread(target=frames.on_tick, args=(snapshot(2),))
    late.start()
    seen = frames.take(0.1)
    late.join()
    assert seen is not None
    assert seen.snapshot.frame == 2
