"""The tests of the Ray executor, run by ``test_ray_executor.py``: they need a network of their own.

A cluster of two nodes on this machine, each with one core and so one worker.
"""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest
from ray.cluster_utils import Cluster

import carstage
from carstage.errors import BadInputError
from carstage.execution import Executor
from carstage.execution.ray_slots import RayExecutor
from carstage.runs import events
from carstage.testing.executor import ExecutorTests
from driving import SMALL, attempts, differing, hashes

pytestmark = pytest.mark.filterwarnings("default")  # Ray's own


def test_nothing_but_loopback_can_be_reached() -> None:
    assert [name for _, name in socket.if_nameindex() if name != "lo"] in ([], ["sit0", "tunl0"])
    with pytest.raises(OSError, match="unreachable"):
        socket.create_connection(("192.0.2.1", 80), timeout=5.0)


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    node = {"num_cpus": 1, "include_dashboard": False, "resources": {"simulator": 1}}
    made = Cluster(initialize_head=True, head_node_args={**node, "resources": {"head": 1}})
    made.add_node(num_cpus=1, resources={"simulator": 1})
    yield made
    made.shutdown()


class TestRay(ExecutorTests):
    @pytest.fixture(autouse=True)
    def of_cluster(self, cluster: Cluster) -> None:
        self.cluster = cluster

    def executor(self, workers: int) -> Executor:
        return RayExecutor(workers, self.cluster.address)


def test_workers_are_as_many_as_the_nodes_have_room_for(cluster: Cluster) -> None:
    executor = RayExecutor(None, cluster.address)
    with executor.opened():
        assert executor.count == 2


def test_what_no_node_has_is_refused(cluster: Cluster) -> None:
    executor = RayExecutor(None, cluster.address, {"CPU": 1, "unicorn": 1})
    with pytest.raises(BadInputError, match="No node of the Ray cluster has"), executor.opened():
        pass


def test_no_cluster_is_refused() -> None:
    executor = RayExecutor(1, "127.0.0.1:1")
    with pytest.raises(BadInputError, match="no Ray cluster at"), executor.opened():
        pass


def test_episodes_of_a_lost_node_are_recorded_by_another(cluster: Cluster, tmp_path: Path) -> None:
    config = tmp_path / "three.yaml"
    config.write_text(SMALL.replace("duration_s: 2", "duration_s: 1\nepisodes: 3"))
    third = cluster.add_node(num_cpus=1, resources={"simulator": 1})
    lost: list[Any] = []
    on_third = str(third.node_id)

    def on_event(event: events.RunEvent) -> None:
        if isinstance(event, events.EpisodeStarted) and not lost:
            lost.append(on_third)
            cluster.remove_node(third, allow_graceful=False)

    executor = RayExecutor(2, cluster.address, {"CPU": 1, "simulator": 1})
    result = carstage.run(config, tmp_path / "ray", on_event, executor=executor)
    assert (result.state, result.committed, result.frames) == ("done", 3, 30)
    assert lost
    carstage.run(config, tmp_path / "inline")
    assert differing(tmp_path / "ray", tmp_path / "inline") == []
    assert [name.split("/")[0] for name in attempts(tmp_path / "ray")] == sorted(
        hashes(tmp_path / "ray")
    )
    told = events.read_events(result.folder)
    assert any(isinstance(event, events.WorkerLost) for event in told)
    lines = (result.folder / "events.jsonl").read_text().splitlines()
    pids = {json.loads(line).get("pid") for line in lines} - {None}
    left = [pid for pid in pids if psutil.pid_exists(pid)]
    assert [pid for pid in left if psutil.Process(pid).status() != psutil.STATUS_ZOMBIE] == []


def test_a_cluster_of_this_machine_ends_with_its_run(tmp_path: Path) -> None:
    executor = RayExecutor(None, "local")
    with executor.opened():
        assert executor.count >= 1
        assert not executor.in_process
