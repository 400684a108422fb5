"""Reading JSON objects field by field, every complaint with the field's path."""

from __future__ import annotations

import json
from typing import Any, List, Optional, Tuple

from carstage.collector.internals.errors import PlanError


class Fields:
    """Reads the fields of one JSON object and names the field's path in every complaint."""

    def __init__(self, value: Any, path: str) -> None:
        if not isinstance(value, dict):
            raise PlanError("%s: must be an object, not %s." % (path or "plan", shown(value)))
        self._fields = value
        self._path = path

    def path(self, name: str) -> str:
        """Path of a field, as complaints begin with it."""
        return "%s.%s" % (self._path, name) if self._path else name

    def __contains__(self, name: str) -> bool:
        return self._fields.get(name) is not None

    def any(self, name: str) -> Any:
        """Any value; the field must be there."""
        if name not in self._fields:
            raise PlanError("%s: is missing." % self.path(name))
        return self._fields[name]

    def object(self, name: str) -> Fields:
        """An object."""
        return Fields(self.any(name), self.path(name))

    def list(self, name: str) -> List[Any]:
        """A list."""
        value = self.any(name)
        if not isinstance(value, list):
            raise PlanError("%s: must be a list, not %s." % (self.path(name), shown(value)))
        return value

    def objects(self, name: str) -> List[Fields]:
        """A list of objects; none when the field is left out."""
        values = self.list(name) if name in self else []
        return [Fields(value, "%s[%d]" % (self.path(name), i)) for i, value in enumerate(values)]

    def text(self, name: str, choices: Tuple[str, ...] = ()) -> str:
        """A text that is not empty."""
        value = self.any(name)
        if not isinstance(value, str) or not value:
            raise PlanError("%s: must be a text, not %s." % (self.path(name), shown(value)))
        if choices and value not in choices:
            raise PlanError(
                "%s: %r is not known." % (self.path(name), value),
                "Known are: %s." % ", ".join(choices),
            )
        return value

    def spread(self, name: str) -> Tuple[float, float]:
        """A number, or a list of two: the low and the high end."""
        value = self.any(name)
        if not isinstance(value, list):
            return (self.number(name), self.number(name))
        if len(value) != 2:
            raise PlanError("%s: must be [low, high]." % self.path(name))
        ends = Fields({"[0]": value[0], "[1]": value[1]}, self.path(name))
        low, high = ends.number("[0]"), ends.number("[1]")
        if low > high:
            raise PlanError("%s: %g is above %g." % (self.path(name), low, high))
        return (low, high)

    def flag(self, name: str) -> bool:
        """True or false."""
        value = self.any(name)
        if not isinstance(value, bool):
            raise PlanError("%s: must be true or false." % self.path(name))
        return value

    def integer(self, name: str, least: int, most: Optional[int] = None) -> int:
        """A whole number within bounds."""
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, int):
            raise PlanError("%s: must be a whole number, not %s." % (self.path(name), shown(value)))
        if value < least or (most is not None and value > most):
            raise PlanError("%s: %d is out of range." % (self.path(name), value))
        return value

    def number(self, name: str, above: Optional[float] = None) -> float:
        """A number, above a bound."""
        value = self.any(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value != value:
            raise PlanError("%s: must be a number, not %s." % (self.path(name), shown(value)))
        if above is not None and value <= above:
            raise PlanError("%s: must be above %g, not %g." % (self.path(name), above, value))
        return float(value)


def shown(value: Any) -> str:
    """A value as complaints show it."""
    text = json.dumps(value, default=str)
    return text if len(text) <= 40 else text[:37] + "..."
