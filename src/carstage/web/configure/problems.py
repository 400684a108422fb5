"""What is wrong with a configuration, field by field, as the form names its fields."""

from __future__ import annotations

import re

from carstage.errors import ConfigError
from carstage.web.messages import FieldProblem

_PATH = re.compile(r"([A-Za-z_]\w*(?:\.[\w-]+|\[\d+\])*): ", re.ASCII)
_STEP = re.compile(r"\[(\d+)\]|\.?([\w-]+)")


def problems_of(error: ConfigError) -> list[FieldProblem]:
    """The problems that an error names; one of the whole document where it names no field."""
    if error.problems:
        return [
            FieldProblem(path=list(path), message=message, hint=hint)
            for path, message, hint in error.problems
        ]
    match = _PATH.match(error.message)
    if match is None:
        return [FieldProblem(path=[], message=error.message, hint=error.hint)]
    path: list[str | int] = [
        int(number) if number else name for number, name in _STEP.findall(match[1])
    ]
    return [FieldProblem(path=path, message=error.message[match.end() :], hint=error.hint)]
