"""Short forms of the checks of robustness, and of what their figures mean."""

from __future__ import annotations

import random
from collections.abc import Iterator

import msgpack
import pytest

from benchmarks.simulator.client_process import run_trial
from benchmarks.simulator.fuzz import check_fuzz
from benchmarks.simulator.fuzz.requests import LEFT_OUT, Requests, wrong_arguments
from benchmarks.simulator.memory import FLAT, Phase, load_trial, memory_trial
from benchmarks.simulator.server_process import RunningServer, started_server
from benchmarks.simulator.streaming import DISTINCT, throughput_trial
from carstage_sim.wire.handlers import known_calls

pytestmark = pytest.mark.xdist_group("embedded_server")


@pytest.fixture(scope="module")
def looping_server() -> Iterator[RunningServer]:
    arguments = ("--map", "Stage01", "--threads", "1", "--loop", str(DISTINCT))
    with started_server(arguments) as server:
        yield server


@pytest.mark.end_to_end
def test_misbehaving_clients_harm_neither_the_server_nor_a_healthy_client() -> None:
    verdict = check_fuzz(seconds=60.0, calls=None, seed=11)
    # Seconds are for the command; here only that nobody stood still beside other tests.
    longest_s = next(f.value for f in verdict.figures if f.name == "longest_tick_s")
    assert float(longest_s) < 15.0, verdict.text()
    missed = [f.name for f in verdict.figures if not f.ok and f.name != "longest_tick_s"]
    assert not missed, verdict.text()


@pytest.mark.end_to_end
def test_prepared_pictures_reach_the_client_whole_and_in_step(
    looping_server: RunningServer,
) -> None:
    found = run_trial(
        throughput_trial,
        looping_server.port,
        looping_server.pid,
        cameras=2,
        seconds=0.5,
        paced_hz=None,
        timeout_s=200.0,
    )
    assert found.mismatched == 0
    assert found.images_per_s > 0.0
    assert found.server_cpu_per_s > 0.0


@pytest.mark.end_to_end
def test_memory_is_sampled_in_each_phase(looping_server: RunningServer) -> None:
    ticks, rigs = run_trial(
        memory_trial,
        looping_server.port,
        looping_server.pid,
        vehicles=5,
        ticks=20,
        cycles=2,
        seed=11,
        timeout_s=250.0,
    )
    loads = run_trial(load_trial, looping_server.port, looping_server.pid, loads=2, timeout_s=200.0)
    assert [len(phase.samples_mb) for phase in (ticks, rigs, loads)] == [20, 2, 2]
    assert all(50.0 < mb < 5000.0 for phase in (ticks, rigs, loads) for mb in phase.samples_mb)


def test_growth_after_the_beginning_is_a_deviation_and_before_it_is_not() -> None:
    warming_up = Phase("ticks", 100, [100.0, 150.0, *[200.0] * 19])
    assert warming_up.settled_mb == 200.0
    assert warming_up.spread == 0.0
    leaking = Phase("ticks", 100, [200.0 + 2.0 * number for number in range(21)])
    assert leaking.spread > FLAT


def test_same_seed_makes_the_same_requests_and_another_seed_others() -> None:
    def some(seed: int) -> list[bytes]:
        requests = Requests(random.Random(seed))
        return [requests.packed(*requests.mutated()) for _ in range(50)]

    assert some(1) == some(1)
    assert some(1) != some(2)


def test_every_call_is_made_and_every_request_can_be_packed() -> None:
    requests = Requests(random.Random(3), [100, 101])
    seen = set()
    for _ in range(5000):
        name, arguments = requests.mutated()
        assert msgpack.unpackb(requests.packed(name, arguments), strict_map_key=False)[2] == name
        seen.add(name)
    assert seen == known_calls() - LEFT_OUT
    assert {name for name, _ in wrong_arguments(random.Random(3))} == known_calls()
