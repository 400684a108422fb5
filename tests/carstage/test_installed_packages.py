"""Entry points of installed packages: what is found is what ``importlib.metadata`` finds."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

_GROUP = "carstage.sensors"
_ENTRY = f"[other]\na = b\n[{_GROUP}]\nodd = odd_kinds\n"
_PROGRAM = f"""
import sys
sys.path[:0] = sys.argv[1:]
from carstage.sensor_kinds.installed import installed_entries
print([entry.value for entry in installed_entries({_GROUP!r})])
print("importlib.metadata" in sys.modules)
"""


def found(*places: Path) -> list[str]:
    """Modules of the group with further places to look in, and whether metadata was loaded."""
    command = [sys.executable, "-S", "-c", _PROGRAM, str(Path(__file__).parents[2] / "src")]
    ended = subprocess.run(
        [*command, *map(str, places)], capture_output=True, text=True, check=True
    )
    return ended.stdout.splitlines()


def package(folder: Path, ending: str = ".dist-info") -> Path:
    """A folder with an installed package that declares a module."""
    record = folder / f"odd-1.0{ending}"
    record.mkdir(parents=True)
    (record / "METADATA").write_text("Name: odd\nVersion: 1.0\n")
    (record / "PKG-INFO").write_text("Name: odd\nVersion: 1.0\n")
    (record / "entry_points.txt").write_text(_ENTRY)
    return folder


def test_where_no_package_names_the_group_no_library_is_loaded_to_say_so(tmp_path: Path) -> None:
    other = package(tmp_path)
    (other / "odd-1.0.dist-info" / "entry_points.txt").write_text("[carstage.sensors_too]\n")
    assert found(other, tmp_path / "gone") == ["[]", "False"]


@pytest.mark.parametrize("ending", [".dist-info", ".egg-info", ".Dist-Info"])
def test_a_package_in_a_folder_is_found(tmp_path: Path, ending: str) -> None:
    assert found(package(tmp_path, ending)) == ["['odd_kinds']", "True"]


def test_a_package_in_an_archive_is_found(tmp_path: Path) -> None:
    whole = package(tmp_path / "folder")
    with zipfile.ZipFile(tmp_path / "odd.zip", "w") as archive:
        for path in whole.glob("*/*"):
            archive.write(path, path.relative_to(whole))
    assert found(tmp_path / "odd.zip") == ["['odd_kinds']", "True"]


def test_a_package_that_a_finder_of_its_own_knows_is_found(tmp_path: Path) -> None:
    program = (
        "import importlib.metadata as metadata, sys\n"
        "from pathlib import Path\n"
        "class Finder(metadata.DistributionFinder):\n"
        "    def find_spec(self, *_): return None\n"
        "    def find_distributions(self, context=None):\n"
        f"        yield metadata.PathDistribution(Path({str(tmp_path)!r}) / 'odd-1.0.dist-info')\n"
        "sys.meta_path.append(Finder())\n"
        "sys.path.insert(0, sys.argv[1])\n"
        "from carstage.sensor_kinds.installed import installed_entries\n"
        f"print([entry.value for entry in installed_entries({_GROUP!r})])\n"
    )
    package(tmp_path)
    command = [sys.executable, "-S", "-c", program, str(Path(__file__).parents[2] / "src")]
    ended = subprocess.run(command, capture_output=True, text=True, check=True)
    assert ended.stdout.strip() == "['odd_kinds']"
