"""A tiny run on odd machines: each has the bytes of an ordinary one, or says why it cannot be.

A row is a change of the environment that a command gets: a shell around it, made of what Linux has
(``unshare``, ``ulimit``, ``taskset``, redirections). Rows that this machine cannot make say so.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from benchmarks.framework.faults.trial import CONFIG, hashes_of
from carstage.bench.verdict import Figure, Verdict

_LONGEST_S = 400.0
_SETTINGS = ("--set", "episodes=1", "--set", "duration_s=0.6")


@dataclass(frozen=True, slots=True)
class Machine:
    """One row.

    Attributes:
        shell: text of a shell, in which ``{run}`` stands for the command.
        out: name of the dataset's folder.
        says: words of the refusal; empty: the run has to succeed.
        quick: whether the tests try it every time.
        needs: a command that must succeed for the row to be possible.
    """

    name: str
    shell: str
    out: str = "dataset"
    says: str = ""
    quick: bool = False
    needs: str = "true"


_MOUNTS = "unshare -m true"
_STRANGER = "setpriv --reuid 12345 --regid 12345 --clear-groups"
MACHINES = (
    Machine("no HOME", "env -u HOME {run}", quick=True),
    Machine("HOME cannot be written", "env HOME=/proc/nowhere {run}"),
    Machine(
        "another user, nothing writable but the dataset",
        f"chmod 777 . && exec unshare -m sh -c '{{open}} && exec {_STRANGER} {{run}}'",
        needs=f"unshare -m sh -c '{{open}} && {_STRANGER} {{python}} -m carstage.cli --version'",
    ),
    Machine(
        "a read-only installation",
        "exec unshare -m sh -c 'mount --bind {source} {source} && "
        "mount -o remount,ro,bind {source} && exec {run}'",
        needs=_MOUNTS,
    ),
    Machine(
        "no network but loopback",
        "exec unshare -n sh -c 'ip link set lo up && exec {run}'",
        needs="unshare -n ip link set lo up",
    ),
    Machine("one CPU", "taskset -c 0 {run}"),
    Machine("6 GB of address space", "ulimit -v 6000000; {run}"),
    Machine("plain C locale", "env -u LANG LC_ALL=C {run}", quick=True),
    Machine("a locale that is not there", "env LC_ALL=tr_TR.UTF-8 {run}"),
    Machine("another time zone", "env TZ=Asia/Kathmandu {run}"),
    Machine("spaces and umlauts", "{run}", out="Straße mit Leerzeichen", quick=True),
    Machine(
        "ASCII alone, and a path that is not",
        "env -u LANG LC_ALL=C PYTHONUTF8=0 PYTHONCOERCECLOCALE=0 {run}",
        out="Straße",
        says="PYTHONUTF8=1",
        quick=True,
    ),
    Machine("a path that is not UTF-8", "{run}", out="\udcff", says="no UTF-8", quick=True),
    Machine("closed input", "{run} <&-"),
    Machine("closed output", "{run} >&-", quick=True),
    Machine("closed streams", "{run} <&- >&- 2>&-", quick=True),
    Machine("nobody reads the progress", "{run} 2>&1 >/dev/null | true; exit ${{PIPESTATUS[0]}}"),
    Machine("umask 077", "umask 077; {run}"),
    Machine(
        "4 MB in /tmp",
        "exec unshare -m sh -c 'mount -t tmpfs -o size=4m none /tmp && exec {run}'",
        needs="unshare -m sh -c 'mount -t tmpfs none /tmp && {python} -m carstage.cli --version'",
    ),
    Machine(
        "64 kB in /dev/shm",
        "exec unshare -m sh -c 'mount -t tmpfs -o size=64k none /dev/shm && exec {run}'",
        needs=_MOUNTS,
    ),
    Machine(
        "no /dev/shm",
        "exec unshare -m sh -c 'mount -t tmpfs none /dev && mknod /dev/null c 1 3 && "
        "mknod /dev/urandom c 1 9 && exec {run}'",
        needs=_MOUNTS,
    ),
    Machine("256 open files", "ulimit -n 256; {run}", quick=True),
    Machine("64 open files", "ulimit -n 64; {run}", says="64 files may be open", quick=True),
)


@dataclass(frozen=True, slots=True)
class Row:
    """What came of a machine: ``same``, ``refused in words``, ``not possible here``, or else."""

    machine: str
    result: str
    said: str

    @property
    def ok(self) -> bool:
        """Whether it is as it should be."""
        return self.result in ("same", "refused in words", "not possible here")


def measure_odd_machines(
    machines: Sequence[Machine] = MACHINES,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[Verdict, list[Row]]:
    """Run on each machine, and compare.

    Args:
        machines: which ones.
        progress: called with the machines done and their total number.
    """
    # Not below /tmp, which some rows take away.
    with tempfile.TemporaryDirectory(prefix="carstage-odd-", dir="/var/tmp") as name:
        scratch = Path(name)
        scratch.chmod(0o755)
        ordinary = Machine("ordinary", "{run}")
        _try(ordinary, scratch / "ordinary", {})
        expected = hashes_of(scratch / "ordinary" / ordinary.out)
        rows = []
        for number, machine in enumerate(machines):
            rows.append(_try(machine, scratch / str(number), expected))
            progress(number + 1, len(machines))
    verdict = Verdict(
        "odd-machines",
        (
            Figure("machines", len(rows), ">=", 1),
            Figure("same_files", sum(row.result == "same" for row in rows), ">=", 1),
            Figure("refused_in_words", sum(row.result == "refused in words" for row in rows)),
            Figure("not_possible_here", sum(row.result == "not possible here" for row in rows)),
            Figure("wrong", sum(not row.ok for row in rows), "==", 0),
        ),
    )
    return verdict, rows


def _try(machine: Machine, folder: Path, expected: object) -> Row:
    folder.mkdir()
    (folder / "config.yaml").write_text(CONFIG)
    out = folder / machine.out
    run = [sys.executable, "-m", "carstage.cli", "run", str(folder / "config.yaml")]
    command = " ".join(map(shlex.quote, [*run, *_SETTINGS]))
    source = Path(__file__).resolve().parents[2]
    words = {"python": sys.executable, "source": shlex.quote(str(source)), "open": _open_home()}
    needs = machine.needs.format(**words)
    if subprocess.run(["bash", "-c", needs], capture_output=True, check=False).returncode:
        return Row(machine.name, "not possible here", needs)
    words["run"] = f'{command} --out "$OUT"'
    try:
        done = subprocess.run(
            ["bash", "-c", machine.shell.format(**words)],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_LONGEST_S,
            check=False,
            env={**os.environ, "OUT": str(out)},
        )
    except subprocess.TimeoutExpired:
        return Row(machine.name, f"no end within {_LONGEST_S:.0f} s", "")
    said = done.stderr.decode("utf-8", "replace").strip()
    last = " ".join(said.splitlines()[-2:])[-300:].replace(str(folder), "")
    found = hashes_of(out)
    shutil.rmtree(folder / "home", ignore_errors=True)
    if "Traceback" in said:
        return Row(machine.name, "a traceback", last)
    if machine.says:
        refused = done.returncode == 2 and machine.says in said and not found
        return Row(machine.name, "refused in words" if refused else "not refused", last)
    if done.returncode:
        return Row(machine.name, f"exit status {done.returncode}", last)
    return Row(machine.name, "same" if found == expected or not expected else "other files", last)


def _open_home() -> str:
    """Commands after which every user reaches a Python that lies below a home of ours alone."""
    home, base = Path.home(), Path(sys.base_prefix)
    if not base.is_relative_to(home):
        return "true"
    return (
        f"d=$(mktemp -d) && mount --bind {base} $d && mount -t tmpfs -o mode=755 none {home} "
        f"&& mkdir -p {base} && mount --bind $d {base}"
    )


def rows_text(rows: Sequence[Row]) -> str:
    """The table for people."""
    width = max(len(row.machine) for row in rows)
    return "\n".join(f"{row.machine:<{width}}  {row.result}" for row in rows)


def rows_json(rows: Sequence[Row]) -> list[dict[str, str]]:
    """The table for programs."""
    return [asdict(row) for row in rows]
