"""Events are whole lines; ticks are throttled; a reader that is gone ends the recording."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest

from carstage.collector.internals.errors import InterruptedByRequestError
from carstage.collector.internals.events import EventStream
from carstage.collector.internals.stopping import StopRequest


def test_each_event_is_one_line_with_time_and_name(tmp_path: Path) -> None:
    with (tmp_path / "events").open("wb") as file:
        events = EventStream(file.fileno(), StopRequest(), wall_clock_s=lambda: 12.5)
        events.emit("connected", map="Stage01\n", server_version="0.9.16")
        events.emit("collector_finished", exit_code=0)
    first, second = (tmp_path / "events").read_text().splitlines()
    expected = {"time": 12.5, "event": "connected", "map": "Stage01\n", "server_version": "0.9.16"}
    assert json.loads(first) == expected
    assert json.loads(second)["exit_code"] == 0


def test_ticks_are_told_ten_times_a_second_and_the_last_one_always(tmp_path: Path) -> None:
    now_s = 0.0
    with (tmp_path / "events").open("wb") as file:
        events = EventStream(file.fileno(), StopRequest(), clock_s=lambda: now_s)
        for tick in range(100):
            now_s = tick * 0.03125
            events.tick("id", tick == 99, tick=tick, k=tick, frame=tick + 7)
    told = [json.loads(line)["tick"] for line in (tmp_path / "events").read_text().splitlines()]
    assert told == [*range(0, 100, 4), 99]


def test_ticks_of_the_warm_up_are_told_once_a_second(tmp_path: Path) -> None:
    now_s = 0.0
    with (tmp_path / "events").open("wb") as file:
        events = EventStream(file.fileno(), StopRequest(), clock_s=lambda: now_s)
        for tick in range(10):
            now_s = tick * 0.25
            events.warm_up("id", tick=tick, ticks=10)
    told = [json.loads(line)["tick"] for line in (tmp_path / "events").read_text().splitlines()]
    assert told == [0, 4, 8]


def test_a_reader_that_is_gone_is_a_request_to_end() -> None:
    reading, writing = os.pipe()
    stop = StopRequest()
    events = EventStream(writing, stop)
    os.close(reading)
    events.emit("tick")
    assert stop.requested
    events.emit("tick")  # and no more complaints
    os.close(writing)
    with pytest.raises(InterruptedByRequestError, match="nobody reads its events"):
        stop.check()


def test_input_that_closes_is_a_request_to_end() -> None:
    reading, writing = os.pipe()
    stop = StopRequest()
    thread = stop.on_closed_input(reading)
    os.write(writing, b"ignored")
    assert not stop.wait(0.05)
    os.close(writing)
    thread.join(20.0)
    os.close(reading)
    with pytest.raises(InterruptedByRequestError, match="standard input closed"):
        stop.check()


def test_the_first_reason_to_end_stays() -> None:
    stop = StopRequest()
    stop.request("first")
    stop.request("second")
    with pytest.raises(InterruptedByRequestError, match="first"):
        stop.check()


def test_no_module_that_needs_no_carla_imports_it() -> None:
    inner = ["plan", "events", "matching", "writing"]
    names = [*(f"internals.{name}" for name in inner), "processing", "paths", "timing", "sensors"]
    code = "import sys\n" + "".join(f"import carstage.collector.{name}\n" for name in names)
    code += "sys.exit('carla' in sys.modules or 'numpy' in sys.modules)"
    assert os.spawnv(os.P_WAIT, sys.executable, [sys.executable, "-c", code]) == 0
