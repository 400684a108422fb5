"""Reading JSON objects field by field, every complaint with the field's path."""

from __future__ import annotations

import json
import math
import sys
from typing import Any, Dict, List, Optional, Tuple, Union


class SpecError(ValueError):
    """A specification or a plan is not valid; the message begins with the field's path.

    Args:
        message: one sentence: which field, and what is wrong with it.
        hint: one sentence: what to do next.
    """

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint


class Fields:
    """Reads the fields of one JSON object and names the field's path in every complaint."""

    def __init__(self, value: Any, path: str) -> None:
        if not isinstance(value, dict):
            raise SpecError("%s: must be an object, not %s." % (path or "plan", shown(value)))
        self._fields = value
        self._path = path

    def path(self, name: str) -> str:
        """Path of a field, as complaints begin with it."""
        joint = "." if self._path and not name.startswith("[") else ""
        return self._path + joint + name

    def __contains__(self, name: str) -> bool:
        return self._fields.get(name) is not None

    def any(self, name: str) -> Any:
        """Any value; the field must be there."""
        if name not in self._fields:
            raise SpecError("%s: is missing." % self.path(name))
        return self._fields[name]

    def object(self, name: str) -> Fields:
        """An object."""
        return Fields(self.any(name), self.path(name))

    def list(self, name: str) -> List[Any]:
        """A list."""
        value = self.any(name)
        if not isinstance(value, list):
            raise SpecError("%s: must be a list, not %s." % (self.path(name), shown(value)))
        return value

    def objects(self, name: str) -> List[Fields]:
        """A list of objects; none when the field is left out."""
        values = self.list(name) if name in self else []
        return [Fields(value, "%s[%d]" % (self.path(name), i)) for i, value in enumerate(values)]

    def text(self, name: str, choices: Tuple[str, ...] = ()) -> str:
        """A text that is not empty."""
        value = self.any(name)
        if not isinstance(value, str) or not value:
            raise SpecError("%s: must be a text, not %s." % (self.path(name), shown(value)))
        if choices and value not in choices:
            raise SpecError(
                "%s: %r is not known." % (self.path(name), value),
                "Known are: %s." % ", ".join(choices),
            )
        return value

    def spread(self, name: str, least: float, most: float) -> Union[float, Tuple[float, float]]:
        """A number within bounds, or a list of two: the low and the high end."""
        value = self.any(name)
        if not isinstance(value, list):
            return self.number(name, least=least, most=most)
        if len(value) != 2:
            raise SpecError("%s: must be [low, high]." % self.path(name))
        ends = Fields({"[0]": value[0], "[1]": value[1]}, self.path(name))
        low, high = (ends.number(end, least=least, most=most) for end in ("[0]", "[1]"))
        if low > high:
            raise SpecError("%s: %g is above %g." % (self.path(name), low, high))
        return (low, high)

    def numbers(self, name: str) -> Dict[str, float]:
        """An object whose values are numbers."""
        section = self.object(name)
        return {key: section.number(key) for key in section._fields}

    def texts(self) -> Dict[str, str]:
        """This object's values, all of them texts that are not empty."""
        return {key: self.text(key) for key in self._fields}

    def words(self, name: str, choices: Tuple[str, ...] = ()) -> Tuple[str, ...]:
        """A list of texts that are not empty; none when the field is left out."""
        given = self.list(name) if name in self else []
        words = Fields({"[%d]" % i: word for i, word in enumerate(given)}, self.path(name))
        return tuple(words.text(place, choices) for place in words._fields)

    def flag(self, name: str) -> bool:
        """True or false."""
        value = self.any(name)
        if not isinstance(value, bool):
            raise SpecError("%s: must be true or false." % self.path(name))
        return value

    def integer(self, name: str, least: int, most: Optional[int] = None) -> int:
        """A whole number within bounds."""
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, int):
            raise SpecError("%s: must be a whole number, not %s." % (self.path(name), shown(value)))
        if value < least or (most is not None and value > most):
            raise SpecError("%s: %d is out of range." % (self.path(name), value))
        return value

    def number(
        self,
        name: str,
        above: Optional[float] = None,
        *,
        least: float = -math.inf,
        most: float = math.inf,
    ) -> float:
        """A finite number, above a bound or within two."""
        value = self.any(name)
        if not is_number(value):
            raise SpecError("%s: must be a number, not %s." % (self.path(name), shown(value)))
        if above is not None and value <= above:
            raise SpecError("%s: must be above %g, not %g." % (self.path(name), above, value))
        if not least <= value <= most:
            raise SpecError("%s: %g is out of range." % (self.path(name), value))
        return float(value)


def is_number(value: Any) -> bool:
    """Whether a value that was read from JSON is a finite number."""
    return type(value) in (int, float) and abs(value) <= sys.float_info.max


def shown(value: Any) -> str:
    """A value as complaints show it."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else text[:37] + "..."
