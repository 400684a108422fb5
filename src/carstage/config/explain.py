"""From pydantic's errors to sentences that begin with the field's path."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from carstage.config.drivers import DRIVER_KINDS
from carstage.config.drones import DRONE_PATH_KINDS
from carstage.config.fields import path_text, shortened, unknown
from carstage.config.lenses import LENS_MODELS
from carstage.config.scene import SCENARIO_KINDS
from carstage.config.sensors import SENSOR_KINDS
from carstage.errors import ConfigError
from carstage.spec import AGENT_KINDS

_MOST_SHOWN = 8
#: Errors that say that a value has another shape than one alternative of several.
_SHAPES = ("model_type", "model_attributes_type", "tuple_type")
#: Tags of discriminated unions, which pydantic puts into the path though no key is named so.
_TAGS = {
    "server": ("embedded", "carla", "remote", "class"),
    "scenario": SCENARIO_KINDS,
    "driver": DRIVER_KINDS,
    "sensors": tuple(SENSOR_KINDS),
    "agents": AGENT_KINDS,
    "path": DRONE_PATH_KINDS,
    "lens": LENS_MODELS,
}
#: Names that pydantic gives to the alternatives of a union such as `auto` or a number.
_ALTERNATIVE = ("literal[", "constrained-", "int", "float", "tuple[", "function-", "str")


def _clean(location: Sequence[str | int], data: Any) -> tuple[str | int, ...]:
    """The path of a value in the user's own document, without names of alternatives."""
    path: list[str | int] = []
    here = data
    for part in location:
        if isinstance(here, Mapping) and part in here:
            here = here[part]
        elif isinstance(here, list) and isinstance(part, int):
            here = here[part] if part < len(here) else None
        elif isinstance(part, str):
            parent = path[-2] if path and isinstance(path[-1], int) and len(path) > 1 else None
            known_tags = _tags_of(str(parent or (path[-1] if path else "")))
            if part in known_tags or part.lower().startswith(_ALTERNATIVE) or part[0].isupper():
                continue
            here = None
        path.append(part)
    return tuple(path)


def _number(bound: str) -> Callable[[Mapping[str, Any], Any], tuple[str, str]]:
    words = {
        "ge": ("too small", "at least"),
        "gt": ("too small", "more than"),
        "le": ("too large", "at most"),
        "lt": ("too large", "less than"),
    }
    wrong, right = words[bound]

    def explain(context: Mapping[str, Any], value: Any) -> tuple[str, str]:
        return f"{_shown(value)} is {wrong}.", f"Give {right} {context[bound]:g}."

    return explain


def _expected(what: str) -> Callable[[Mapping[str, Any], Any], tuple[str, str]]:
    def explain(_: Mapping[str, Any], value: Any) -> tuple[str, str]:
        return f"{_shown(value)} is not {what}.", f"Give {what}."

    return explain


def _choice(context: Mapping[str, Any], value: Any) -> tuple[str, str]:
    expected = str(context["expected"]).replace("'", "").replace(" or ", ", ").split(", ")
    message, hint = unknown("value", value, expected)
    return message, hint if "Did you mean" not in hint else f"{hint} Known: {', '.join(expected)}."


def _length(context: Mapping[str, Any], value: Any) -> tuple[str, str]:
    least = "min_length" in context
    number = context["min_length" if least else "max_length"]
    if isinstance(value, str):
        what = "letter" if number == 1 else "letters"
        message = (
            "It is empty."
            if not value
            else f"{_shown(value)} is too {'short' if least else 'long'}."
        )
    else:
        what = "entry" if number == 1 else "entries"
        message = f"{_shown(value)} has too {'few' if least else 'many'} entries."
    return message, f"Give at {'least' if least else 'most'} {number} {what}."


_SENTENCES: dict[str, Callable[[Mapping[str, Any], Any], tuple[str, str]]] = {
    "greater_than_equal": _number("ge"),
    "greater_than": _number("gt"),
    "less_than_equal": _number("le"),
    "less_than": _number("lt"),
    "int_type": _expected("a whole number"),
    "int_from_float": _expected("a whole number"),
    "float_type": _expected("a number"),
    "finite_number": _expected("a finite number"),
    "bool_type": _expected("true or false"),
    "string_type": _expected("text"),
    "tuple_type": _expected("a list"),
    "list_type": _expected("a list"),
    "dict_type": _expected("a mapping of keys to values"),
    "model_type": _expected("a mapping of keys to values"),
    "model_attributes_type": _expected("a mapping of keys to values"),
    "literal_error": _choice,
    "string_too_short": _length,
    "string_too_long": _length,
    "too_short": _length,
    "too_long": _length,
    "missing": lambda *_: ("this is missing.", "Add it."),
}


def _shown(value: Any) -> str:
    return shortened(repr(value))


def _explain(details: ErrorDetails, data: Any) -> tuple[tuple[str | int, ...], str, str]:
    context = details.get("ctx", {})
    path = _clean(details["loc"], data)
    kind = details["type"]
    value = details.get("input")
    if kind == "carstage":
        return (*path, *context["path"]), context["sentence"], context["hint"]
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        key = str(context["discriminator"]).strip("'")
        if kind == "union_tag_not_found":
            known = ", ".join(_tags_at(path))
            return (*path, key), "this is missing.", f"Give one of {known}."
        message, hint = unknown(key, context["tag"], _tags_at(path))
        return (*path, key), message, hint
    sentence = _SENTENCES.get(kind)
    if sentence is None:
        return path, f"{details['msg']}.", "See `carstage config init` for what goes here."
    message, hint = sentence(context, value)
    if kind in ("model_type", "model_attributes_type", "dict_type"):
        hint = "Write `key: value` below it; `carstage config init` shows the keys."
    return path, message, hint


def _tags_at(path: Sequence[str | int]) -> tuple[str, ...]:
    return next(tags for part in reversed(path) if (tags := _tags_of(str(part))))


def _tags_of(key: str) -> tuple[str, ...]:
    """Tags of the union below a key; none of other keys."""
    if key != "events":
        return _TAGS.get(key, ())
    from carstage.spec.events import known_events  # few configurations have any

    return tuple(known_events())


def config_error(error: ValidationError, data: Any) -> ConfigError:
    """One error of ours for all that pydantic found.

    Args:
        error: what pydantic raised.
        data: the document that it checked.
    """
    found: dict[tuple[str | int, ...], tuple[str, str]] = {}
    words: dict[tuple[str | int, ...], str] = {}
    for details in error.errors(include_url=False):
        path, message, hint = _explain(details, data)
        if path in found and path not in words and details["type"] in _SHAPES:
            continue  # neither a word, nor a number, nor the section that it might have been
        # `auto` or a number fails once per alternative: the word first, then the number.
        word = words.pop(path, None)
        if details["type"] == "literal_error":
            words[path] = str(details["ctx"]["expected"])
        elif word is not None:
            hint = f"{hint.rstrip('.')}, or {word}."
        found[path] = (message, hint)
    for above in {path[:length] for path in found for length in range(len(path))}:
        found.pop(above, None)  # the word of `auto` or a section, where the section was meant
    return error_of((path, message, hint) for path, (message, hint) in found.items())


def error_of(found: Iterable[tuple[tuple[str | int, ...], str, str]]) -> ConfigError:
    """One error for several problems.

    Args:
        found: path, message and hint of each.
    """
    problems = tuple(found)
    lines = [
        (f"{path_text(path)}: {message}" if path else message, hint)
        for path, message, hint in problems
    ]
    if len(lines) == 1:
        return ConfigError(*lines[0], problems)
    shown = [f"{message} {hint}" for message, hint in lines[:_MOST_SHOWN]]
    more = len(lines) - len(shown)
    tail = f"There are {more} more problems." if more else "Correct these values."
    return ConfigError("\n".join(shown), tail, problems)
