"""Everything that ``dir(carla)`` shows, found by looking, so that no name can be forgotten."""

from __future__ import annotations

from functools import lru_cache

import carla

_MODULES = {"": carla, "command.": carla.command}
_BOOST_ENUM = ("names", "values")


@lru_cache(maxsize=None)
def surface() -> tuple[str, ...]:
    """Names such as ``Vehicle.open_door`` and ``command.SpawnActor.then``, sorted.

    A class without members of its own is listed by its own name. What every enumeration has
    (``names``, ``values``) and Python's special methods are left out.
    """
    found: list[str] = []
    for prefix, module in _MODULES.items():
        for name in dir(module):
            kind = getattr(module, name)
            if name.startswith("_") or not isinstance(kind, type):
                continue
            members = [
                f"{prefix}{name}.{member}"
                for member in vars(kind)
                if not member.startswith("__") and member not in _BOOST_ENUM
            ]
            found += members or [f"{prefix}{name}"]
    return tuple(sorted(found))


def has(name: str) -> bool:
    """Whether this client has a name, such as ``Waypoint.is_rht``; older ones lack some."""
    return name in surface()
