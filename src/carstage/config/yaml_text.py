"""Reading YAML as people mean it: ``on`` is a word, ``1e3`` a number, a key stands once."""

from __future__ import annotations

import re
from typing import Any

import yaml

from carstage.config.fields import shortened
from carstage.config.plain_values import DEEPEST, MOST_VALUES, plain_copy
from carstage.errors import ConfigError

MOST_CHARACTERS = 2_000_000
"""Of a text, reading which takes one or two seconds at most."""
_TAGS = ("null", "bool", "int", "float", "str", "seq", "map")


class _Loader(yaml.SafeLoader):
    """YAML 1.2's core types instead of 1.1's surprises, and no more of them than can be meant."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._nodes = 0
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """One node with all below it; the parser itself would recurse until Python gives up."""
        self._nodes += 1
        self._depth += 1
        try:
            if self._depth > DEEPEST:
                raise self._refusal(f"this is nested more than {DEEPEST} deep")
            if self._nodes > MOST_VALUES:
                raise self._refusal(f"these are more than {MOST_VALUES} values")
            node: yaml.Node | None = super().compose_node(parent, index)
            return node
        finally:
            self._depth -= 1

    def flatten_mapping(self, node: yaml.MappingNode) -> None:
        """YAML 1.2 merges no mappings: ``<<`` is a key like others."""

    def _refusal(self, problem: str) -> yaml.MarkedYAMLError:
        mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        return yaml.composer.ComposerError(None, None, problem, mark)


_RESOLVED = {
    "tag:yaml.org,2002:bool": (re.compile(r"true|True|TRUE|false|False|FALSE"), "tTfF"),
    "tag:yaml.org,2002:int": (re.compile(r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+"), "-+0123456789"),
    "tag:yaml.org,2002:float": (
        re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?|[-+]?\.inf|\.nan"),
        "-+.0123456789",
    ),
    "tag:yaml.org,2002:null": (re.compile(r"~|null|Null|NULL|"), "~nN\0"),
}
_Loader.yaml_implicit_resolvers = {}
for _tag, (_pattern, _first) in _RESOLVED.items():
    _whole = re.compile(f"(?:{_pattern.pattern})$")
    _Loader.add_implicit_resolver(_tag, _whole, ["" if c == "\0" else c for c in _first])


def _integer(loader: _Loader, node: yaml.ScalarNode) -> int:
    text = str(loader.construct_scalar(node)).lower()
    try:
        return int(text, 0) if text[:2] in ("0x", "0o") else int(text)
    except ValueError as error:
        raise _no(node, text, "a whole number that can be meant") from error


def _boolean(loader: _Loader, node: yaml.ScalarNode) -> bool:
    text = str(loader.construct_scalar(node))
    if text.lower() not in ("true", "false"):
        raise _no(node, text, "true or false")
    return text.lower() == "true"


def _number(loader: _Loader, node: yaml.ScalarNode) -> float:
    text = str(loader.construct_scalar(node)).lower()
    try:
        return float(text.replace(".inf", "inf").replace(".nan", "nan"))
    except ValueError as error:
        raise _no(node, text, "a number") from error


def _no(node: yaml.ScalarNode, text: str, what: str) -> yaml.MarkedYAMLError:
    problem = f"{shortened(text)} is not {what}"
    return yaml.constructor.ConstructorError(None, None, problem, node.start_mark)


def _mapping(loader: _Loader, node: yaml.MappingNode) -> dict[Any, Any]:
    seen: set[Any] = set()
    for key_node, _ in node.value:
        key = loader.construct_object(key_node, deep=True)
        if not isinstance(key, str):
            raise yaml.constructor.ConstructorError(
                None, None, f"the key {shortened(repr(key))} is not a word", key_node.start_mark
            )
        if key in seen:
            raise yaml.constructor.ConstructorError(
                None, None, f"the key {shortened(repr(key))} stands twice", key_node.start_mark
            )
        seen.add(key)
    return loader.construct_mapping(node, deep=True)


_Loader.yaml_constructors = {
    tag: make
    for tag, make in yaml.SafeLoader.yaml_constructors.items()
    if tag is None or tag.removeprefix("tag:yaml.org,2002:") in _TAGS
}
_Loader.add_constructor("tag:yaml.org,2002:bool", _boolean)
_Loader.add_constructor("tag:yaml.org,2002:int", _integer)
_Loader.add_constructor("tag:yaml.org,2002:float", _number)
_Loader.add_constructor("tag:yaml.org,2002:map", _mapping)


def parse_yaml(text: str, source: str) -> Any:
    """The content of a YAML text: mappings, lists, words, numbers, booleans, null.

    Args:
        text: the text.
        source: where it is from, for messages.

    Raises:
        ConfigError: it is not YAML, a key stands twice in one mapping, or it holds more than any
            configuration does.
    """
    if len(text) > MOST_CHARACTERS:
        raise ConfigError(
            f"{source}: {len(text)} characters are more than {MOST_CHARACTERS}.",
            "Is it the right one?",
        )
    try:
        document = yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise ConfigError(
            f"{source}{place}: {error.problem or 'this is not YAML'}.",
            "Correct the file there.",
        ) from error
    except yaml.reader.ReaderError as error:
        raise ConfigError(
            f"{source}: the character number {error.position + 1}, {error.character:#06x}, has no "
            "place in YAML.",
            "Write plain YAML text.",
        ) from error
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise ConfigError(f"{source}: {error}.", "Write plain YAML text.") from error
    return plain_copy(document)
