"""A server that is a class of the user's: found by its name, made with its parameters."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from carstage.errors import BadInputError
from carstage.server.base import Server


def load_server(
    name: str, folders: Sequence[str], parameters: Mapping[str, Any], log_path: Path | None
) -> Server:
    """A user's server, not started.

    Args:
        name: ``module:Class``.
        folders: where its module is looked for before the installed packages; absolute.
        parameters: keyword arguments of the class.
        log_path: the class's keyword argument of that name: where its output goes; None leaves
            that to it.

    Raises:
        BadInputError: it is not found, is no :class:`Server`, or raised; names the field.
    """
    cls = _class_of(name, folders)
    with _blamed(name, "when it was made"):
        server = cls(log_path=log_path, **parameters)
    assert isinstance(server, Server)
    return server


def _class_of(name: str, folders: Sequence[str]) -> Any:
    module_name, _, class_name = name.partition(":")
    sys.path[:0] = [folder for folder in folders if folder not in sys.path]
    importlib.invalidate_caches()
    with _blamed(name, f"when {module_name} was imported"):
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            if not error.name or not f"{module_name}.".startswith(f"{error.name}."):
                raise  # the module is there, and lacks another one
            raise BadInputError(
                f"server.name: there is no module {error.name}.",
                f"It was looked for in {', '.join(folders) or 'no folder'}, then among the "
                "installed packages; name its folder in server.folders.",
            ) from error
    cls = getattr(module, class_name, None)
    if not (isinstance(cls, type) and issubclass(cls, Server)):
        what = "has no" if cls is None else "has no server"
        raise BadInputError(
            f"server.name: {module.__file__} {what} {class_name}.",
            "Name a class that is derived from carstage.server.Server.",
        )
    return cls


@contextmanager
def _blamed(name: str, when: str) -> Iterator[None]:
    """What the user's code raises is said to be its error.

    Raises:
        BadInputError: something was raised.
    """
    try:
        yield
    except BadInputError:
        raise
    except Exception as error:
        raise BadInputError(
            f"server.name: {name} raised {type(error).__name__} {when}: {error}.",
            "Correct the class, or its server.parameters.",
        ) from error
