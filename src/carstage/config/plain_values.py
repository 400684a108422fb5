"""Documents of plain values, of a size that a configuration may have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from carstage.config.fields import path_text
from carstage.errors import ConfigError

MOST_VALUES = 50_000
"""Of a document, each counted where it stands: YAML's aliases repeat a value for a few bytes."""
MOST_CHARACTERS = 4_000_000
DEEPEST = 40
_MOST_BITS = 1024
_SMALLEST_PRINTABLE = " "
_ALLOWED_CONTROLS = "\t\n\r"


def plain_copy(document: object) -> Any:
    """A copy of a document in which no two places share a value.

    Args:
        document: mappings with words as keys, lists, words, numbers, booleans and None.

    Returns:
        The same of ``dict``, ``list``, ``str``, ``int``, ``float``, ``bool`` and None.

    Raises:
        ConfigError: something else stands in it, or more than any configuration holds; the message
            begins with the value's path.
    """
    return _Copy().of(document, ())


class _Copy:
    """One copy under way, with what it has copied so far."""

    def __init__(self) -> None:
        self._values = 0
        self._characters = 0

    def of(self, value: object, path: tuple[str | int, ...]) -> Any:
        """The copy of the value at a path."""
        self._values += 1
        if self._values > MOST_VALUES:
            raise _refusal(
                path,
                f"the document holds more than {MOST_VALUES} values up to here.",
                "Is it the right file? An alias such as *name repeats all that it stands for.",
            )
        if value is None or isinstance(value, bool):
            return value
        if isinstance(value, str):
            return self._text(value, path)
        if isinstance(value, int):
            return _integer(value, path)
        if isinstance(value, float):
            return float(value)
        if len(path) >= DEEPEST:
            raise _refusal(
                path, f"this is nested more than {DEEPEST} deep.", "Is it the right file?"
            )
        if isinstance(value, Mapping):
            return {
                self._key(key, path): self.of(entry, (*path, str(key)))
                for key, entry in value.items()
            }
        if isinstance(value, list | tuple):
            return [self.of(entry, (*path, index)) for index, entry in enumerate(value)]
        raise _refusal(
            path,
            f"a value of type {type(value).__name__} has no place in a configuration.",
            "Give a number, a word, true, false, null, a list, or a mapping of keys to values.",
        )

    def _key(self, key: object, path: tuple[str | int, ...]) -> str:
        if not isinstance(key, str):
            raise _refusal(path, f"the key {key!r:.60} is not a word.", "Keys are words.")
        return self._text(key, path)

    def _text(self, text: str, path: tuple[str | int, ...]) -> str:
        self._characters += len(text)
        if self._characters > MOST_CHARACTERS:
            raise _refusal(
                path,
                f"the document holds more than {MOST_CHARACTERS} characters up to here.",
                "Is it the right file? An alias such as *name repeats all that it stands for.",
            )
        for character in text:
            if character < _SMALLEST_PRINTABLE and character not in _ALLOWED_CONTROLS:
                raise _refusal(
                    path, f"it holds the control character {character!r}.", "Leave it out."
                )
            if "\ud800" <= character <= "\udfff":
                raise _refusal(
                    path, "it holds what is no character of Unicode.", "Write it as UTF-8 text."
                )
        return str(text)


def _integer(value: int, path: tuple[str | int, ...]) -> int:
    if value.bit_length() > _MOST_BITS:
        digits = int(value.bit_length() * 0.30103) + 1
        raise _refusal(
            path, f"a number of about {digits} digits is too large.", "Give a smaller one."
        )
    return int(value)


def _refusal(path: tuple[str | int, ...], message: str, hint: str) -> ConfigError:
    where = f"{path_text(path)}: " if path else ""
    return ConfigError(where + message, hint, ((path, message, hint),))
