"""Sensor kinds of installed packages, looked up by several threads."""

from __future__ import annotations

import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import replace

import pytest

from carstage.sensor_kinds import installed, table

LIMIT_S = 60.0


def test_a_thread_waits_for_the_kinds_that_another_looks_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    began, go_on = threading.Event(), threading.Event()
    late = replace(table.sensor_kind("rgb"), name="late", blueprint="sensor.camera.late")

    def slowly_imported(_modules: object) -> None:
        began.set()
        assert go_on.wait(LIMIT_S)
        assert table.known_kind("later") is None  # a plugin may ask while it is imported
        table.register(late)

    monkeypatch.setattr(table, "_kinds", dict(table._kinds))
    not_yet = installed.InstalledModules(table.ENTRY_POINT_GROUP)
    monkeypatch.setattr(table, "_installed", not_yet)
    monkeypatch.setattr(installed, "import_plugins", slowly_imported)
    with ThreadPoolExecutor(2) as threads:
        first = threads.submit(table.known_kind, "late")
        assert began.wait(LIMIT_S)
        second = threads.submit(table.known_kind, "late")
        done, _ = wait([second], 0.2)
        go_on.set()
        assert not done
        assert first.result(LIMIT_S) == second.result(LIMIT_S) == late


_FINDER = """
import sys
class Finder:
    def find_spec(*_): return None
    def find_distributions(*_): return []
sys.meta_path.append(Finder)
"""


@pytest.mark.parametrize(("before", "read"), [("", ["0", "1"]), (_FINDER, ["1", "1"])])
def test_files_of_installed_packages_are_read_once_for_all_groups(
    before: str, read: list[str]
) -> None:
    """Ours alone where they suffice; a finder of somebody else's knows packages that they miss."""
    program = (
        before + "\n"
        "import importlib.metadata as metadata\n"
        "read, times = metadata.entry_points, []\n"
        "metadata.entry_points = lambda **given: (times.append(1), read(**given))[1]\n"
        "from carstage.codecs import codec_names\n"
        "from carstage.spec import known_events\n"
        "assert 'png' in codec_names('rgb') and known_events()\n"
        "from carstage.sensor_kinds.installed import _declared\n"
        "print(len(times), _declared.cache_info().misses)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert ended.stdout.split() == read
