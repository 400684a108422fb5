"""A wakeup wakes who waits for it, and no longer once it is silenced."""

from __future__ import annotations

import selectors
import threading

from carstage.runs.wakeup_pipe import WakeupPipe


def test_ring_of_another_thread_is_heard_until_it_is_silenced() -> None:
    with WakeupPipe() as wakeup, selectors.DefaultSelector() as selector:
        selector.register(wakeup, selectors.EVENT_READ)
        assert not selector.select(0)
        wakeup.clear()
        thread = threading.Thread(target=wakeup.notify)
        thread.start()
        assert selector.select(10)
        thread.join()
        wakeup.notify()
        wakeup.clear()
        assert not selector.select(0)
