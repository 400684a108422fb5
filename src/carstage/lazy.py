"""Imports that wait until they are needed: names of packages (PEP 562), and pandas."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from typing import Any


def lazy_names(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """A module's ``__getattr__`` that finds public names in the modules that have them.

    Args:
        package: name of the package.
        modules: by module of the package, the names that it has, separated by spaces. A name that
            begins with a dot is that of a package beside it.
    """
    places = {name: module for module, names in modules.items() for name in names.split()}

    def find(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f".{places[name]}", package), name)

    return find


class _NoPandas:
    @staticmethod
    def find_spec(name: str, *_: object) -> None:
        if name == "pandas":
            raise ImportError("Arrow asks for it, and nothing here needs it")


@cache
def keep_pandas_lazy() -> None:
    """Make Arrow not import pandas for the first list that it makes an array of.

    Where pandas is installed that takes half a second of each process. Arrow asks once: it is told
    that there is none. What needs pandas, such as ``Table.to_pandas``, imports it all the same.
    """
    import pyarrow as pa

    if "pandas" not in sys.modules:
        sys.meta_path.insert(0, _NoPandas)
        try:
            pa.array([0])
        finally:
            sys.meta_path.remove(_NoPandas)
