"""``import carstage``: light, complete, and usable from every kind of program."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

import carstage
from analytic_dataset import make_dataset
from carstage import events
from carstage.dataset import Dataset
from driving import wait_for

_DEADLINE_S = 240.0
"""The first start on a machine compiles the simulator's kernels."""

TINY = {
    "name": "tiny",
    "duration_s": 0.5,
    "vehicles": {"count": 1},
    "pedestrians": {"count": 0},
    "image_size": [96, 54],
    "conversion": {"workers": 1},
    "server": {"kind": "embedded", "self_test": "off"},
}
_PROGRAM = f"""
import carstage
result = carstage.run({TINY!r}, OUT)
print(result.state, result.frames, carstage.validate(result.dataset).ok)
print(carstage.export("coco", result.dataset, OUT + "-coco", workers=1).frames)
"""
_ANSWER = ["done 5 True", "5"]


def python(*arguments: str, given: str | None = None) -> list[str]:
    """What a program of Python prints, to its end."""
    ended = subprocess.run(
        [sys.executable, *arguments],
        input=given,
        capture_output=True,
        text=True,
        timeout=_DEADLINE_S,
    )
    assert ended.returncode == 0, ended.stderr
    return ended.stdout.splitlines()


def as_script(program: str, folder: Path) -> list[str]:
    path = folder / "script.py"
    path.write_text(program)
    return python(str(path))


def as_argument(program: str, folder: Path) -> list[str]:
    del folder
    return python("-c", program)


def on_standard_input(program: str, folder: Path) -> list[str]:
    del folder
    return python(given=program)


def in_cells(program: str, folder: Path) -> list[str]:
    """Line by line in an interactive session, whose main module is neither file nor text."""
    session = (
        "import code, sys\n"
        "sys.ps1 = 'In: '\n"
        "cells = code.InteractiveConsole()\n"
        f"for line in {program.strip().splitlines()!r}:\n"
        "    cells.push(line)\n"
    )
    return as_script(session, folder)


@pytest.mark.end_to_end
@pytest.mark.timeout(_DEADLINE_S + 30)
@pytest.mark.parametrize("way", [as_script, as_argument, on_standard_input, in_cells])
def test_program_without_a_guard_records_and_ends(
    way: Callable[[str, Path], list[str]], tmp_path: Path
) -> None:
    out = tmp_path / "dataset"
    assert way(f"OUT = {str(out)!r}\n{_PROGRAM}", tmp_path) == _ANSWER
    assert len(list((out / "runs").iterdir())) == 1  # no worker has started a run


@pytest.mark.end_to_end
def test_run_from_another_thread_gives_typed_events_that_its_folder_holds_too(
    tmp_path: Path,
) -> None:
    seen: list[events.RunEvent] = []
    results: list[carstage.RunResult] = []

    def record() -> None:
        results.append(carstage.run(TINY, tmp_path / "dataset", seen.append))

    thread = threading.Thread(target=record)
    thread.start()
    thread.join(_DEADLINE_S)
    (result,) = results
    assert (result.state, result.committed, result.frames) == ("done", 1, 5)
    kinds = [type(event) for event in seen]
    for kind in (
        events.RunPlanned,
        events.RunStarted,
        events.ServerStarted,
        events.AttemptReserved,
        events.Connected,
        events.EpisodeStarted,
        events.Progress,
        events.EpisodeRecorded,
        events.FramesConverted,
        events.EpisodeCommitted,
        events.RunFinished,
    ):
        assert kind in kinds
    only_for_callers = (events.RunPlanned, events.Progress, events.Notice)
    written = [event for event in seen if not isinstance(event, only_for_callers)]
    assert events.read_events(result.folder) == written
    shown = [event for event in seen if isinstance(event, events.Progress)]
    assert shown[-1].episodes.committed == 1
    assert shown[0].episodes.committed == 0  # a snapshot, not the run's own counts


@pytest.mark.end_to_end
def test_ctrl_c_ends_a_script_s_run_well_and_the_script_goes_on(tmp_path: Path) -> None:
    out = tmp_path / "dataset"
    program = (
        f"import carstage\nprint(carstage.run({TINY | {'duration_s': 60}!r}, {str(out)!r}).state)"
    )
    script = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: [*out.glob("runs/*/raw/*/*/*")], "the recording", _DEADLINE_S)
        os.kill(script.pid, signal.SIGINT)
        stdout, _ = script.communicate(timeout=_DEADLINE_S)
    finally:
        script.kill()
    assert (script.returncode, stdout) == (0, "interrupted\n")


def test_second_signal_leaves_an_interactive_session_alive() -> None:
    program = (
        "import os, signal, sys\n"
        "from carstage.runs.interruption import Interruption\n"
        "sys.ps1 = 'In: '\n"
        "try:\n"
        "    with Interruption() as interruption, interruption.deferred():\n"
        "        for _ in range(2):\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt:\n"
        "    print('alive')\n"
    )
    assert python("-c", program) == ["alive"]


def test_import_loads_nothing() -> None:
    program = (
        "import sys; before = set(sys.modules); import carstage; dir(carstage)\n"
        "print(sorted(set(sys.modules) - before - {'__future__', 'carstage'}))\n"
    )
    assert python("-c", program) == ["[]"]


def test_every_public_name_is_there_after_all_modules_were_imported(tmp_path: Path) -> None:
    """No module or package may take the place of a function of its name."""
    config = tmp_path / "config.yaml"
    config.write_text("name: tiny\n")
    program = f"""
import importlib, inspect, pkgutil
import carstage
for found in pkgutil.walk_packages(carstage.__path__, "carstage."):
    if found.name.endswith("__main__") or found.name.startswith("carstage.collector"):
        continue  # these run, or need the client library
    try:
        importlib.import_module(found.name)
    except ModuleNotFoundError as missing:
        assert not missing.name.startswith("carstage"), missing
assert set(carstage.__all__) <= set(dir(carstage))
assert carstage.load_config({str(config)!r}).name == "tiny"
assert carstage.Config().name
assert carstage.ExportOptions().cameras == ()
assert issubclass(carstage.CarStageError, Exception)
assert inspect.ismodule(carstage.events)
for call in (
    lambda: carstage.run({str(tmp_path / "none.yaml")!r}, {str(tmp_path / "out")!r}),
    lambda: carstage.validate({str(tmp_path / "none")!r}),
    lambda: carstage.export("coco", {str(tmp_path / "none")!r}, {str(tmp_path / "out")!r}),
    lambda: carstage.Dataset({str(tmp_path / "none")!r}),
):
    try:
        call()
    except carstage.CarStageError as error:
        print(type(error).__name__)
"""
    assert as_script(program, tmp_path) == ["ConfigError", *["DatasetError"] * 3]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(AttributeError, match="no attribute 'rnu'"):
        getattr(carstage, "rnu")  # noqa: B009 - what a user writes, without the type checker's word


@pytest.mark.parametrize("given", ["path", "text", "mapping", "config"])
def test_run_takes_a_configuration_in_every_form(given: str, tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(json.dumps(TINY | {"server": {"kind": "remote", "port": 1}}))
    forms = {
        "path": path,
        "text": str(path),
        "mapping": json.loads(path.read_text()),
        "config": carstage.load_config(path),
    }
    with pytest.raises(carstage.CarStageError, match="nothing answers at"):
        carstage.run(forms[given], tmp_path / "out")


def test_public_names_are_those_of_their_packages() -> None:
    assert carstage.Dataset is Dataset


def test_reading_and_reporting_import_no_pandas_and_pandas_can_be_had(tmp_path: Path) -> None:
    dataset = make_dataset(tmp_path / "dataset", tmp_path)
    program = """
import sys
import carstage
import pyarrow as pa
carstage.Dataset(sys.argv[1])
import carstage.report
table = pa.table({"a": [1, 2]})
assert "pandas" not in sys.modules
try:
    import pandas
except ImportError:
    sys.exit()
assert table.to_pandas()["a"].tolist() == [1, 2]
assert pa.array(pandas.Series([1, 2])).to_pylist() == [1, 2]
"""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
    subprocess.run([sys.executable, "-c", program, str(dataset)], check=True, env=environment)
