"""A bell wakes who waits for it, and no longer once it is silenced."""

from __future__ import annotations

import selectors
import threading

from carstage.runs.bell import Bell


def test_ring_of_another_thread_is_heard_until_it_is_silenced() -> None:
    with Bell() as bell, selectors.DefaultSelector() as selector:
        selector.register(bell, selectors.EVENT_READ)
        assert not selector.select(0)
        bell.silence()
        thread = threading.Thread(target=bell.ring)
        thread.start()
        assert selector.select(10)
        thread.join()
        bell.ring()
        bell.silence()
        assert not selector.select(0)
