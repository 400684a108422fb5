"""The page of the command line names every command, and who takes the options that many take."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer

from carstage.cli.app import app

PAGE = (Path(__file__).parents[2] / "docs" / "formats" / "cli.md").read_text("utf-8")
ROWS = [
    [cell.strip().replace("\\|", "|") for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    for line in PAGE.splitlines()
    if line.startswith("| `")
]


def commands(command: Any, *path: str) -> Iterator[tuple[str, frozenset[str]]]:
    """Commands by name, with their options."""
    if not hasattr(command, "commands"):
        yield " ".join(path), frozenset(name for one in command.params for name in one.opts)
        return
    for name, below in command.commands.items():
        if not below.hidden:
            yield from commands(below, *path, name)


COMMANDS = dict(commands(typer.main.get_command(app)))


def meant(cell: str) -> set[str]:
    """The commands that a cell of the table names: those below a group's name, too."""
    named = set()
    for text in re.findall(r"`([^`]+)`", cell):
        words = re.sub(r"( -{1,2}| [A-Z\[…]|…).*", "", text.removeprefix("carstage ")).strip()
        first, _, last = words.rpartition(" ")
        for one in last.split("|"):
            name = f"{first} {one}".strip()
            named |= {key for key in COMMANDS if key == name or key.startswith(f"{name} ")}
    return named


def test_every_command_has_a_row() -> None:
    shown = set().union(*(meant(row[0]) for row in ROWS if row[0].startswith("`carstage ")))
    assert set(COMMANDS) - shown == set()


@pytest.mark.parametrize(
    "option", ["--json", "--set", "--work", "--catalog", "--retries", "--append"]
)
def test_an_option_has_the_commands_that_take_it(option: str) -> None:
    (row,) = [row for row in ROWS if re.match(rf"`{option}\b(?!-)", row[0])]
    takers = {name for name, options in COMMANDS.items() if option in options}
    named = meant(row[1])
    assert takers - named == set()
    # A group's name stands for those of its commands that have the option.
    groups = {name.split()[0] for name in takers}
    assert {name for name in named - takers if name.split()[0] not in groups} <= {"doctor"}
