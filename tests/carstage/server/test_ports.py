"""Ports are looked at before use; a taken one is refused by name."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import pytest

from carstage.errors import BadInputError
from carstage.server import PortRange, allot_ports, check_ports_free, free_port
from carstage.server.ports import FIRST_PORT, LAST_PORT


@pytest.fixture
def taken() -> Iterator[int]:
    with socket.create_server(("127.0.0.1", free_port())) as listener:
        yield listener.getsockname()[1]


def test_a_block_is_three_ports_in_a_row_and_a_fourth_elsewhere() -> None:
    ports = allot_ports()
    assert (ports.streaming, ports.secondary) == (ports.rpc + 1, ports.rpc + 2)
    assert ports.traffic_manager not in range(ports.rpc, ports.rpc + 3)
    assert FIRST_PORT <= ports.rpc <= LAST_PORT - 2
    check_ports_free([ports.rpc, ports.streaming, ports.secondary, ports.traffic_manager])


@pytest.mark.parametrize("offset", [0, 1, 2])
def test_a_wanted_block_with_a_taken_port_is_refused(taken: int, offset: int) -> None:
    with pytest.raises(BadInputError, match=rf"server\.port: port {taken} on 127\.0\.0\.1"):
        allot_ports(taken - offset)


def test_a_wanted_block_that_is_free_is_taken_as_it_is() -> None:
    wanted = allot_ports().rpc
    assert allot_ports(wanted).rpc == wanted


def test_a_port_beyond_the_last_one_is_refused() -> None:
    with pytest.raises(BadInputError, match="65536"):
        check_ports_free([65536])


@pytest.mark.parametrize("count", [1, 2, 3, 8, 256])
def test_shares_of_the_ports_do_not_overlap(count: int) -> None:
    shares = [PortRange().share(number, count) for number in range(1, count + 1)]
    ports = [port for share in shares for port in range(share.first, share.last + 1)]
    assert len(ports) == len(set(ports))
    assert min(ports) >= FIRST_PORT
    assert max(ports) <= LAST_PORT


def test_ports_are_taken_from_a_workers_own_share() -> None:
    share = PortRange().share(2, 64)
    for _ in range(20):
        ports = allot_ports(within=share)
        for port in (ports.rpc, ports.secondary, ports.traffic_manager, free_port(within=share)):
            assert share.first <= port <= share.last


def test_more_workers_than_ranges_share_them() -> None:
    assert PortRange(20_000, 20_015).share(3, 99) == PortRange(20_000, 20_007)
