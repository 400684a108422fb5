"""The collector as a child: what it says is heard whole, and nothing of it outlives us."""

from __future__ import annotations

import json
import os
import selectors
import stat
import sys
import venv
from pathlib import Path
from typing import Any

import psutil
import pytest

from carstage.errors import CollectorError
from carstage.execution import CollectorAhead, CollectorProcess

DEADLINE_S = 60.0


def process(tmp_path: Path, script: str) -> CollectorProcess:
    """A child that runs ``script`` (sh) in the place of the interpreter; ``$3`` is the plan."""
    python = tmp_path / "python"
    python.write_text(f"#!/bin/sh\n{script}\n")
    python.chmod(python.stat().st_mode | stat.S_IXUSR)
    return CollectorProcess(
        {"plan_version": 1},
        plan_path=tmp_path / "plan.json",
        log_path=tmp_path / "collector.log",
        python=str(python),
    )


def listen(collector: CollectorProcess) -> list[dict[str, Any]]:
    heard: list[dict[str, Any]] = []
    with selectors.DefaultSelector() as selector:
        selector.register(collector, selectors.EVENT_READ)
        while not collector.ended:
            assert selector.select(DEADLINE_S), heard
            heard += collector.read_events()
    return heard


def test_plan_is_written_and_passed(tmp_path: Path) -> None:
    with process(tmp_path, 'printf \'{"event": "%s"}\\n\' "$(cat "$3" | tr -d \'"\')"') as child:
        assert listen(child) == [{"event": "{plan_version: 1}"}]
        assert child.wait(DEADLINE_S) == 0
    assert json.loads((tmp_path / "plan.json").read_text()) == {"plan_version": 1}


def test_lines_that_come_in_pieces_are_one_event(tmp_path: Path) -> None:
    script = (
        'printf \'{"event": "a"}\\n{"eve\'; read -r _ < "$0"; '
        'printf \'nt": "b"}\\n\\n{"event": "c"}\\n\''
    )
    with process(tmp_path, script) as child:
        assert [event["event"] for event in listen(child)] == ["a", "b", "c"]


@pytest.mark.parametrize("line", ["hello", "[1]", '{"no": "event"}', '{"event": 3}', "{"])
def test_line_that_is_no_event_is_an_error(tmp_path: Path, line: str) -> None:
    with (
        process(tmp_path, f"echo '{line}'; read -r _") as child,
        pytest.raises(CollectorError, match="no event"),
    ):
        listen(child)


def test_standard_error_is_the_log_of_this_process_only(tmp_path: Path) -> None:
    (tmp_path / "collector.log").write_text("of an earlier attempt\n")
    with process(tmp_path, "echo 'it broke' >&2; exit 3") as child:
        listen(child)
        assert child.wait(DEADLINE_S) == 3
        assert child.log_tail() == "it broke"


def test_leaving_asks_it_to_end(tmp_path: Path) -> None:
    script = (
        'trap "echo ended >&2; exit 130" TERM; '
        'echo \'{"event": "up"}\'; while :; do read -r _; done'
    )
    with process(tmp_path, script) as child:
        assert wait_for_first(child) == "up"
    assert child.exit_code is not None
    assert child.log_tail() == "ended"


def test_grandchildren_go_with_it(tmp_path: Path) -> None:
    script = 'sleep 1000 & echo "{\\"event\\": \\"$!\\"}"; wait'
    with process(tmp_path, script) as child:
        pid = int(wait_for_first(child))
        assert psutil.pid_exists(pid)
        child.kill()
        assert child.wait(DEADLINE_S) == -9
    gone, alive = psutil.wait_procs([psutil.Process(pid)] if psutil.pid_exists(pid) else [], 10)
    assert not alive or all(p.status() == psutil.STATUS_ZOMBIE for p in alive), gone


def test_closed_input_tells_it_that_we_are_gone(tmp_path: Path) -> None:
    with process(tmp_path, "while read -r _; do :; done; echo 'input ended' >&2") as child:
        assert child.wait(DEADLINE_S) == 0
        assert child.log_tail() == "input ended"


def test_it_is_in_a_process_group_of_its_own(tmp_path: Path) -> None:
    with process(tmp_path, "read -r _") as child:
        assert os.getpgid(child.pid) == child.pid != os.getpgid(0)


def test_exit_code_names_the_signal(tmp_path: Path) -> None:
    with process(tmp_path, "kill -9 $$") as child:
        listen(child)
        assert child.wait(DEADLINE_S) == -9


def test_use_before_the_start_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(CollectorError, match="not started"):
        _ = process(tmp_path, "").pid


def wait_for_first(collector: CollectorProcess) -> str:
    with selectors.DefaultSelector() as selector:
        selector.register(collector, selectors.EVENT_READ)
        assert selector.select(DEADLINE_S)
        return str(collector.read_events()[0]["event"])


def test_collector_runs_in_a_python_that_lacks_carstage(tmp_path: Path) -> None:
    venv.create(tmp_path / "env", symlinks=True)
    plan = {"plan_version": 0}
    collector = CollectorProcess(
        plan,
        plan_path=tmp_path / "plan.json",
        log_path=tmp_path / "collector.log",
        python=str(tmp_path / "env" / "bin" / "python"),
    )
    with collector as child:
        refused, finished = listen(child)
        assert child.wait(DEADLINE_S) == 2
    assert refused["kind"] == "plan"
    assert finished["exit_code"] == 2


def with_one_ahead(tmp_path: Path, script: str) -> tuple[CollectorAhead, CollectorProcess]:
    """A child that runs ``script`` and waits for its plan; one that would run ``exit 9`` itself."""
    ahead = tmp_path / "ahead"  # a file of its own: sh may open its script late
    ahead.mkdir()
    process(ahead, script)
    waiting = CollectorAhead(tmp_path / "collector.log", str(ahead / "python"))
    process(tmp_path, "exit 9")
    return waiting, CollectorProcess(
        {"plan_version": 1},
        plan_path=tmp_path / "plan.json",
        log_path=tmp_path / "collector.log",
        python=str(tmp_path / "python"),
        ahead=waiting,
    )


def test_one_that_waits_takes_its_plan_from_its_input(tmp_path: Path) -> None:
    script = 'read -r plan; echo "it is here" >&2; printf \'{"event": "%s"}\\n\' "$3 ${plan##*/}"'
    waiting, collector = with_one_ahead(tmp_path, script)
    with collector as child:
        assert child.pid == waiting.process.pid
        assert listen(child) == [{"event": "- plan.json"}]
        assert child.wait(DEADLINE_S) == 0
        assert child.log_tail() == "it is here"
    assert json.loads((tmp_path / "plan.json").read_text()) == {"plan_version": 1}


def test_one_that_has_ended_without_its_plan_is_replaced(tmp_path: Path) -> None:
    waiting, collector = with_one_ahead(tmp_path, "exit 3")
    waiting.process.wait(DEADLINE_S)
    with collector as child:
        assert child.wait(DEADLINE_S) == 9


def test_a_plan_whose_path_has_several_lines_is_read(tmp_path: Path) -> None:
    folder = tmp_path / "two\nlines"
    folder.mkdir()
    collector = CollectorProcess(
        {"plan_version": 0},
        plan_path=folder / "plan.json",
        log_path=tmp_path / "collector.log",
        ahead=CollectorAhead(tmp_path / "collector.log", sys.executable),
    )
    with collector as child:
        refused = listen(child)[0]
        assert child.wait(DEADLINE_S) == 2
    assert "plan_version" in refused["message"]


def test_one_that_gets_no_plan_is_ended(tmp_path: Path) -> None:
    waiting, _ = with_one_ahead(tmp_path, "read -r plan")
    waiting.end()
    assert waiting.process.returncode == -9


def test_the_collector_loads_its_client_and_waits_for_its_plan(tmp_path: Path) -> None:
    waiting = CollectorAhead(tmp_path / "collector.log", sys.executable)
    collector = CollectorProcess(
        {"plan_version": 0},
        plan_path=tmp_path / "plan.json",
        log_path=tmp_path / "collector.log",
        ahead=waiting,
    )
    with collector as child:
        assert child.pid == waiting.process.pid
        refused, finished = listen(child)
        assert child.wait(DEADLINE_S) == 2
    assert refused["kind"] == "plan"
    assert finished["exit_code"] == 2


def test_a_waiting_collector_ends_with_its_input(tmp_path: Path) -> None:
    waiting = CollectorAhead(tmp_path / "collector.log", sys.executable)
    assert waiting.process.stdin is not None
    waiting.process.stdin.close()
    assert waiting.process.wait(DEADLINE_S) == 0
    waiting.end()
