"""What each worker gets of a machine."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import pytest

from carstage.config import Config, check_config, dump_config
from carstage.errors import BadInputError
from carstage.runs.allotment import (
    Machine,
    check_ports,
    config_of_worker,
    number_of_workers,
    parse_workers,
)
from carstage.server import allot_ports

GB = 1_000_000_000


def configured(**server: Any) -> Config:
    return check_config({"server": server} if server else {})


def of_worker(config: Config, number: int, count: int, machine: Machine) -> dict[str, Any]:
    return dump_config(config_of_worker(config, number, count, machine))


def test_auto_is_a_worker_for_each_core_as_far_as_the_memory_lasts() -> None:
    assert number_of_workers(configured(), "auto", Machine(8, 64 * GB)) == 8
    assert number_of_workers(configured(), "auto", Machine(8, 4 * GB)) == 2
    assert number_of_workers(configured(), "auto", Machine(8, GB)) == 1


def test_auto_is_a_worker_for_each_graphics_card_with_carla() -> None:
    config = configured(kind="carla", path="/carla")
    assert number_of_workers(config, "auto", Machine(64, 500 * GB, 4)) == 4
    assert number_of_workers(config, "auto", Machine(64, 500 * GB, 0)) == 1
    assert number_of_workers(config, "auto", Machine(64, 17 * GB, 4)) == 2


def test_a_server_that_runs_already_has_one_worker() -> None:
    config = configured(kind="remote", host="127.0.0.1", port=2000)
    assert number_of_workers(config, "auto") == 1
    assert number_of_workers(config, 1) == 1
    with pytest.raises(BadInputError, match="a server each"):
        number_of_workers(config, 2)


@pytest.mark.parametrize("text", ["", "0", "-1", "257", "1.5", "AUTO", "²"])
def test_what_is_no_number_of_workers_is_refused(text: str) -> None:
    with pytest.raises(BadInputError, match="is not a number of workers"):
        parse_workers(text)


def test_a_number_of_workers_is_read() -> None:
    assert parse_workers("12") == 12
    assert parse_workers("auto") == "auto"


def test_workers_share_cores_between_simulators_and_converters() -> None:
    own = of_worker(configured(), 2, 4, Machine(16, 64 * GB))
    assert own["server"]["threads"] == 4
    assert own["conversion"]["workers"] == 4
    assert own["server"]["port"] == "auto"
    crowded = of_worker(configured(), 2, 4, Machine(2, 64 * GB))
    assert crowded["server"]["threads"] == crowded["conversion"]["workers"] == 1


def test_what_the_user_has_set_stays() -> None:
    config = check_config({"server": {"threads": 3}, "conversion": {"workers": 5}})
    own = of_worker(config, 1, 2, Machine(16, 64 * GB))
    assert own["server"]["threads"] == 3
    assert own["conversion"]["workers"] == 5


def test_fixed_ports_move_on_by_a_block_for_each_worker() -> None:
    for number, port in ((1, 4000), (2, 4003), (3, 4006)):
        own = of_worker(configured(port=4000), number, 3, Machine(4, 64 * GB))
        assert own["server"]["port"] == port


def test_workers_with_carla_get_one_graphics_card_after_the_other() -> None:
    config = configured(kind="carla", path="/carla")
    machine = Machine(16, 64 * GB, 2)
    for number, card in ((1, 0), (2, 1), (3, 0)):
        own = of_worker(config, number, 3, machine)
        assert own["server"]["arguments"] == ["-RenderOffScreen", f"-graphicsadapter={card}"]


def test_a_graphics_card_that_the_user_names_stays() -> None:
    config = configured(kind="carla", path="/carla", arguments=["-graphicsadapter=1"])
    own = of_worker(config, 1, 2, Machine(16, 64 * GB, 2))
    assert own["server"]["arguments"] == ["-graphicsadapter=1"]


def test_a_single_graphics_card_is_not_named() -> None:
    own = of_worker(configured(kind="carla", path="/carla"), 1, 2, Machine(16, 64 * GB, 1))
    assert own["server"]["arguments"] == ["-RenderOffScreen"]


def test_a_taken_port_of_any_worker_is_refused() -> None:
    first = allot_ports().rpc
    with socket.create_server(("127.0.0.1", first + 4)):
        check_ports(configured(port=first), 1)
        with pytest.raises(BadInputError, match=f"port {first + 4} on"):
            check_ports(configured(port=first), 2)


def test_a_container_has_the_cores_and_memory_that_it_may_use(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("carstage.runs.allotment._CGROUP", tmp_path)
    unlimited = Machine.here()
    (tmp_path / "cpu.max").write_text("100000 100000\n")
    (tmp_path / "memory.max").write_text("3000000000\n")
    (tmp_path / "memory.current").write_text("1000000000\n")
    limited = Machine.here()
    assert limited.cores == 1
    assert limited.memory_bytes == min(2 * GB, limited.memory_bytes)
    (tmp_path / "cpu.max").write_text("max 100000\n")
    (tmp_path / "memory.max").write_text("max\n")
    assert Machine.here().cores == unlimited.cores
