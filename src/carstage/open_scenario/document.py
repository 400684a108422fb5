"""A document that may be hostile, and its elements with the file's parameters put in."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NoReturn

from lxml import etree

from carstage.errors import ConfigError

LARGEST_BYTES = 1 << 20
MOST_ELEMENTS = 20_000
DEEPEST = 40
_LONGEST_WORD = 200
_FARTHEST = 1e6
WAY_OUT = "Leave it out, or give scenario.scenario_runner, which plays more of OpenSCENARIO."
_MEND = "Mend the file there."


def root_of(content: bytes) -> etree._Element:
    """The root of an OpenSCENARIO document.

    Args:
        content: of the file.

    Raises:
        ConfigError: it is no OpenSCENARIO, declares entities, or is too large or too deep.
    """
    hint = "Name an OpenSCENARIO 1.x file."
    if len(content) > LARGEST_BYTES:
        message = f"{len(content)} bytes are more than {LARGEST_BYTES}"
        raise ConfigError(f"scenario.file: {message}.", hint)
    parser = etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        load_dtd=False,
        remove_comments=True,
        remove_pis=True,
        remove_blank_text=True,
    )
    try:
        root = etree.fromstring(content, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise ConfigError(f"scenario.file: it is no XML: {error}.", hint) from error
    if root.getroottree().docinfo.internalDTD is not None:
        message = "it declares a DOCTYPE or entities, which no scenario needs"
        raise ConfigError(f"scenario.file: {message}.", "Leave the declaration out.")
    if root.tag != "OpenSCENARIO":
        message = f"its root is <{str(root.tag)[:80]}>, not <OpenSCENARIO>"
        raise ConfigError(f"scenario.file: {message}.", hint)
    _check_size(root)
    return root


def _check_size(root: etree._Element) -> None:
    level, count = [root], 0
    for _ in range(DEEPEST):
        count += len(level)
        level = [below for element in level for below in element]
        if not level and count <= MOST_ELEMENTS:
            return
        if count > MOST_ELEMENTS:
            break
    raise ConfigError(
        f"scenario.file: it has more than {MOST_ELEMENTS} elements, or more than {DEEPEST} within "
        "each other.",
        "Name a smaller file.",
    )


class Element:
    """An element of the document; whatever it is asked for, it refuses what cannot be.

    Args:
        element: of the document.
        parameters: values by name; ``$name`` in an attribute stands for one.
    """

    def __init__(self, element: etree._Element, parameters: Mapping[str, str]) -> None:
        self._element = element
        self._parameters = parameters

    @property
    def tag(self) -> str:
        """Its name."""
        return str(self._element.tag)

    def refuse(self, what: str, hint: str = WAY_OUT) -> NoReturn:
        """Say that it cannot be.

        Raises:
            ConfigError: always; with the line and the path in the document.
        """
        path = self._element.getroottree().getpath(self._element)
        line = self._element.sourceline
        raise ConfigError(f"scenario.file: line {line}, {path}: {what}.", hint)

    def allow(self, attributes: str = "", children: str = "") -> Element:
        """Refuse attributes and children but these; lists of words.

        Returns:
            This element.
        """
        known = attributes.split()
        for name in map(str, self._element.attrib):
            if name not in known:
                self.refuse(f"attribute {name} is not known to Car-STAGE")
        for below in self.children():
            if below.tag not in children.split():
                below.refuse(f"<{below.tag}> is not known to Car-STAGE here")
        return self

    def children(self, tag: str | None = None) -> list[Element]:
        """All below it, or those of a name."""
        found = self._element if tag is None else self._element.findall(tag)
        return [Element(below, self._parameters) for below in found]

    def maybe(self, tag: str) -> Element | None:
        """The one below it of a name, if there is one."""
        found = self.children(tag)
        if len(found) > 1:
            found[1].refuse(f"one <{tag}> was there already", _MEND)
        return found[0] if found else None

    def child(self, tag: str) -> Element:
        """The one below it of a name."""
        found = self.maybe(tag)
        return self.refuse(f"it has no <{tag}>", _MEND) if found is None else found

    def only(self, tags: Iterable[str]) -> Element:
        """The one below it, which has one of these names."""
        found = self.children()
        if len(found) != 1:
            self.refuse(f"it has {len(found)} elements, where one of {', '.join(tags)} is", _MEND)
        if found[0].tag not in tags:
            found[0].refuse(f"<{found[0].tag}> is not known to Car-STAGE here")
        return found[0]

    def only_child(self, tag: str) -> Element:
        """The one below it, which has this name."""
        return self.only([tag])

    def text(self, name: str, default: str | None = None) -> str:
        """An attribute, with the parameter that it names put in."""
        given = self._element.get(name, default)
        if given is None:
            self.refuse(f"it has no attribute {name}", _MEND)
        value = str(given)
        if value.startswith("${"):
            self.refuse(f"{name} is an expression, which Car-STAGE does not compute")
        if value.startswith("$"):
            if value[1:] not in self._parameters:
                known = ", ".join(self._parameters) or "none"
                self.refuse(f"{name} is {value[:80]}; declared are: {known}", _MEND)
            value = self._parameters[value[1:]]
        if len(value) > _LONGEST_WORD:
            self.refuse(f"{name} has more than {_LONGEST_WORD} characters", _MEND)
        return value

    def name(self, attribute: str = "name") -> str:
        """An attribute that is not empty."""
        text = self.text(attribute)
        return text or self.refuse(f"its {attribute} is empty", _MEND)

    def number(
        self,
        name: str,
        default: float | None = None,
        *,
        least: float = -_FARTHEST,
        most: float = _FARTHEST,
    ) -> float:
        """A finite number within limits."""
        text = self.text(name, None if default is None else str(default))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not least <= value <= most:
            self.refuse(f"{name} is {text[:40]!r}, no number from {least:g} to {most:g}", _MEND)
        return value

    def whole(self, name: str, least: int, most: int, default: int | None = None) -> int:
        """A whole number within limits."""
        value = self.number(name, default, least=least, most=most)
        if value != int(value):
            self.refuse(f"{name} is {value:g}, no whole number", _MEND)
        return int(value)

    def flag(self, name: str, default: bool = False) -> bool:
        """True or false."""
        return self.choice(name, ("true", "false", "1", "0"), str(default).lower()) in ("true", "1")

    def choice(self, name: str, known: Iterable[str], default: str | None = None) -> str:
        """One of some words."""
        value = self.text(name, default)
        if value not in known:
            self.refuse(f"{name} is {value[:40]!r}; Car-STAGE knows {', '.join(known)}")
        return value
