"""Which variant of an episode a specification is: one world, under one sky, by one rig."""

from __future__ import annotations

import re
from dataclasses import dataclass

from carstage.spec.fields import Fields, SpecError
from carstage.spec.values import Value

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,31}\Z")


@dataclass(frozen=True, eq=False, repr=False)
class VariantSpec(Value):
    """What tells the variants of an episode apart, and what they have in common.

    Attributes:
        name: the user's.
        base_id: id of the episode as it would be without any variant; all its variants have it.
    """

    name: str
    base_id: str

    @classmethod
    def read(cls, fields: Fields) -> VariantSpec:
        """Check and read the section."""
        name = fields.text("name")
        if not is_variant_name(name):
            raise SpecError("%s: %r cannot be a name." % (fields.path("name"), name))
        return cls(name, fields.text("base_id"))


def is_variant_name(text: str) -> bool:
    """Whether a text can be a variant's name: up to 32 letters, digits, ``_`` and ``-``."""
    return bool(_NAME.match(text))
