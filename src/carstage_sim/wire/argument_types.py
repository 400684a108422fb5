"""Arguments of the types that a handler declares, as rpclib demands them of C++ functions.

A handler's annotations say what it takes. Clients encode C++ types, so an ``int`` never arrives as
a float and a flag never as a number; what does is not from a client.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any

from carstage_sim.wire.errors import CallError
from carstage_sim.wire.rpc import shortened

_LARGEST = 1e9


_TYPES: dict[str, tuple[type, ...]] = {
    "bool": (bool,),
    "int": (int,),
    "float": (int, float),
    "str": (str,),
    "list": (list,),
}
_ELEMENTS: dict[str, type] = {"list[int]": int, "list[str]": str}
_WORDS = {"float": f"a finite number up to {_LARGEST:g}"}


def client_parameters(handler: Callable[..., Any]) -> list[inspect.Parameter]:
    """The parameters of a handler that a client fills: all but the first, which is the call."""
    return list(inspect.signature(handler).parameters.values())[1:]


def argument_check(handler: Callable[..., Any]) -> Callable[[str, Sequence[Any]], None]:
    """A function that refuses arguments which do not fit a handler's number and types.

    It takes the name of the call and the client's arguments, and raises :class:`CallError`.
    Annotations other than flags, numbers, text and lists are left to the handler, and of lists the
    elements that are neither text nor whole numbers.
    """
    parameters = client_parameters(handler)
    unbounded = any(parameter.kind is parameter.VAR_POSITIONAL for parameter in parameters)
    positional = [p for p in parameters if p.kind is not p.VAR_POSITIONAL]
    fewest = sum(parameter.default is parameter.empty for parameter in positional)
    most = math.inf if unbounded else len(positional)
    kinds = [_kind(str(parameter.annotation)) for parameter in positional]
    checked = [
        (position, _TYPES[kind], kind == "float")
        for position, kind in enumerate(kinds)
        if kind in _TYPES
    ]
    lists = [
        (position, _ELEMENTS[annotation])
        for position, annotation in enumerate(str(p.annotation) for p in positional)
        if annotation in _ELEMENTS
    ]

    def check(name: str, arguments: Sequence[Any]) -> None:
        count = len(arguments)
        if not fewest <= count <= most:
            raise CallError(f"{name} takes {fewest} arguments, got {count}")
        for position, types, is_number in checked:
            if position >= count:
                break
            argument = arguments[position]
            # NaN is not within bounds either.
            if type(argument) in types and (not is_number or -_LARGEST <= argument <= _LARGEST):
                continue
            wanted = _WORDS.get(kinds[position], kinds[position])
            raise CallError(
                f"argument {position + 1} of {name} must be {wanted}, got {shortened(argument)}"
            )
        for position, element in lists:
            if position < count and any(type(one) is not element for one in arguments[position]):
                raise CallError(
                    f"argument {position + 1} of {name} must be a list of {element.__name__}, got "
                    f"{shortened(arguments[position])}"
                )

    return check


def _kind(annotation: str) -> str:
    """``list`` of ``list[float]``; of a choice of types nothing that is checked."""
    return "" if "|" in annotation else annotation.partition("[")[0]
