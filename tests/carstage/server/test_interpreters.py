"""Which Python runs the collector. The interpreters here are scripts that answer as one would."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from carstage.errors import BadInputError, ServerError
from carstage.releases import Release
from carstage.server import interpreters
from carstage.server.interpreters import (
    check_interpreter,
    client_folder,
    clients_here,
    create_client,
    find_client,
    imports_wheel,
)

OLD = Release(0, 9, 13)


def interpreter(path: Path, version: str, wheel: str | None, *, imports: bool = True) -> Path:
    """A program that answers the questions put to a Python."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(
        "#!/bin/sh\n"
        'case "$2" in\n'
        f'  *version_info*) echo "{version}" ;;\n'
        f"  *version*) {f'echo {wheel}' if wheel else 'exit 1'} ;;\n"
        f"  *import*carla*) {'exit 0' if imports else 'exit 1'} ;;\n"
        "esac\n"
    )
    path.chmod(0o755)
    return path


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine with nothing on it: no cache, nothing on PATH, no pyenv, no uv."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:/bin:/usr/bin")
    monkeypatch.setenv("CARSTAGE_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("PYENV_ROOT", str(tmp_path / "pyenv"))
    which = interpreters.shutil.which
    monkeypatch.setattr(
        interpreters.shutil, "which", lambda name: which(name, path=str(tmp_path / "bin"))
    )
    return tmp_path


def uv(machine: Path, script: str) -> None:
    program = machine / "bin" / "uv"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)


def test_this_python_serves_servers_of_its_own_release(machine: Path) -> None:
    found = find_client("0.9.16")
    assert (found.path, found.client) == (Path(sys.executable), "0.9.16")


def test_nobody_asks_uv_while_this_python_fits(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(interpreters, "_found_by_uv", lambda version: pytest.fail("asked"))
    assert find_client("0.9.16").path == Path(sys.executable)


def test_python_on_path_with_the_servers_wheel_is_found(machine: Path) -> None:
    python = interpreter(machine / "bin" / "python3.8", "3.8", "0.9.13")
    assert find_client("0.9.13").path == python


def test_python_below_pyenv_is_found(machine: Path) -> None:
    interpreter(machine / "bin" / "python3.8", "3.8", "0.9.14")
    python = interpreter(machine / "pyenv/versions/3.8.18/bin/python", "3.8", "0.9.13")
    assert find_client("0.9.13-dirty").path == python


def test_python_of_uv_is_found(machine: Path) -> None:
    python = interpreter(machine / "uv/python", "3.8", "0.9.13")
    uv(machine, f"echo {python}")
    assert find_client("0.9.13").path == python


def test_all_with_a_wheel_are_listed_once_and_uv_is_asked_once_for_each_version(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(interpreters, "_found_by_uv", lambda version: asked.append(version))
    made = interpreter(client_folder(OLD) / "bin" / "python", "3.8", "0.9.13")
    old = interpreter(machine / "bin" / "python3.8", "3.8", "0.9.14")
    new = interpreter(machine / "pyenv/versions/3.12.1/bin/python", "3.12", "0.9.16")
    interpreter(machine / "pyenv/versions/3.10.1/bin/python", "3.10", None)
    found = [(python.path, python.client) for python in clients_here()]
    assert found == [(made, "0.9.13"), (old, "0.9.14"), (new, "0.9.16")]
    assert sorted(asked) == ["3.10", "3.11", "3.12", "3.8"]


def test_python_whose_wheel_cannot_be_imported_is_passed_over(machine: Path) -> None:
    interpreter(machine / "bin" / "python3.8", "3.8", "0.9.13", imports=False)
    with pytest.raises(BadInputError, match=r"server\.client_python.*0\.9\.13.*0\.9\.16"):
        find_client("0.9.13")


def test_wheel_of_pip_install_user_is_in_sight(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(machine / "home"))
    monkeypatch.delenv("PYTHONUSERBASE", raising=False)
    python = interpreter(machine / "mine", "3.8", "0.9.13")
    script = python.read_text()
    for base in ("home/.local", "elsewhere"):
        seen = f'[ "$PYTHONUSERBASE" = "{machine / base}" ] && [ "$HOME" != "{machine / "home"}" ]'
        python.write_text(script.replace("exit 0 ;;", f"{seen} ;;"))
        assert imports_wheel(python)
        monkeypatch.setenv("PYTHONUSERBASE", str(machine / "elsewhere"))


def test_own_wheel_is_imported_once_until_its_files_change(
    machine: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wheel = machine / "site" / "carla" / "__init__.py"
    wheel.parent.mkdir(parents=True)
    wheel.write_text("")
    monkeypatch.setitem(sys.modules, "carla", None)
    monkeypatch.delitem(sys.modules, "carla")
    monkeypatch.syspath_prepend(str(wheel.parents[1]))
    answers = ["it is broken", None, None]
    monkeypatch.setattr(interpreters, "import_problem", lambda python: answers.pop(0))
    own = Path(sys.executable)
    assert not imports_wheel(own)  # which is not kept: it may be mended without being touched
    assert imports_wheel(own)
    assert imports_wheel(own)
    assert answers == [None]
    wheel.write_text("changed")
    assert imports_wheel(own)
    assert answers == []


def test_missing_client_is_refused_with_the_way_to_one(machine: Path) -> None:
    with pytest.raises(BadInputError) as refused:
        find_client("0.9.14")
    assert "create_client_env" in refused.value.hint
    assert "carla==0.9.14" in refused.value.hint


def test_python_made_before_is_taken_before_those_on_path(machine: Path) -> None:
    interpreter(machine / "bin" / "python3.8", "3.8", "0.9.13")
    made = interpreter(client_folder(OLD) / "bin" / "python", "3.8", "0.9.13")
    assert find_client("0.9.13").path == made


def test_wanted_python_is_taken_if_its_wheel_fits(machine: Path) -> None:
    python = interpreter(machine / "mine", "3.8", "0.9.15")
    assert find_client("0.9.15", str(python)).path == python
    with pytest.raises(BadInputError, match=r"0\.9\.15; CARLA 0\.9\.14 needs 0\.9\.14"):
        find_client("0.9.14", str(python))


def test_wheel_of_a_newer_servers_own_release_is_taken_where_the_user_names_it(
    machine: Path,
) -> None:
    python = interpreter(machine / "mine", "3.12", "0.9.17")
    found = find_client("0.9.17-dirty", str(python))
    assert (found.path, found.client) == (python, "0.9.17")
    with pytest.raises(BadInputError, match=r"0\.9\.17; CARLA 0\.9\.18 needs 0\.9\.18 or 0\.9\.16"):
        find_client("0.9.18", str(python))
    with pytest.raises(BadInputError, match=r"0\.9\.17; CARLA 0\.9\.16 needs 0\.9\.16\."):
        find_client("0.9.16", str(python))


def test_wanted_python_that_does_not_run_is_refused(machine: Path) -> None:
    with pytest.raises(BadInputError, match=r"server\.client_python.*no Python that runs"):
        find_client("0.9.15", str(machine / "nothing"))


def test_wanted_python_that_cannot_import_its_wheel_is_refused(machine: Path) -> None:
    python = interpreter(machine / "mine", "3.8", "0.9.15", imports=False)
    with pytest.raises(BadInputError, match="cannot import"):
        find_client("0.9.15", str(python))


MAKES = """
case "$1" in
  venv) for last; do :; done
    mkdir -p "$last/bin"
    cp {python} "$last/bin/python" ;;
  pip) echo "$@" > {told} ;;
  *) exit 1 ;;
esac
"""


def test_client_is_made_with_uv_only_when_allowed(machine: Path) -> None:
    python = interpreter(machine / "template", "3.8", "0.9.13")
    told = machine / "told"
    uv(machine, MAKES.format(python=python, told=told))
    with pytest.raises(BadInputError):
        find_client("0.9.13")
    made = find_client("0.9.13", create=True)
    assert made.path == client_folder(OLD) / "bin" / "python"
    assert "carla==0.9.13" in told.read_text()
    assert [path.name for path in client_folder(OLD).parent.iterdir()] == ["0.9.13"]


def test_client_that_uv_cannot_make_leaves_nothing(machine: Path) -> None:
    uv(machine, "echo no such version >&2; exit 2")
    with pytest.raises(ServerError, match="no such version"):
        create_client(OLD)
    assert list(client_folder(OLD).parent.iterdir()) == []


def test_making_a_client_needs_uv(machine: Path) -> None:
    with pytest.raises(BadInputError, match=r"server\.create_client_env: uv"):
        create_client(OLD)


def test_this_python_is_known_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(*_: object, **__: object) -> None:
        raise AssertionError("a process was started")

    monkeypatch.setattr(subprocess, "run", start)
    check_interpreter(Path(sys.executable))
