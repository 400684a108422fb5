"""What is noted of the processes of a run: theirs alone, and all of them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from carstage.runs.events import Load, event_of
from carstage.runs.load import LoadMeter
from waiting import await_that

WORK = """
import os, sys
held = bytearray(100_000_000)
with open(sys.argv[1], "wb", buffering=0) as file:
    while True:
        file.write(held[:1_000_000])
        file.seek(0)
"""


def test_a_child_that_computes_holds_and_writes_is_seen(tmp_path: Path) -> None:
    meter = LoadMeter(tmp_path)
    before = meter.sample()
    with subprocess.Popen([sys.executable, "-c", WORK, str(tmp_path / "file")]) as child:
        try:
            samples: list[Load] = []

            def seen() -> bool:
                samples.append(meter.sample())
                return samples[-1].memory_bytes > before.memory_bytes + 90_000_000

            await_that(seen)
            await_that(lambda: meter.sample().cpu_cores > 0.01)
        finally:
            child.kill()
    after = meter.sample()
    assert after.memory_bytes < samples[-1].memory_bytes - 50_000_000
    assert after.cpu_cores >= 0
    assert after.disk_free_bytes > 0


def test_a_process_that_is_gone_takes_nothing(tmp_path: Path) -> None:
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        child.wait()
    sample = LoadMeter(tmp_path, child.pid).sample()
    assert (sample.cpu_cores, sample.memory_bytes, sample.written_bytes_s) == (0, 0, None)


def test_a_line_gives_the_event_back(tmp_path: Path) -> None:
    sample = LoadMeter(tmp_path).sample()
    assert event_of(sample.to_line()) == sample
