"""How the server's process ends."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytestmark = [pytest.mark.end_to_end]

PROGRAM = """
import atexit, gc, sys
atexit.register(lambda: print("frozen", gc.get_freeze_count(), flush=True))  # comes last
from carstage_sim.__main__ import main
sys.exit(main(["--port", "0", "--streaming-port", "0", "--map", "Stage01"]))
"""


def test_it_does_not_look_for_garbage_among_all_that_was_made() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", PROGRAM], stdout=subprocess.PIPE, text=True
    ) as server:
        assert server.stdout is not None
        try:
            assert server.stdout.readline().startswith("carstage_sim ready")
            server.terminate()
            ended, _ = server.communicate(timeout=60.0)
        finally:
            server.kill()
    assert int(ended.split()[-1]) > 10_000
    assert server.returncode == 0
