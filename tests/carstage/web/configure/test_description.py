"""What pages ask first is asked before they do."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from typing import Any

import pytest

from carstage.cache import CACHE_VARIABLE
from carstage.web.configure.description import DescriptionService

CAR = "vehicle.tesla.model3"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """The questions that reach the simulator."""
    questions: list[tuple[str, str]] = []

    def ask(option: str, name: str) -> dict[str, Any]:
        questions.append((option, name))
        return {"name": name}

    monkeypatch.setattr("carstage.server.ask_embedded", ask)
    return questions


def test_after_warming_pages_find_car_and_lanes_answered(asked: list[tuple[str, str]]) -> None:
    service = DescriptionService()
    service.warm(CAR, threading.Event())
    maps = [entry.name for entry in service.message().maps]
    assert asked == [("--vehicle", CAR), *(("--lanes", name) for name in maps)]
    assert service.vehicle(CAR) == {"name": CAR}
    assert service.lanes(f"Carla/Maps/{maps[0]}") == {"name": maps[0]}
    assert len(asked) == 1 + len(maps), "nothing is asked twice"


def test_warming_leaves_out_another_servers_car_and_ends_with_the_server(
    asked: list[tuple[str, str]],
) -> None:
    closing = threading.Event()
    closing.set()
    DescriptionService().warm("vehicle.of.another.server", closing)
    assert asked == []


def test_a_simulator_that_cannot_be_started_is_told_and_pages_may_ask_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """As where no process is left, or where another thread changes the environment meanwhile."""
    service = DescriptionService()
    name = service.message().maps[0].name
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    with monkeypatch.context() as patch:
        patch.setattr(sys, "executable", str(tmp_path / "gone"))
        service.warm("vehicle.of.another.server", threading.Event())
    assert "cannot be started" in caplog.text
    assert service.lanes(name) is not None


def test_one_slow_answer_holds_up_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    lanes_come = threading.Event()

    def ask(option: str, name: str) -> dict[str, Any]:
        if option == "--lanes":
            assert lanes_come.wait(60)
        return {"name": name}

    monkeypatch.setattr("carstage.server.ask_embedded", ask)
    service = DescriptionService()
    first = service.message().maps[0].name
    waiting = threading.Thread(target=service.lanes, args=(first,))
    waiting.start()
    try:
        assert service.vehicle(CAR) == {"name": CAR}
    finally:
        lanes_come.set()
        waiting.join()
