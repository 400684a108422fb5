"""Settings of a section that names a class of the user's: a driver, a server."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator

from carstage.config.fields import problem, setting, shortened
from carstage.spec.drivers import MOST_PARAMETERS, is_class_name


def _checked_names(parameters: dict[str, Any]) -> dict[str, Any]:
    for name in parameters:
        if not name.isidentifier():
            hint = "Use letters, digits and '_'."
            raise problem("this cannot be an argument's name.", hint, name)
    return parameters


def _checked_values(values: Any) -> Any:
    for name, value in values.items() if isinstance(values, dict) else ():
        if not isinstance(value, bool | int | float | str):
            message = f"{shortened(repr(value))} is no word, no number, and not true or false."
            raise problem(message, "Give one of these.", name)
    return values


Values = Annotated[dict[str, bool | int | float | str], BeforeValidator(_checked_values)]
"""Plain values by their names."""
Parameters = Annotated[Values, AfterValidator(_checked_names)]
"""Keyword arguments of a class."""


def parameters(group: str) -> Any:
    """The setting of :data:`Parameters`, in a group of the page."""
    return setting(
        dict,
        title="Parameters",
        description="Keyword arguments of the class: words, numbers, `true` or `false`.",
        group=group,
        max_length=MOST_PARAMETERS,
    )


def checked_class_name(name: str, hint: str) -> str:
    """A class's name as it is.

    Raises:
        PydanticCustomError: it is not ``module:Class``; ``hint`` says what to write.
    """
    if not is_class_name(name):
        raise problem(f"{shortened(repr(name))} is not module:Class.", hint)
    return name
