"""How CARLA's programs are run and judged; the programs here are small ones of our own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from benchmarks.simulator.programs.catalogue import (
    PROGRAMS,
    Program,
    SmokeModule,
    smoke_module,
    towns_of,
)
from benchmarks.simulator.programs.check import check_programs
from benchmarks.simulator.programs.running import (
    judge,
    lacking,
    last_exception,
    started,
    too_few,
)
from benchmarks.simulator.programs.smoke import outcomes_of
from carstage.errors import BadInputError
from small_maps import parking_street
from waiting import await_that

ROOT = Path(__file__).parents[3]
TRACEBACK = 'Traceback (most recent call last):\n  File "a.py", line 1, in <module>\n'
INTERRUPTED = TRACEBACK + "KeyboardInterrupt\n"


@pytest.mark.parametrize(
    ("status", "text", "interrupted", "wrong"),
    [
        (0, "done", False, ""),
        (0, TRACEBACK + "ValueError: a callback raised", False, "ValueError: a callback raised"),
        (1, TRACEBACK + "carla.TimeoutException: late", False, "carla.TimeoutException: late"),
        (3, "no such map", False, "exit status 3: no such map"),
        (-signal.SIGSEGV, "", False, "exit status -11"),
        (-signal.SIGABRT, "terminate called without an active exception", False, ""),
        (-signal.SIGABRT, "terminate called after throwing", True, "exit status -6: terminate"),
        (1, INTERRUPTED, True, ""),
        (1, INTERRUPTED, False, "KeyboardInterrupt"),
        (-signal.SIGINT, "", True, ""),
        (-signal.SIGKILL, "", True, "exit status -9"),
    ],
)
def test_the_way_a_program_ended_is_judged(
    status: int, text: str, interrupted: bool, wrong: str
) -> None:
    found = judge(status, text, interrupted=interrupted)
    assert found.startswith(wrong)
    assert bool(found) is bool(wrong)


def test_the_last_of_several_exceptions_counts() -> None:
    text = TRACEBACK + "ValueError: one\n\nDuring handling...\n" + TRACEBACK + "queue.Empty\n"
    assert last_exception(text) == "queue.Empty"
    assert last_exception("all is well") == ""


def test_what_is_missing_is_told_from_what_fails() -> None:
    missing = "ModuleNotFoundError: No module named 'open3d.visualization'"
    assert lacking(missing) == "needs the package open3d"
    newer = "AttributeError: module 'carla' has no attribute 'GeoEllipsoid'"
    assert lacking(newer) == "needs a newer client, with carla.GeoEllipsoid"
    arguments = "Boost.Python.ArgumentError: Python argument types in"
    assert lacking(arguments).startswith("needs a newer client")
    assert lacking("AttributeError: 'Vehicle' object has no attribute 'fly'") == ""


def test_too_few_actors_are_named() -> None:
    types = ["vehicle.audi.tt", "sensor.camera.rgb", "sensor.other.imu"]
    assert too_few((("vehicle.*", 1), ("sensor.*", 2)), types) == ""
    assert "2 actors of sensor.*" in too_few((("vehicle.*", 1), ("sensor.*", 3)), types)


def test_a_case_that_did_not_end_has_failed() -> None:
    ended = {"case": "a", "result": "passed", "reason": "", "seconds": 1.0}
    newer = "AttributeError: module 'carla' has no attribute 'GeoEllipsoid'"
    lacks = {"case": "c", "result": "failed", "reason": newer, "seconds": 1.0}
    rows = [{"case": "a", "began": True}, ended, {"case": "b", "began": True}, lacks]
    found = {outcome.name: (outcome.result, outcome.reason) for outcome in outcomes_of(rows, "")}
    assert found["a"] == ("passed", "")
    assert found["b"] == ("failed", "its process ended")
    assert found["c"] == ("not run", "needs a newer client, with carla.GeoEllipsoid")
    late = outcomes_of(rows[:1], "did not end within 9 s")
    assert [(outcome.result, outcome.reason) for outcome in late] == [
        ("failed", "did not end within 9 s")
    ]


def test_the_catalogue_runs_each_program_once_with_the_same_arguments() -> None:
    names = [program.name for program in PROGRAMS]
    assert len(set(names)) == len(names)
    paths = {program.path for program in PROGRAMS}
    assert {program.with_server_of for program in PROGRAMS} <= paths | {""}
    assert all(not program.lacks or not program.arguments for program in PROGRAMS)


def test_towns_are_those_that_are_driven_in() -> None:
    driven = Program("util/a.py", towns=("Town05",))
    assert towns_of([driven], []) == ("Town05",)
    assert towns_of([], [smoke_module("test_sync")]) == ("Town03",)
    assert towns_of([], [SmokeModule("test_wall", lacks="a wall")]) == ()


def test_a_folder_without_programs_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match="--folder"):
        check_programs(tmp_path)


def test_a_program_gets_ctrl_c_where_its_parent_ignores_it(tmp_path: Path) -> None:
    """As in a background job of a shell."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        waits = "import signal; print(signal.getsignal(signal.SIGINT) is signal.SIG_IGN)"
        with (tmp_path / "output").open("w+b") as output:
            started([sys.executable, "-c", waits], tmp_path, {}, output).wait(60)
            output.seek(0)
            assert output.read().split() == [b"False"]
    finally:
        signal.signal(signal.SIGINT, before)


GALLERY = """
import carla, sys
client = carla.Client("localhost", 2000)
client.set_timeout(20.0)
world = client.get_world()
blueprint = world.get_blueprint_library().find("vehicle.audi.tt")
car = world.spawn_actor(blueprint, world.get_map().get_spawn_points()[0])
try:
    while True:
        world.wait_for_tick()
finally:
    car.destroy()
"""
TUTORIAL = """
import carla
carla.Client("localhost", 2000).load_world("Nowhere")
"""
SMOKE = """
import unittest
import carla

class TestWorld(unittest.TestCase):
    def test_the_map(self):
        client = carla.Client("localhost", 3654)
        client.set_timeout(20.0)
        self.assertEqual(client.get_world().get_map().name.split("/")[-1], "Town03")

    def test_wrong(self):
        self.fail("this is wrong")
"""


@pytest.mark.end_to_end
@pytest.mark.timeout(900)  # four servers, one after the other
@pytest.mark.xdist_group("embedded_server")
def test_programs_of_a_folder_are_run_as_they_are(tmp_path: Path) -> None:
    folder = tmp_path / "PythonAPI"
    for path, text in {
        "examples/vehicle_gallery.py": GALLERY,
        "examples/tutorial.py": TUTORIAL,
        "test/smoke/__init__.py": "",
        "test/smoke/test_world.py": SMOKE,
    }.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    maps = tmp_path / "maps"
    maps.mkdir()
    (maps / "Town03.xodr").write_text(parking_street())
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    command = [sys.executable, "-m", "benchmarks", "programs", "--folder", str(folder)]
    done = subprocess.run(
        [*command, "--maps", str(maps), "--seconds", "4", "--json"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1, done.stderr
    record = json.loads(done.stdout.splitlines()[-1])
    found = {row["name"].rpartition(".")[2]: row for row in record["programs"]}
    results = {name: (row["result"], row["reason"]) for name, row in found.items()}
    assert results["test_the_map"] == ("passed", "")
    assert results["test_wrong"] == ("failed", "AssertionError: this is wrong")
    programs = {row["name"]: row for row in record["programs"] if row["name"].endswith(".py")}
    assert programs["examples/vehicle_gallery.py"]["reason"] == "until interrupted"
    assert programs["examples/tutorial.py"]["result"] == "failed"
    assert programs["examples/tutorial.py"]["reason"] == "RuntimeError: map not found"
    assert {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()} == before


@pytest.mark.end_to_end
@pytest.mark.timeout(300)
@pytest.mark.xdist_group("embedded_server")
def test_what_was_begun_ends_with_a_benchmark_that_is_terminated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, temporary = tmp_path / "PythonAPI", tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    begun = tmp_path / "begun"
    (folder / "examples").mkdir(parents=True)
    text = f"import time\nopen({str(begun)!r}, 'w').close()\ntime.sleep(600)\n"
    (folder / "examples" / "vehicle_gallery.py").write_text(text)
    command = [sys.executable, "-m", "benchmarks", "programs", "--folder", str(folder)]
    with subprocess.Popen([*command, "--seconds", "600"], cwd=ROOT) as process:
        try:
            await_that(begun.exists, within_s=120.0)
            family = psutil.Process(process.pid).children(recursive=True)
            assert any("carstage_sim" in child.cmdline() for child in family)
            process.terminate()
            assert process.wait(60) == 128 + signal.SIGTERM
            _, alive = psutil.wait_procs(family, timeout=10)
        finally:
            process.kill()
    assert not alive
    assert not list(temporary.iterdir())
