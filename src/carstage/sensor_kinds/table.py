"""The table: the rows of Car-STAGE, then those that other packages register."""

from __future__ import annotations

from typing import Dict, Iterable, List, Optional, Tuple

from carstage.sensor_kinds.built_in import BUILT_IN, FOR_LABELS
from carstage.sensor_kinds.installed import InstalledModules
from carstage.sensor_kinds.model import CAMERAS, CLOUDS, ROWS, SensorKind

ENTRY_POINT_GROUP = "carstage.sensors"
"""Group of entry points; each names a module that registers kinds."""

_kinds: Dict[str, SensorKind] = {}
_for_labels: Dict[str, SensorKind] = {kind.name: kind for kind in FOR_LABELS}
_installed = InstalledModules(ENTRY_POINT_GROUP)


def register(kind: SensorKind) -> None:
    """Add a kind.

    A kind of another package must be registered before ``carstage.config`` is imported: by an
    entry point of the group ``carstage.sensors`` it always is.

    Raises:
        ValueError: the name or the blueprint is taken, or the row contradicts itself.
    """
    taken = _kinds.get(kind.name) or _for_labels.get(kind.name)
    if taken == kind:
        return
    if taken is not None:
        raise ValueError("sensor kind %r is registered already" % kind.name)
    if not kind.name.isidentifier() or kind.name != kind.name.lower():
        raise ValueError("sensor kind %r: use small letters, digits and '_'" % kind.name)
    for other in (*_kinds.values(), *_for_labels.values()):
        if other.blueprint == kind.blueprint and not (kind.recorded or other.recorded):
            raise ValueError("sensor kind %r: %s is %r" % (kind.name, kind.blueprint, other.name))
    if kind.content not in CAMERAS + CLOUDS + ROWS:
        raise ValueError("sensor kind %r: no content is called %r" % (kind.name, kind.content))
    if kind.has_rows == bool(kind.codecs):
        raise ValueError(
            "sensor kind %r: %s"
            % (kind.name, "a table has no codec" if kind.codecs else "no codec")
        )
    _kinds[kind.name] = kind


def kinds() -> Tuple[SensorKind, ...]:
    """All kinds that a rig may have, those of Car-STAGE first, then those of installed packages."""
    _installed.load()
    return tuple(_kinds.values())


def registered_kinds() -> Tuple[str, ...]:
    """Names of the kinds so far, those for labels too, without a look at what is installed."""
    return (*_kinds, *_for_labels)


def known_kind(name: str) -> Optional[SensorKind]:
    """The kind of that name, None where there is none."""
    if name in _for_labels:
        return _for_labels[name]
    if name not in _kinds:
        _installed.load()
    return _kinds.get(name)


def sensor_kind(name: str) -> SensorKind:
    """The kind of that name.

    Raises:
        KeyError: there is none.
    """
    kind = known_kind(name)
    if kind is None:
        raise KeyError("no sensor kind %r; known are %s" % (name, ", ".join(_kinds)))
    return kind


def content_of(name: str) -> str:
    """What a frame of a kind is; empty for a kind that is not known here."""
    kind = known_kind(name)
    return "" if kind is None else kind.content


def plugins_of(names: Iterable[str]) -> List[str]:
    """Modules that a collector imports so that it knows these kinds."""
    return sorted({sensor_kind(name).plugin for name in names} - {""})


def simulator_plugins() -> List[str]:
    """Modules that the embedded simulator imports so that it has the sensors of all kinds."""
    return sorted({kind.simulator for kind in kinds()} - {""})


for _kind in BUILT_IN:
    register(_kind)
