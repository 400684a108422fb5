"""Reading the folder of a run while it is written."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

from carstage.runs.identity import identify
from carstage.runs.reading import EventTail, liveness


def test_lines_that_are_not_whole_wait_and_torn_ones_are_skipped(tmp_path: Path) -> None:
    path = tmp_path / "events.jsonl"
    tail = EventTail(path)
    assert tail.read() == []
    path.write_bytes(b'{"event": "a"}\n{"event": ')
    assert [event["event"] for event in tail.read()] == ["a"]
    with path.open("ab") as file:
        file.write(b'"b"}\n{"torn\n[]\n{"event": "c"}\n')
    assert [event["event"] for event in tail.read()] == ["b", "c"]
    assert tail.read() == []


def test_a_process_that_has_ended_and_is_not_reaped_is_dead() -> None:
    child = subprocess.Popen([sys.executable, "-c", ""])
    process = identify(child.pid)
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    status = {"state": "recording", **process, "heartbeat": 0.0}
    try:
        assert liveness(json.loads(json.dumps(status))) == "dead"
    finally:
        child.wait()


def test_a_living_process_with_an_old_heartbeat_is_stalled() -> None:
    status = {"state": "recording", **identify()}
    assert liveness({**status, "heartbeat": time.time()}) == "running"
    assert liveness({**status, "heartbeat": time.time() - 100}) == "stalled"
    assert liveness({**status, "state": "done", "heartbeat": 0.0}) == "ended"
