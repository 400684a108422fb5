"""The Python whose ``carla`` wheel fits a server: found on this machine, or made with uv.

A client wheel speaks to servers of its own release only, and exists for few Pythons: the collector
is therefore run by whichever interpreter has the right one. What is found counts only once it has
imported the wheel.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError
from itertools import chain
from pathlib import Path

from carstage.cache import cache_folder, home_folder, keep_in_cache
from carstage.errors import BadInputError, ServerError
from carstage.files.home import without_tilde
from carstage.packages import installed_version
from carstage.releases import CLIENT_PYTHONS, Release, client_release, release_of

AUTO = "auto"
_RUN_S = 30.0
_INSTALL_S = 900.0
_WHEEL = "from importlib.metadata import version; print(version('carla'))"
_IMPORT = "import carla"
_PYTHON = "import sys; print('%d.%d' % sys.version_info[:2])"


@dataclass(frozen=True, slots=True)
class ClientPython:
    """An interpreter with a client wheel.

    Attributes:
        path: the interpreter.
        client: version of its wheel.
    """

    path: Path
    client: str


def find_client(server_version: str, wanted: str = AUTO, *, create: bool = False) -> ClientPython:
    """The interpreter to run the collector with.

    This Python is taken when its wheel fits, else one that was made for it before, then those on
    PATH, below pyenv's versions and of uv. With a server that is newer than all known ones, the
    wheel of the newest of these fits, and the server's own one where it is wanted.

    Args:
        server_version: what the server reports.
        wanted: ``auto``, or the path of an interpreter.
        create: make one with uv when none is found.

    Raises:
        BadInputError: there is none, or the wanted one has no fitting wheel; names
            ``server.client_python``.
        ServerError: making one failed.
    """
    release = client_release(server_version)
    if wanted != AUTO:
        return _wanted(without_tilde(wanted), release, server_version)
    for python in _candidates(release):
        if _wheel_in(python) == str(release) and imports_wheel(python):
            return ClientPython(python, str(release))
    if create:
        return create_client(release)
    pythons = " or ".join(CLIENT_PYTHONS[release])
    raise BadInputError(
        f"server.client_python: no Python here has the carla wheel {release}, which CARLA "
        f"{server_version} needs; this one has {_wheel_in(Path(sys.executable)) or 'none'}.",
        f"Set server.create_client_env: true to have one made with uv, or install carla=={release} "
        f"into a Python {pythons} and give its path.",
    )


def check_interpreter(python: Path) -> None:
    """Refuse what is no Python with a client wheel of some version.

    Raises:
        BadInputError: names ``server.client_python``.
    """
    if python != Path(sys.executable) and _output(python, _PYTHON) is None:
        raise BadInputError(
            f"server.client_python: {python} is no Python that runs.", "Give an interpreter's path."
        )
    if _wheel_in(python) is None:
        raise BadInputError(
            f"server.client_python: {python} has no carla wheel.",
            "Install that of the server's version into it, or use `auto`.",
        )


def clients_here() -> list[ClientPython]:
    """Every interpreter with a client wheel besides this one, by path; none is imported."""
    made = (client_folder(release) / "bin" / "python" for release in CLIENT_PYTHONS)
    # Each version once, though several releases have it: uv takes half a second to find one.
    versions = dict.fromkeys(chain.from_iterable(CLIENT_PYTHONS.values()))
    found = []
    for python in dict.fromkeys(chain(made, _interpreters(versions))):
        if python == Path(sys.executable) or not os.access(python, os.X_OK):
            continue
        wheel = _wheel_in(python)
        if wheel is not None:
            found.append(ClientPython(python, wheel))
    return found


def client_folder(release: Release) -> Path:
    """The folder of the environment that is made for a release's client."""
    return cache_folder() / "wheels" / str(release)


def create_client(release: Release) -> ClientPython:
    """Make an environment with a release's wheel in :func:`client_folder`, unless it is there.

    Raises:
        BadInputError: uv is missing.
        ServerError: uv could not make it.
    """
    folder = client_folder(release)
    ready = ClientPython(folder / "bin" / "python", str(release))
    if _wheel_in(ready.path) == str(release) and imports_wheel(ready.path):
        return ready
    uv = shutil.which("uv")
    if uv is None:
        raise BadInputError(
            "server.create_client_env: uv is not installed.", "Install it: pip install uv"
        )
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Made beside its place and moved there: nobody ever meets half an environment.
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=f".{release}-") as scratch:
        made = Path(scratch) / "env"
        try:
            # Run there, too: uv heeds the pins of a project that it is called in.
            _run(
                *(uv, "venv", "--quiet", "--no-project", "--python", _base(release), str(made)),
                folder=scratch,
            )
            _run(
                *(uv, "pip", "install", "--quiet", "--python", str(made / "bin" / "python")),
                *("--no-deps", "--only-binary", ":all:", f"carla=={release}"),
                folder=scratch,
            )
        except (OSError, subprocess.SubprocessError) as error:
            raise ServerError(
                f"uv could not make a Python with the carla wheel {release}: {_reason(error)}.",
                f"Install carla=={release} yourself and give server.client_python.",
            ) from error
        if not imports_wheel(made / "bin" / "python"):
            raise ServerError(f"The carla wheel {release} that uv installed cannot be imported.")
        shutil.rmtree(folder, ignore_errors=True)
        made.rename(folder)
    return ready


def imports_wheel(python: Path) -> bool:
    """Whether an interpreter can import its client wheel; of this one, asked once on a machine."""
    kept = _kept_import(python)
    if kept is not None and kept.exists():
        return True
    imports = import_problem(python) is None
    if imports and kept is not None:
        keep_in_cache(kept, "")
    return imports


def import_problem(python: Path) -> str | None:
    """Why an interpreter cannot import its client wheel, in a line; None when it can."""
    # In a home of its own: the module makes a cache folder when it is imported. What the user has
    # installed with `pip install --user` stays in sight.
    base = os.environ.get("PYTHONUSERBASE") or str(home_folder() / ".local")
    with tempfile.TemporaryDirectory() as home:
        try:
            _run(str(python), "-c", _IMPORT, timeout_s=_RUN_S, HOME=home, PYTHONUSERBASE=base)
        except (OSError, subprocess.SubprocessError) as error:
            return _reason(error)
    return None


def _kept_import(python: Path) -> Path | None:
    """The file whose being there says that this Python has imported these files of its wheel."""
    found = importlib.util.find_spec("carla") if python == Path(sys.executable) else None
    if found is None or found.origin is None:
        return None
    words = [sys.executable, sys.version]
    with os.scandir(Path(found.origin).parent) as files:
        for file in sorted(files, key=lambda one: one.path):
            if not file.is_file():  # what Python compiled of it may change
                continue
            stat = file.stat()
            words.append(f"{file.path} {stat.st_size} {stat.st_mtime_ns}")
    digest = hashlib.sha256("\n".join(words).encode()).hexdigest()
    return cache_folder() / f"imported-{digest[:16]}"


def _wanted(python: Path, release: Release, server_version: str) -> ClientPython:
    check_interpreter(python)
    wheel = _wheel_in(python)
    own = release_of(server_version)  # newer than the newest known one: both are worth a try
    if wheel is None or release_of(wheel) not in (release, own):
        needed = f"{release}" if own in (release, None) else f"{own} or {release}"
        raise BadInputError(
            f"server.client_python: {python} has the carla wheel {wheel or 'of no version'}; "
            f"CARLA {server_version} needs {needed}.",
            f"Install carla=={release} into it, or use `auto`.",
        )
    if not imports_wheel(python):
        raise BadInputError(
            f"server.client_python: {python} cannot import its carla wheel {wheel}.",
            f"Run {python} -c 'import carla' to see why.",
        )
    return ClientPython(python, wheel)


def _candidates(release: Release) -> Iterator[Path]:
    """Interpreters that may have a release's wheel, the likeliest first; each once."""
    seen: set[Path] = set()
    own = [Path(sys.executable), client_folder(release) / "bin" / "python"]
    # One after the other as they are asked for: uv takes half a second to find one.
    for python in chain(own, _interpreters(CLIENT_PYTHONS[release])):
        # Not resolved: an environment's interpreter is a link to the one that it was made from.
        if python not in seen and os.access(python, os.X_OK):
            seen.add(python)
            yield python


def _interpreters(versions: Iterable[str]) -> Iterator[Path]:
    """Interpreters of these versions on PATH, below pyenv's versions, and of uv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", home_folder() / ".pyenv")) / "versions"
    for version in versions:
        on_path = shutil.which(f"python{version}")
        if on_path is not None:
            yield Path(on_path)
        yield from sorted(pyenv.glob(f"{version}.*/bin/python"))
        of_uv = _found_by_uv(version)
        if of_uv is not None:
            yield of_uv


def _found_by_uv(version: str) -> Path | None:
    uv = shutil.which("uv")
    if uv is None:
        return None
    try:
        return Path(_run(uv, "python", "find", "--no-project", "--managed-python", version).strip())
    except (OSError, subprocess.SubprocessError):
        return None


def _base(release: Release) -> str:
    """What uv makes an environment from: a Python that runs here, else a version to fetch."""
    versions = CLIENT_PYTHONS[release]
    for python in _interpreters(versions):
        # A shim of pyenv is on PATH even where its version is not chosen; only a run shows that.
        if _output(python, _PYTHON) in versions:
            return str(python)
    return versions[0]


def _wheel_in(python: Path) -> str | None:
    """Version of the client wheel that an interpreter has; None for none."""
    if python == Path(sys.executable):
        try:
            return installed_version("carla")
        except PackageNotFoundError:
            return None
    return _output(python, _WHEEL)


def _output(python: Path, code: str) -> str | None:
    """What a few lines of Python print; None when they fail."""
    try:
        return _run(str(python), "-c", code, timeout_s=_RUN_S).strip()
    except (OSError, subprocess.SubprocessError):
        return None


def _run(
    *command: str, timeout_s: float = _INSTALL_S, folder: str | None = None, **environment: str
) -> str:
    done = subprocess.run(
        command,
        check=True,
        capture_output=True,
        text=True,
        timeout=timeout_s,
        cwd=folder,
        env={**os.environ, **environment},
    )
    return done.stdout


def _reason(error: Exception) -> str:
    lines = (getattr(error, "stderr", None) or str(error)).strip().splitlines()
    return lines[-1] if lines else type(error).__name__
