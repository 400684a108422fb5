"""What every server must do, as tests: derive from :class:`ServerTests` and say how one is made."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from importlib.util import find_spec

import psutil
import pytest

from carstage.errors import ServerError
from carstage.plan import ServerFacts
from carstage.server import Server


class ServerTests(ABC):
    """The rules of every :class:`Server` that starts a process."""

    @abstractmethod
    def make(self) -> Server:
        """A server that is not started."""

    @pytest.fixture
    def server(self) -> Iterator[Server]:
        """One that is started; it is killed at the end."""
        server = self.make()
        try:
            server.start()
            yield server
        finally:
            server.kill()

    def test_one_that_is_not_started_has_no_place(self) -> None:
        server = self.make()
        assert not server.alive()
        with pytest.raises(ServerError):
            _ = server.endpoint
        with pytest.raises(ServerError):
            server.probe()
        server.stop()

    def test_it_answers_as_soon_as_it_is_started(self, server: Server) -> None:
        assert server.alive()
        assert server.probe()
        assert 0 < server.endpoint.port < 65536
        assert server.endpoint.pid is not None
        assert psutil.pid_exists(server.endpoint.pid)

    def test_it_offers_a_map_with_a_spawn_point(self, server: Server) -> None:
        facts = server.facts()
        assert isinstance(facts, ServerFacts)
        assert any(count > 0 for count in facts.maps.values())

    def test_stopping_ends_it_and_may_be_repeated(self, server: Server) -> None:
        pid = server.endpoint.pid
        server.stop()
        assert not server.alive()
        assert pid is not None
        assert not psutil.pid_exists(pid)
        with pytest.raises(ServerError):
            server.probe()
        server.stop()
        server.kill()

    def test_one_that_was_killed_is_silent_and_starts_again(self, server: Server) -> None:
        server.kill()
        assert not server.alive()
        with pytest.raises(ServerError):
            server.probe()
        server.start()
        assert server.probe()

    def test_its_collector_is_a_module(self) -> None:
        assert find_spec(self.make().collector) is not None
