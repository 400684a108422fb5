"""``python -m carstage.server.parent_watch COMMAND...``: runs a command that must not outlive us.

CARLA's own server goes on when whoever started it is killed. This small process stands between:
when its standard input closes, because the starter is gone, it ends its whole process group.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Sequence

STOP_S = 10.0


def main(command: Sequence[str]) -> int:
    """Run ``command`` in this process group until it ends or standard input closes.

    Returns:
        The command's exit status, 128 + n when signal n ended it.
    """
    if os.getpgrp() != os.getpid():
        os.setpgid(0, 0)  # the group that is ended holds nobody else
    # A signal to the group reaches the command by itself; this process waits for its end.
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda _number, _frame: None)
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL)
    ended = threading.Event()
    threading.Thread(target=_end_with_input, args=(ended,), daemon=True).start()
    code = child.wait()
    ended.set()
    return code if code >= 0 else 128 - code


def _end_with_input(ended: threading.Event) -> None:
    """End the group, this process included, when nobody holds the other end of standard input."""
    while os.read(sys.stdin.fileno(), 4096):
        pass
    os.killpg(0, signal.SIGTERM)
    if not ended.wait(STOP_S):
        os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
