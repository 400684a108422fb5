"""A campaign has enough when its quotas are met by what is committed, by whomever."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from carstage.config import Config, check_config
from carstage.runs.enough import LOOK_S, QuotaWatch
from carstage.runs.events import EpisodeCommitted, Notice, RunEvent
from carstage.storage import CommitMarker

QUOTAS = [{"name": "any", "frames": 6}]


class Committed:
    """A store, as far as it tells what is committed; counts how often it is asked."""

    root = Path("/")

    def __init__(self) -> None:
        self.ids: list[str] = []
        self.asked = 0

    def committed(self) -> dict[str, CommitMarker]:
        self.asked += 1
        return {one: CommitMarker(one, "a1", 3, (), {}) for one in self.ids}


def config(*quotas: dict[str, Any]) -> Config:
    return check_config({"campaign": {"quotas": list(quotas)}})


@pytest.fixture(autouse=True)
def _every_frame_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "carstage.dataset.quotas.frames_where", lambda episode, where: np.ones(episode.frames, bool)
    )


def watch(store: Committed, now: list[float], *quotas: dict[str, Any]) -> QuotaWatch:
    planned = ("a", "b", "c")
    return QuotaWatch(config(*quotas), store, planned, lambda: now[0])  # type: ignore[arg-type]


def test_without_quotas_nobody_is_asked() -> None:
    store = Committed()
    watched = watch(store, [0.0])
    heard: list[RunEvent] = []
    assert not watched.met()
    assert watched.listening(heard.append) == heard.append
    assert watched.listening(None) is None
    assert store.asked == 0


def test_episodes_of_the_plan_count_once() -> None:
    store = Committed()
    store.ids = ["a", "of another configuration"]
    watched = watch(store, [0.0], *QUOTAS)
    assert not watched.met()
    store.ids.append("b")
    listen = watched.listening(None)
    assert listen is not None
    listen(EpisodeCommitted("b", "a1"))
    assert watched.met()


def test_others_are_looked_for_now_and_then() -> None:
    store, now = Committed(), [0.0]
    store.ids = ["a"]
    watched = watch(store, now, *QUOTAS)
    assert not watched.met()
    store.ids.append("c")
    assert not watched.met()
    assert store.asked == 1
    now[0] = LOOK_S
    assert watched.met()
    assert store.asked == 2


def test_whoever_hears_of_a_run_hears_everything() -> None:
    watched = watch(Committed(), [0.0], *QUOTAS)
    heard: list[RunEvent] = []
    listen = watched.listening(heard.append)
    assert listen is not None
    for event in (Notice("hello"), EpisodeCommitted("a", "a1")):
        listen(event)
    assert [type(event) for event in heard] == [Notice, EpisodeCommitted]
