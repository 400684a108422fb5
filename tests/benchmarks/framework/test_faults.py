"""Faults are drawn by their seed alone and judged strictly; here one of each kind, every time."""

from __future__ import annotations

import json
import os
import random
import shutil
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path

import pytest

from benchmarks.framework.faults.campaign import (
    draw_faults,
    judge,
    run_campaign,
    run_io_errors,
    table,
    table_text,
)
from benchmarks.framework.faults.disks import (
    empty_disk,
    fill_disk,
    limit_files,
    slow_writes,
    small_disk,
)
from benchmarks.framework.faults.io_errors import IoError, calls_of
from benchmarks.framework.faults.kinds import FAULTS
from benchmarks.framework.faults.trial import Trial
from carstage.errors import BadInputError

SEED = 25
"""Only the faults that need one start a server of their own."""

needs_strace = pytest.mark.skipif(shutil.which("strace") is None, reason="there is no strace")


def described(count: int, seed: int) -> list[tuple[str, str, str]]:
    return [(f.name, str(f.moment), f.detail) for f in draw_faults(count, seed)]


def test_same_seed_draws_the_same_faults_however_many() -> None:
    assert described(30, 5) == described(40, 5)[:30]
    assert described(30, 5) != described(30, 6)


def test_each_kind_comes_once_before_any_comes_again() -> None:
    assert sorted(name for name, _, _ in described(len(FAULTS), 1)) == sorted(FAULTS)


def test_unknown_kind_is_refused_with_the_known_ones() -> None:
    with pytest.raises(BadInputError, match="kill_collector"):
        draw_faults(3, 0, ["kill_everything"])


@pytest.mark.parametrize(
    "wrong",
    [
        Trial(1, "kill_server", complete=True, differing=["CAM/000001.png"]),
        Trial(1, "kill_server", complete=True, invalid=["frames_missing"]),
        Trial(1, "kill_server", complete=True, missing_rows=["9 of 10"]),
        Trial(1, "kill_server", complete=True, left_behind=["4711: python"]),
        Trial(1, "kill_server", complete=True, unclear=["a traceback"]),
        Trial(1, "kill_server", resumed=False),
    ],
)
def test_anything_wrong_fails_the_campaign_and_is_told(wrong: Trial) -> None:
    fine = Trial(2, "slow_disk", struck=True, complete=True, attempts=1, wall_s=4.0)
    assert judge([fine], 1.0).ok
    verdict = judge([fine, wrong], 1.0)
    assert not verdict.ok
    assert sum(not figure.ok for figure in verdict.figures) == 1
    assert "trial 1, kill_server" in table_text([fine, wrong])
    assert [row["wrong"] for row in table([fine, wrong])] == [1, 0]


def test_campaign_without_a_trial_proves_nothing() -> None:
    assert not judge([], 0.0).ok


def test_full_disk_takes_nothing_more_until_it_is_emptied(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1_000_000) as mounted:
        if not mounted:
            pytest.skip("no file system can be mounted here")
        file = tmp_path / "disk" / "file"
        fill_disk(tmp_path / "disk", leave_bytes=0)
        with pytest.raises(OSError, match="No space left"):
            file.write_bytes(bytes(10_000))
        empty_disk(tmp_path / "disk")
        file.write_bytes(bytes(10_000))


def test_limit_of_file_sizes_stands_in_for_a_full_disk(tmp_path: Path) -> None:
    code = (
        "import sys; print(flush=True); sys.stdin.readline()\n"
        "try:\n    open(sys.argv[1], 'wb').write(bytes(10_000))\n"
        "except OSError as error:\n    print(error.strerror)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code, str(tmp_path / "file")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        limit_files(process.pid, 4096)
        said, _ = process.communicate("\n", timeout=60)
    assert said == "File too large\n"


@pytest.mark.parametrize(("module", "slow"), [("carstage.collector", True), ("other", False)])
def test_slow_disk_is_slow_for_collectors_alone(tmp_path: Path, module: str, slow: bool) -> None:
    environment = {**os.environ, **slow_writes(tmp_path / "slow", 0.01)}
    code = "import os; print(os.pwritev.__module__)"
    done = subprocess.run(
        [sys.executable, "-c", code, module],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    assert (done.stdout.strip() == "sitecustomize") is slow


@pytest.mark.end_to_end
@pytest.mark.xdist_group("faults")
@pytest.mark.timeout(900)
def test_twelve_faults_end_well(tmp_path: Path) -> None:
    verdict, trials = run_campaign(count=len(FAULTS), seed=SEED, scratch=tmp_path)
    assert verdict.ok, table_text(trials)
    assert len(trials) == 12
    assert sum(trial.struck for trial in trials) >= 8  # a fast run may be over before
    assert len((tmp_path / "trials.jsonl").read_text().splitlines()) == 12
    assert json.dumps(verdict.record())


SURVEYED = """\
7 openat(AT_FDCWD</tmp>, "/data/set/episodes/00000000000000aa/a1/.000001.png", O_WRONLY) = 9</x>
7 write(9</data/set/episodes/00000000000000aa/a1/.000001.png>, "x", 1) = 1
8 write(9</data/set/episodes/00000000000000aa/a1/.000001.png>, "x", 1) = 1
8 write(9</data/set/episodes/00000000000000aa/a1/.000001.png>, "x", 1) = 1
7 rename("/data/set/a/.b", "/data/set/a/b") = 0
7 fsync(4</data/set/commits/.one.json.0123456789abcdef>) = 0
7 fsync(4</home/file>) = 0
7 write(1<pipe:[17]>, "x", 1) = 1
7 mkdir("/data/set", 0777) = -1 ENOENT (No such file or directory)
7 unlink("/data/settings") = 0
"""


def test_calls_on_the_dataset_are_told_by_name_path_and_number(tmp_path: Path) -> None:
    log = tmp_path / "log"
    log.write_text(SURVEYED)
    picture = "episodes/00000000000000aa/a1/.000001.png"
    assert calls_of(log, Path("/data/set")) == [
        ("fsync", "", 1),
        ("fsync", "", 2),
        ("openat", picture, 1),
        ("rename", "", 1),
        ("rename", "a/.b", 1),
        ("rename", "a/b", 1),
        ("write", picture, 1),
        ("write", picture, 2),
    ]


@needs_strace
@pytest.mark.parametrize(
    ("between", "believed"),
    [
        ('unlink("/out/a.bin") = 0', False),
        ('openat(AT_FDCWD, "/out/a.bin", O_WRONLY|O_CREAT|O_TRUNC) = 3', False),
        ('openat(AT_FDCWD, "/out/a.bin", O_RDONLY) = 3', True),
    ],
)
def test_a_file_that_is_synced_again_unwritten_is_seen(
    between: str, believed: bool, tmp_path: Path
) -> None:
    fault = IoError(random.Random(1), [("fsync", "", 1), ("fsync", "a.bin", 1)])
    fault.path = "a.bin"
    fault.prepare(ExitStack(), tmp_path, (1, 2))
    (tmp_path / "strace.log").write_text(
        "7 fsync(3</out/a.bin>) = -1 EIO (Input/output error) (INJECTED)\n"
        f"7 {between}\n"
        "7 fsync(3</out/a.bin>) = 0\n"
    )
    assert fault.has_struck()
    assert bool(fault.wrong()) is believed


@pytest.mark.end_to_end
@pytest.mark.xdist_group("faults")
@pytest.mark.timeout(900)
@needs_strace
def test_six_failing_calls_end_well(tmp_path: Path) -> None:
    verdict, trials = run_io_errors(count=6, seed=SEED, scratch=tmp_path)
    assert verdict.ok, table_text(trials)
    assert sum(trial.struck for trial in trials) >= 4
