"""Scripts for the real client, each run as a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

BEGIN = """
import sys
import carla
client = carla.Client("127.0.0.1", int(sys.argv[1]))
client.set_timeout(20.0)
world = client.get_world()
"""


@contextmanager
def client_process(script: str, home: Path, *arguments: object) -> Iterator[subprocess.Popen[str]]:
    """A process with the real wheel, once it has printed ``ready``; killed with the block."""
    process = subprocess.Popen(
        [sys.executable, "-c", BEGIN + script, *map(str, arguments)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env={"HOME": str(home)},
    )
    try:
        assert process.stdout is not None
        while (line := process.stdout.readline()) != "ready\n":
            assert line, "the client ended before it was ready"
        yield process
    finally:
        process.kill()
        process.communicate()
