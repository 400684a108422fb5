"""What a user calls the classes of an export: a file that gives each one a target, or none."""

from __future__ import annotations

import errno
import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from carstage.errors import BadInputError
from carstage.exporters.classes import CLASSES
from carstage.files.bounded import read_bounded

_MOST_BYTES: Final = 1 << 20
_MOST_NUMBER: Final = 1_000_000
_NAME: Final = re.compile(r"[^\s\x00-\x1f\x7f](?:[^\x00-\x1f\x7f]{0,98}[^\s\x00-\x1f\x7f])?")


@dataclass(frozen=True, slots=True)
class Target:
    """A class of the export.

    Attributes:
        name: what the format calls it.
        id: its number there; ``None``: as the format counts.
        blueprint: a pattern that the object's blueprint has to contain; empty: any.
    """

    name: str
    id: int | None = None
    blueprint: str = ""


@dataclass(frozen=True, slots=True)
class ClassMap:
    """Targets of Car-STAGE's classes; a class that it does not name is left out.

    Attributes:
        targets: by class, in the order of the file.
    """

    targets: tuple[tuple[str, Target], ...]

    @classmethod
    def of(cls, document: Any, source: str = "class-map") -> ClassMap:
        """Check a mapping.

        Args:
            document: by Car-STAGE class a name, or ``{name: NAME, id: NUMBER}``, or ``None`` to
                leave the class out. Classes may share a target.
            source: its name, for messages.

        Raises:
            BadInputError: an unknown class, no name, numbers that are not unique, or no target.
        """
        if not isinstance(document, Mapping):
            raise BadInputError(
                f"{source} is no mapping of classes.", "Write lines such as `car: vehicle`."
            )
        targets = []
        for name, given in document.items():
            _check_class(name, source)
            if given is not None:
                targets.append((name, _target(name, given, source)))
        if not targets:
            raise BadInputError(
                f"{source} leaves out every class.", "Give one class a name at least."
            )
        _check_numbers([target for _, target in targets], source)
        return cls(tuple(targets))

    @property
    def classes(self) -> frozenset[str]:
        """The classes that have a target."""
        return frozenset(name for name, _ in self.targets)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the targets, once each, in the order of the file."""
        return tuple(dict.fromkeys(target.name for _, target in self.targets))

    @property
    def has_numbers(self) -> bool:
        """Whether the file numbers its targets."""
        return self.targets[0][1].id is not None

    def target(self, name: str, blueprint: str) -> Target | None:
        """The target of an object by its class and blueprint; ``None``: it is left out."""
        found = dict(self.targets).get(name)
        if found is None or not re.search(found.blueprint, blueprint, re.IGNORECASE):
            return None
        return found

    def numbers(self, first: int) -> dict[str, int]:
        """The number of each target by its name: those of the file, else counted from ``first``."""
        if self.has_numbers:
            return {t.name: t.id for _, t in self.targets if t.id is not None}
        return {name: number for number, name in enumerate(self.names, first)}

    def numbers_of_classes(self, first: int) -> dict[str, int]:
        """The number of each Car-STAGE class, likewise."""
        numbers = self.numbers(first)
        return {name: numbers[target.name] for name, target in self.targets}


def read_class_map(path: str | Path) -> ClassMap:
    """Read a file for ``--class-map``.

    Args:
        path: YAML, see ``ClassMap.of``.

    Raises:
        BadInputError: it cannot be read, or is no such mapping; the message names the file.
    """
    # Late: the configuration's modules take long, and the command line's help needs none.
    from carstage.config.yaml_text import parse_yaml

    source = f"class-map: {path}"
    try:
        content = read_bounded(Path(path), _MOST_BYTES)
    except OSError as error:
        if error.errno == errno.EFBIG:
            raise BadInputError(
                f"{source} is larger than 1 MiB.", "Name a file of a few lines."
            ) from error
        raise BadInputError(
            f"{source} cannot be read: {error.strerror}.", "Name a YAML file."
        ) from error
    try:
        text = content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise BadInputError(f"{source} is no UTF-8 text.", "Name a YAML file.") from error
    return ClassMap.of(parse_yaml(text, source), source)


def _check_class(name: Any, source: str) -> None:
    if name in CLASSES:
        return
    near = get_close_matches(str(name), CLASSES, n=1)
    hint = f"Did you mean {near[0]!r}? " if near else ""
    raise BadInputError(
        f"{source}: {str(name)[:40]!r} is no class.", f"{hint}Known: {', '.join(CLASSES)}."
    )


def _target(name: str, given: Any, source: str) -> Target:
    if isinstance(given, Mapping) and set(given) <= {"name", "id"} and "name" in given:
        target, number = given["name"], given.get("id")
    else:
        target, number = given, None
    if not isinstance(target, str) or not _NAME.fullmatch(target):
        raise BadInputError(
            f"{source}: the target of {name} is no name.",
            "Give a name in quotes, {name: NAME, id: NUMBER}, or null to leave the class out.",
        )
    if number is not None and (type(number) is not int or not 0 <= number <= _MOST_NUMBER):
        raise BadInputError(
            f"{source}: the id of {name} is no number from 0 to {_MOST_NUMBER}.",
            "Give a whole number, or no id.",
        )
    return Target(target, number)


def _check_numbers(targets: list[Target], source: str) -> None:
    """Each target has one number, each number one target, or no target has any."""
    numbered = [target for target in targets if target.id is not None]
    if numbered and len(numbered) < len(targets):
        without = next(target.name for target in targets if target.id is None)
        raise BadInputError(
            f"{source}: {without!r} has no id, and others have one.", "Give all of them, or none."
        )
    by_name = {target.name: target.id for target in numbered}
    by_number = {target.id: target.name for target in numbered}
    for target in numbered:
        if by_name[target.name] != target.id:
            raise BadInputError(
                f"{source}: {target.name!r} has the ids {target.id} and {by_name[target.name]}.",
                "Give it one.",
            )
        if by_number[target.id] != target.name:
            raise BadInputError(
                f"{source}: {target.name!r} and {by_number[target.id]!r} have the id {target.id}.",
                "Give each its own.",
            )
