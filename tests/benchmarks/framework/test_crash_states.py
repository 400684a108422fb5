"""Disks after a power cut: read from a log of strace, rebuilt, opened and gone on with."""

from __future__ import annotations

import random
import shutil
import sys
from pathlib import Path

import pytest

from benchmarks.framework.crash_states import measure_crash_states
from benchmarks.framework.crash_states.calls import Operation, read_log, record_calls
from benchmarks.framework.crash_states.disk import Disk, State
from carstage.errors import BadInputError

needs_strace = pytest.mark.skipif(shutil.which("strace") is None, reason="there is no strace")

_PROGRAM = """
import os, sys, threading
root = sys.argv[1]
os.mkdir(root + "/folder")
with open(root + "/folder/.a", "wb") as file:
    file.write(b"first")
    file.flush()
    os.fsync(file.fileno())
    file.seek(2)
    file.write(b"REST")
    file.flush()
    os.posix_fallocate(file.fileno(), 0, 9)
os.rename(root + "/folder/.a", root + "/folder/a")
os.link(root + "/folder/a", root + "/b")
with open(root + "/log", "ab") as one, open(root + "/log", "ab") as other:
    for number in range(3):
        (one, other)[number % 2].write(b"%d" % number)
        (one, other)[number % 2].flush()
descriptor = os.open(root + "/c", os.O_RDWR | os.O_CREAT)
os.pwritev(descriptor, [b"here", b"and there"], 3)
copy = os.dup(descriptor)
os.write(copy, b"xyz")
os.write(descriptor, b"!")
os.ftruncate(descriptor, 9)
thread = threading.Thread(target=os.fsync, args=(copy,))
thread.start(); thread.join()
os.mkdir(root + "/gone")
os.rmdir(root + "/gone")
open(root + "/d", "w").close()
os.unlink(root + "/d")
"""


@needs_strace
def test_the_operations_of_a_program_lead_to_its_files(tmp_path: Path) -> None:
    root = tmp_path / "a root with ümlauts"
    root.mkdir()
    operations = record_calls(
        [sys.executable, "-c", _PROGRAM, str(root)], root, tmp_path / "strace.log"
    )
    disk = Disk()
    for operation in operations:
        disk.apply(operation)
    there = {
        path.relative_to(root).as_posix(): None if path.is_dir() else path.read_bytes()
        for path in root.rglob("*")
    }
    assert there["c"] == b"xyz!erean"
    assert disk.state("all written", random.Random(0)) == there
    assert {"create", "write", "resize", "rename", "link", "unlink", "mkdir", "rmdir"} < {
        operation.kind for operation in operations
    }


@needs_strace
@pytest.mark.parametrize(
    "program",
    [
        "os.symlink('x', root + '/a')",
        "open(root + '/a', 'wb').close(); os.truncate(root + '/a', 3)",
        "open(root + '/a', 'wb').close(); os.rename(root + '/a', root + '/../a')",
        "f = open(root + '/a', 'w+b'); f.write(b'1'); f.flush(); mmap.mmap(f.fileno(), 1)",
        "f = open(root + '/a', 'wb'); os.sendfile(f.fileno(), os.open('/etc/passwd', 0), 0, 9)",
    ],
)
def test_what_it_cannot_follow_is_refused(program: str, tmp_path: Path) -> None:
    root = tmp_path / "root"
    root.mkdir()
    command = [sys.executable, "-c", f"import os, sys, mmap; root = sys.argv[1]; {program}"]
    with pytest.raises(BadInputError, match="The run changes files by"):
        record_calls([*command, str(root)], root, tmp_path / "strace.log")


def _hex(text: str) -> str:
    return "".join(f"\\x{byte:02x}" for byte in text.encode())


def test_a_sync_covers_what_had_ended_when_it_began() -> None:
    path = _hex("/disk/a")
    lines = [
        f'7 openat(AT_FDCWD<{_hex("/")}>, "{path}", O_WRONLY|O_CREAT, 0666) = 3<{path}>',
        f'7 write(3<{path}>, "{_hex("one")}", 3) = 3',
        f"8 fsync(3<{path}> <unfinished ...>",
        f'7 write(3<{path}>, "{_hex("two")}", 3) = 3',
        "8 <... fsync resumed>) = 0",
        f'7 write(3<{path}>, "{_hex("lost")}", 4) = -1 ENOSPC (No space left on device)',
    ]
    operations = read_log(iter(lines), Path("/disk"))
    assert [operation.kind for operation in operations] == ["create", "write", "write", "sync"]
    assert _after(operations, "data lost") == {"a": b"one"}
    assert _after(operations, "only what was synced") == {}


def _after(operations: list[Operation], variant: str, seed: int = 0) -> State:
    disk = Disk()
    for operation in operations:
        disk.apply(operation)
    return disk.state(variant, random.Random(seed))


def _renamed() -> list[Operation]:
    """An old file is replaced by a new one, none of which is synced but the old one."""
    return [
        Operation("create", "a"),
        Operation("write", "a", data=b"old"),
        Operation("sync", "a", begun=2),
        Operation("sync", "", begun=3),
        Operation("create", ".a"),
        Operation("write", ".a", data=b"new, and longer"),
        Operation("rename", ".a", target="a"),
    ]


def test_states_of_a_file_that_is_replaced_without_a_sync() -> None:
    operations = _renamed()
    assert _after(operations, "all written") == {"a": b"new, and longer"}
    assert _after(operations, "only what was synced") == {"a": b"old"}
    assert _after(operations, "data lost") == {"a": b""}
    assert _after(operations, "zeros") == {"a": bytes(15)}
    assert _after(operations[:-1], "torn") == {"a": b"old", ".a": b"new, an"}
    by_chance = {tuple(_after(operations, "by chance", seed).items()) for seed in range(50)}
    assert by_chance == {
        (("a", b"old"),),
        ((".a", b""), ("a", b"old")),
        ((".a", b"new, and longer"), ("a", b"old")),
        (("a", b""),),
        (("a", b"new, and longer"),),
    }


def test_a_synced_file_is_there_whatever_happens() -> None:
    operations = [
        *_renamed()[:-1],
        Operation("sync", ".a", begun=6),
        Operation("rename", ".a", target="a"),
        Operation("sync", "", begun=8),
    ]
    for variant in ("all written", "only what was synced", "data lost", "zeros", "torn"):
        assert _after(operations, variant) == {"a": b"new, and longer"}
    assert _after(operations, "by chance", 5) == {"a": b"new, and longer"}


def test_a_name_is_lost_with_the_folder_above_it() -> None:
    operations = [
        Operation("mkdir", "new"),
        Operation("create", "new/a"),
        Operation("sync", "new/a", begun=2),
        Operation("sync", "new", begun=3),
    ]
    assert _after(operations, "only what was synced") == {}
    operations.append(Operation("sync", "", begun=4))
    assert _after(operations, "only what was synced") == {"new": None, "new/a": b""}


@pytest.mark.end_to_end
@pytest.mark.xdist_group("faults")
@pytest.mark.timeout(900)
@needs_strace
def test_disks_of_a_run_after_a_power_cut_are_read_and_gone_on_with() -> None:
    verdict, trials = measure_crash_states(completions=3, most_states=300, seed=1)
    assert verdict.ok, (verdict.text(), [trial for trial in trials if not trial.ok])
