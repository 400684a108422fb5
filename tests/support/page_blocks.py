"""The marked blocks of the how-tos: files that a page makes, and what it runs."""

from __future__ import annotations

import configparser
import re
from pathlib import Path

BLOCK = re.compile(
    r"<!-- (?P<what>run|file: (?P<name>[\w.-]+)) -->\n```(?P<language>\w+)\n(?P<code>.*?)```",
    re.DOTALL,
)


def files_of(page: Path) -> dict[str, str]:
    """The files that a page makes, by name."""
    blocks = BLOCK.finditer(page.read_text("utf-8"))
    return {block["name"]: block["code"] for block in blocks if block["name"] is not None}


def write(name: str, text: str, folder: Path) -> None:
    """Make a page's file; a ``pyproject.toml`` is installed as well."""
    (folder / name).write_text(text, "utf-8")
    if name == "pyproject.toml":
        install(text, folder)


def install(project: str, folder: Path) -> None:
    """Stands for ``pip install -e .``: the package's name and entry points, without a network."""
    given = configparser.ConfigParser()
    given.read_string(project)
    name, version = (given["project"][key].strip('"') for key in ("name", "version"))
    information = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n", "utf-8"
    )
    lines = []
    for section in given.sections():
        if section.startswith("project.entry-points"):
            entries = [f"{entry} = {value}" for entry, value in given[section].items()]
            lines += [
                f"[{section.split(chr(34))[1]}]",
                *(line.replace('"', "") for line in entries),
            ]
    (information / "entry_points.txt").write_text("\n".join(lines) + "\n", "utf-8")
