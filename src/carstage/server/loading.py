"""A server that is a class of the user's: found by its name, made with its parameters."""

from __future__ import annotations

import functools
import importlib
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from carstage.errors import BadInputError, CarStageError, ServerError
from carstage.plan import ServerFacts
from carstage.server.base import Endpoint, Server

_RESULTS: Final[Mapping[str, tuple[type, ...]]] = {
    "start": (Endpoint,),
    "stop": (),
    "kill": (),
    "alive": (bool,),
    "probe": (str,),
    "facts": (ServerFacts,),
    "log_tail": (str,),
}
"""What a run calls of a server, to the types of what comes back; empty: it does not matter."""


def load_server(
    name: str, folders: Sequence[str], parameters: Mapping[str, Any], log_path: Path | None
) -> Server:
    """A user's server, not started.

    Args:
        name: ``module:Class``.
        folders: where its module is looked for after the installed packages, so that nothing in
            them takes the place of a module that others need; absolute.
        parameters: keyword arguments of the class.
        log_path: the class's keyword argument of that name: where its output goes; None leaves
            that to it.

    Raises:
        BadInputError: it is not found, is no :class:`Server`, or raised; names the field.

    Returns:
        The server. Where a method of it raises another error than Car-STAGE's, or returns what it
        must not, it raises a :class:`ServerError` that names class, method, cause and place.
    """
    cls = _with_explained_errors(_class_of(name, folders), name)
    with _blamed(name, "when it was made"):
        server = cls(log_path=log_path, **parameters)
    assert isinstance(server, Server)
    return server


def _class_of(name: str, folders: Sequence[str]) -> Any:
    module_name, _, class_name = name.partition(":")
    sys.path += [folder for folder in folders if folder not in sys.path]
    importlib.invalidate_caches()
    with _blamed(name, f"when {module_name} was imported"):
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            if not error.name or not f"{module_name}.".startswith(f"{error.name}."):
                raise  # the module is there, and lacks another one
            raise BadInputError(
                f"server.name: there is no module {error.name}.",
                "It was looked for among the installed packages, then in "
                f"{', '.join(folders) or 'no folder'}; name its folder in server.folders.",
            ) from error
    cls = getattr(module, class_name, None)
    if not (isinstance(cls, type) and issubclass(cls, Server)):
        what = "has no" if cls is None else "has no server"
        raise BadInputError(
            f"server.name: {module.__file__} {what} {class_name}.",
            "Name a class that is derived from carstage.server.Server. Where that is another file "
            "than yours, give your module another name: installed ones come first.",
        )
    return cls


def _with_explained_errors(cls: Any, name: str) -> Any:
    """The class, with what its methods raise and return checked; see :func:`load_server`."""
    methods = {
        method: _explained(getattr(cls, method), f"{name}.{method}()", types)
        for method, types in _RESULTS.items()
    }
    return type(cls)(cls.__name__, (cls,), {"__module__": cls.__module__, **methods})


def _explained(
    method: Callable[..., Any], what: str, types: tuple[type, ...]
) -> Callable[..., Any]:
    @functools.wraps(method)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            result = method(*arguments, **named)
        except CarStageError:
            raise
        except (Exception, SystemExit) as error:
            raise ServerError(
                f"server.name: {what} raised {type(error).__name__}: "
                f"{' '.join(str(error).split()) or 'nothing more is known'}, {_place(error)}.",
                "Correct the class. For what is no fault of it, let it raise "
                "carstage.errors.ServerError, with a sentence on what to do.",
            ) from error
        if types and not isinstance(result, types):
            raise ServerError(
                f"server.name: {what} returned {type(result).__name__}, not {types[0].__name__}.",
                "Correct the class; docs/how-to/add-a-simulator.md has an example.",
            )
        return result

    return call


def _place(error: BaseException) -> str:
    last = traceback.extract_tb(error.__traceback__)[-1]
    return f"in {last.filename}, line {last.lineno}"


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
