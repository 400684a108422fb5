"""What errors say, in the words of the page: it has fields and buttons, no options and no keys.

Errors name keys of the configuration and options of commands, as users of files and terminals know
them. Here keys become the titles that the form shows, options become what the page calls them, and
a sentence that is of use in a terminal alone is left out.
"""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

from carstage.web.messages import FieldProblem

_PHRASES = (
    (re.compile(r"Name what was given as --out"), "Name the folder of the dataset"),
    (re.compile(r", or add --append to record"), ", or record"),
    (re.compile(r"\b(an|another) --out\b"), r"\1 destination"),
    (re.compile(r"\ban destination\b"), "a destination"),
    (re.compile(r"(,)? or add --overwrite"), r"\1 or choose overwrite"),
    (re.compile(r",? or add --allow-incomplete"), ""),
    (re.compile(r" \(--[a-z-]+\)"), ""),
    (re.compile(r"was not written by `carstage export`"), "is no export of Car-STAGE"),
)
_OF_TERMINALS = re.compile(r"(?<![\w-])--[a-z]|\bcarstage [a-z]|python -m |\b[A-Z]+_?[A-Z0-9]+=\w")
_SENTENCES = re.compile(r"(?<=[.?!]) +")
_LEAD = re.compile(r"([a-z_]+)((?:\.\w+|\[\d+\])*): +")
_KEYS = re.compile(r"(?<![\w/.\-])[a-z][a-z0-9_]*(?:\.[a-z0-9_]+)*(?![\w/\-(*]|\.[\w*])")
_OF_RUNS = frozenset(("output", "workers"))
"""What errors begin with besides a section's name."""


def page_words(text: str, *, hint: bool = False) -> str:
    """A message or a hint as the page says it.

    Args:
        text: what an error says.
        hint: leave out sentences that are of use in a terminal alone, even if nothing is left.
    """
    for pattern, words in _PHRASES:
        text = pattern.sub(words, text)
    sentences = _SENTENCES.split(text)
    kept = [sentence for sentence in sentences if not _OF_TERMINALS.search(sentence)]
    if kept or hint:
        text = " ".join(kept)
    lead = _LEAD.match(text)
    if lead is None and not any("_" in key or "." in key for key in _KEYS.findall(text)):
        return text
    titles, names = _titles()
    if lead is not None and (lead[1] in _OF_RUNS or lead[1] in titles):
        path = re.sub(r"\[\d+\]", "", lead[0][:-1].rstrip(": "))
        title = titles.get(path, "") if "." in path else ""
        rest = text[lead.end() :]
        text = f"{title}: {rest}" if title else rest[:1].upper() + rest[1:]
    return _KEYS.sub(lambda key: _title(key[0], titles, names), text)


def problem_in_page_words(problem: FieldProblem) -> FieldProblem:
    """The same problem as the page says it; its path stays, as the page finds the field by it."""
    return problem.model_copy(
        update={
            "message": page_words(problem.message),
            "hint": page_words(problem.hint, hint=True),
        }
    )


def title_of(path: str) -> str:
    """The form's title of a setting; empty where it has none.

    Args:
        path: keys, with places in lists in brackets.
    """
    titles, _ = _titles()
    path = re.sub(r"\[[^\]]*\]", "", path)
    # The form has a section's choice as the section itself.
    return titles.get(path.removesuffix(".choice")) or titles.get(path, "")


def _title(key: str, titles: dict[str, str], names: dict[str, str]) -> str:
    title = titles.get(key) if "." in key else names.get(key) if "_" in key else None
    return key if title is None else f"“{title}”"


@lru_cache(maxsize=1)
def _titles() -> tuple[dict[str, str], dict[str, str]]:
    """Titles of the form's fields by path, and by name where all fields of it have one title."""
    from carstage.config import config_schema

    schema = config_schema()
    titles: dict[str, str] = {}
    _collect(schema, schema, "", titles)
    by_name: dict[str, set[str]] = {}
    for path, title in titles.items():
        by_name.setdefault(path.rsplit(".", 1)[-1], set()).add(title)
    return titles, {name: min(found, key=len) for name, found in by_name.items() if found}


def _collect(schema: dict[str, Any], node: dict[str, Any], path: str, into: dict[str, str]) -> None:
    """Titles of a node's fields and of what is inside, in all of its variants."""
    if "$ref" in node:
        _collect(schema, schema["$defs"][node["$ref"].rsplit("/", 1)[-1]], path, into)
    for several in ("oneOf", "anyOf", "allOf"):
        for one in node.get(several, ()):
            _collect(schema, one, path, into)
    if isinstance(node.get("items"), dict):
        _collect(schema, node["items"], path, into)
    for name, field in node.get("properties", {}).items():
        below = f"{path}.{name}" if path else name
        into.setdefault(below, field.get("title") or name.replace("_", " "))
        _collect(schema, field, below, into)
