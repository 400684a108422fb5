"""Finding the user's driver, and saying what went wrong in it."""

from __future__ import annotations

import importlib
import inspect
import sys
import traceback
from contextlib import contextmanager
from typing import Any, Iterator, Sequence, Type

from carstage.collector.drivers.base import Driver
from carstage.collector.internals.errors import CollectorError, DriverError, ran_out_of_time
from carstage.spec import ClassDriverSpec


def load_driver(spec: ClassDriverSpec, folders: Sequence[str]) -> Driver:
    """The user's driver, made with its parameters.

    Args:
        spec: names it.
        folders: where modules are looked for that are not installed.

    Raises:
        DriverError: it is not found, is no :class:`Driver`, or raised.
    """
    cls = _class_of(spec.name, folders)
    with blamed(spec.name, "when it was made"):
        return cls(**spec.parameters)


def _class_of(name: str, folders: Sequence[str]) -> Type[Driver]:
    module_name, _, class_name = name.partition(":")
    sys.path += [folder for folder in folders if folder not in sys.path]
    importlib.invalidate_caches()
    with blamed(name, "when %s was imported" % module_name):
        try:
            module = importlib.import_module(module_name)
        except ModuleNotFoundError as error:
            if not error.name or not (module_name + ".").startswith(error.name + "."):
                raise  # the module is there, and lacks another one
            raise DriverError(
                "ego.driver: there is no module %s for the collector's Python, %s."
                % (error.name, sys.executable),
                "It was looked for among the installed packages, then in %s; name its folder in "
                "ego.driver.folders." % (", ".join(folders) or "no folder"),
            ) from error
    cls = getattr(module, class_name, None)
    if cls is None:
        raise DriverError(
            "ego.driver: %s has no %s." % (_file_of(module), class_name),
            "Correct the name behind the colon.",
        )
    if not (inspect.isclass(cls) and issubclass(cls, Driver)):
        raise DriverError(
            "ego.driver: %s is no driver." % name,
            "Derive the class from carstage.collector.drivers.Driver.",
        )
    return cls


@contextmanager
def blamed(name: str, when: str) -> Iterator[None]:
    """Have what the driver's code raises told as its error: what, where and when.

    Args:
        name: of the driver.
        when: it happened, in words.

    Raises:
        DriverError: something was raised, other than that the server did not answer in time.
    """
    try:
        yield
    except CollectorError:
        raise
    except (Exception, SystemExit) as error:
        if ran_out_of_time(error):
            raise
        raise DriverError(
            "ego.driver: %s raised %s %s, %s." % (name, _words(error), when, _place(error)),
            "The whole traceback is in the collector's log, collector.log of the run.",
        ) from error


def _words(error: BaseException) -> str:
    text = " ".join(str(error).split())
    kind = type(error).__name__
    return "%s: %s" % (kind, text) if text else kind


def _place(error: BaseException) -> str:
    """The innermost place of the traceback outside of this module and of the import machinery."""
    if isinstance(error, SyntaxError) and error.filename:
        return "in %s, line %s" % (error.filename, error.lineno)
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if frame.filename != __file__ and not frame.filename.startswith("<frozen")
    ]
    if not frames:
        return "in its call"
    last = frames[-1]
    return "in %s, line %s, %s" % (last.filename, last.lineno, last.name)


def _file_of(module: Any) -> str:
    return str(getattr(module, "__file__", None) or module.__name__)
