"""The one table of sensor kinds: what every part of Car-STAGE knows of a kind stands in its row.

``model`` says what a row holds, ``attributes`` and ``built_in`` are the rows, ``table`` lists them,
``installed`` finds those of other packages.
A package adds a kind with :func:`register`.
Standard library only, Python 3.8: the collector reads the table too.
"""

from carstage.sensor_kinds.installed import InstalledModules, import_plugins, installed_entries
from carstage.sensor_kinds.model import Attribute, AttributeSet, Column, SensorKind, load_object
from carstage.sensor_kinds.table import (
    ENTRY_POINT_GROUP,
    content_of,
    kinds,
    known_kind,
    plugins_of,
    register,
    registered_kinds,
    sensor_kind,
    simulator_plugins,
)

__all__ = [
    "ENTRY_POINT_GROUP",
    "Attribute",
    "AttributeSet",
    "Column",
    "InstalledModules",
    "SensorKind",
    "content_of",
    "import_plugins",
    "installed_entries",
    "kinds",
    "known_kind",
    "load_object",
    "plugins_of",
    "register",
    "registered_kinds",
    "sensor_kind",
    "simulator_plugins",
]
