"""How a setting is declared: a default, a title, a sentence, a unit, a group.

The same declaration drives the YAML file, its check, the reference page and, later, the form.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Sequence
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    model_serializer,
    model_validator,
)
from pydantic_core import PydanticCustomError

#: A list of names, kept as a tuple.
Names = Annotated[tuple[str, ...], Strict(strict=False)]

_SHOWN = 60
_LONGEST_NAME = 200
"""A longer one is like no other, and comparing takes long."""


def setting(
    default: Any = ...,
    *,
    title: str,
    description: str,
    unit: str | None = None,
    group: str | None = None,
    carla: str | None = None,
    basic: bool = False,
    **constraints: Any,
) -> Any:
    """A pydantic field with what a form and a reference page need.

    Args:
        default: the value, or a callable that makes it; left out when the user must give one.
        title: the name that a form shows, without the unit.
        description: one sentence on what it does.
        unit: unit of the number, such as ``m`` or ``Hz``.
        group: the section of the form.
        carla: name of CARLA's sensor attribute that it becomes; accepted as the key, too.
        basic: most users set it; forms fold the others, the template comments them out.
        constraints: pydantic's own: ``ge``, ``le``, ``min_length``, …
    """
    extra = {"unit": unit, "group": group, "carla": carla, "basic": basic or None}
    keywords: dict[str, Any] = {
        "title": f"{title} ({unit})" if unit else title,
        "description": description,
        "json_schema_extra": {key: value for key, value in extra.items() if value is not None},
        **constraints,
    }
    if callable(default):
        return Field(default_factory=default, **keywords)
    return Field(default, **keywords)


def nearest(name: object, known: Iterable[str]) -> str | None:
    """The known name that looks most like ``name``, or None when nothing does."""
    if len(str(name)) > _LONGEST_NAME:
        return None
    lowered = {candidate.lower(): candidate for candidate in known}
    found = difflib.get_close_matches(str(name).lower(), lowered, n=1, cutoff=0.5)
    return lowered[found[0]] if found else None


def path_text(path: Sequence[str | int]) -> str:
    """``rig.sensors[1].attributes.fov_deg`` from its parts; long ones are cut."""
    text = ""
    for part in path:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            name = shortened(part) or "''"
            text += f".{name}" if text else name
    return text


def shortened(text: str) -> str:
    """A text of at most sixty characters for a message, which can be printed."""
    text = text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def problem(message: str, hint: str, *path: str | int) -> PydanticCustomError:
    """An error for a validator to raise; ``path`` leads from the model to the value at fault."""
    return PydanticCustomError(
        "carstage", "{sentence}", {"sentence": message, "hint": hint, "path": path}
    )


def unknown(what: str, name: object, known: Iterable[str]) -> tuple[str, str]:
    """Message and hint for a name that is not known.

    Args:
        what: the kind of name, such as ``key`` or ``map``.
        name: what the user wrote.
        known: all that would have been right.
    """
    names = sorted(known)
    match = nearest(name, names)
    if match is not None:
        hint = f"Did you mean {match!r}?"
    else:
        shown = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
        hint = f"Known: {shown}."
    return f"unknown {what} {shortened(repr(name))}.", hint


class Section(BaseModel):
    """A part of the configuration: immutable, nothing unknown, nothing coerced."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=False,
        defer_build=True,
    )
    #: keys of other spellings, accepted by the model's own validators.
    other_keys: ClassVar[frozenset[str]] = frozenset()

    def by_key(self, *, without: Collection[str] = ()) -> dict[str, Any]:
        """What it holds by key, sections as they are, without what is None by default.

        Of a section without sections it is what ``model_dump`` gives, for which pydantic first
        makes a serializer of this section alone.

        Args:
            without: keys to leave out.
        """
        fields = type(self).model_fields
        return {
            name: value
            for name, value in self
            if name not in without and (value is not None or fields[name].default is not None)
        }

    @model_serializer(mode="wrap", return_type=dict[str, Any])
    def _leave_out_what_is_not_set(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without the keys that are None by default; None in place of a default is kept."""
        fields = type(self).model_fields
        dumped: dict[str, Any] = dump(self)
        return {
            name: value
            for name, value in dumped.items()
            if value is not None or fields[name].default is not None
        }

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        known = set(cls.model_fields) | cls.other_keys
        for key in data:
            if key not in known:
                message, hint = unknown("key", key, cls.model_fields)
                raise problem(message, hint, str(key))
        return data
