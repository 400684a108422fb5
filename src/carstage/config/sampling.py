"""Sampled settings: taken out of a document, put back with a value, and checked before all else.

In a file, how a setting is sampled stands where its value would: ``vehicles: {count: {range: [10,
50]}}``. Here it is moved to ``campaign.sample`` by its path, and one of its values takes its place.
So the rest is an ordinary configuration, and a configuration that was written down reads the same.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from math import prod
from typing import Any

from pydantic import ValidationError

from carstage.config.campaign import Sampled
from carstage.config.dimensions import Path, Variants, crossed, path_of
from carstage.config.explain import config_error, error_of
from carstage.config.fields import path_text
from carstage.config.model import Config
from carstage.config.paths import place_value
from carstage.config.scene import FROM_FILES
from carstage.errors import ConfigError

Problem = tuple[Path, str, str]
"""Path, message and hint."""

MOST_EPISODES = 100_000
_OF_A_RUN = frozenset(
    (
        *("name", "seed", "episodes", "variants", "server", "supervision", "conversion"),
        *("output", "campaign"),
    )
)
"""Settings that are the same for all episodes of a run."""
_SHORT_FORMS = ("map", "weather")
_MARKS = ("range", "normal", "choice")
_OF_ARGUMENTS = ("parameters", "params")
"""Settings whose keys may be names of arguments."""


def take_samples(document: dict[str, Any]) -> Callable[[ConfigError], ConfigError]:
    """Move how settings are sampled to ``campaign.sample``, and put values in their places.

    Args:
        document: plain values; it is changed.

    Returns:
        What makes, of an error about the changed document, one with the paths of the user's own.

    Raises:
        ConfigError: how a setting is sampled is wrong, or it cannot be sampled.
    """
    found = _Found()
    _lengthen_short_forms(document, found)
    for key in list(document):
        if key != "campaign":
            _search(document, key, (key,), found)
    campaign = document.get("campaign")
    given = campaign.get("sample") if isinstance(campaign, dict) else None
    if isinstance(given, dict):
        for text, raw in given.items():
            path = path_of(text)
            if path not in found.samples:
                found.add(path, raw, ("campaign", "sample", text))
    if not found.samples:
        return lambda error: error
    samples = {}
    for path, raw in sorted(found.samples.items(), key=lambda entry: path_text(entry[0])):
        sampled = _checked(raw, found.places[path])
        place_value(document, path, sampled.ends[0][1])
        samples[path_text(path)] = sampled.model_dump(mode="json")
    if campaign is None:
        campaign = document["campaign"] = {}
    if isinstance(campaign, dict):  # else the schema refuses it
        document["campaign"] = {**campaign, "sample": samples}
    return found.in_words_of_the_user


def check_samples(
    config: Config,
    in_words_of_the_user: Callable[[ConfigError], ConfigError],
    *,
    count_episodes: bool = False,
) -> Config:
    """Refuse sampled values that could not stand in a file.

    Args:
        config: the configuration.
        in_words_of_the_user: as ``take_samples`` gave it.
        count_episodes: take as many episodes as grid or strata have combinations.

    Returns:
        The configuration with its number of episodes.

    Raises:
        ConfigError: an end of a range or a choice is wrong, or strata and grids do not fit.
    """
    campaign = config.campaign
    if campaign is None:
        return config
    problems: list[Problem] = []
    for name, sampled in campaign.sample.items():
        path = path_of(name)
        variants = Variants(config, [path])
        for place, value in sampled.ends:
            try:
                varied = variants.with_values({path: value})
                fixed = isinstance(varied.scenario, FROM_FILES)
                if path[0] == "scenario" and fixed:
                    raise error_of(
                        [(path, "what a file tells is the same in all episodes.", "Fix it.")]
                    )
            except ConfigError as error:
                found = [
                    (_inside(at, path, place), message, hint)
                    for at, message, hint in error.problems
                ]
                problems += in_words_of_the_user(error_of(found)).problems
    if problems:
        raise error_of(problems)
    if campaign.method not in ("grid", "stratified"):
        return config
    cells = prod(len(dimension.levels or ()) for dimension in crossed(config))
    episodes = cells * campaign.repeats if count_episodes else config.episodes
    recorded = episodes * max(1, len(config.variants))
    if cells > MOST_EPISODES or recorded > MOST_EPISODES:
        path = ("campaign", "method" if cells > MOST_EPISODES else "repeats")
        message = f"{max(cells, recorded)} combinations are more than {MOST_EPISODES} episodes."
        raise error_of([(path, message, "Give fewer choices, steps or repeats.")])
    return config.model_copy(update={"episodes": episodes})


class _Found:
    """Samples of a document, and where the user wrote them."""

    def __init__(self) -> None:
        self.samples: dict[Path, Any] = {}
        self.places: dict[Path, Path] = {}
        self.flat: set[Path] = set()
        """Where the list of choices stands in place of the choice: ``map: {choice: [A, B]}``."""

    def add(self, path: Path, raw: Any, place: Path) -> None:
        """Keep a sample of the setting at a path.

        Raises:
            ConfigError: the setting cannot be sampled.
        """
        which_sensors = path[0] == "rig" and (len(path) < 4 or path[3:] in (("id",), ("kind",)))
        if path[0] in _OF_A_RUN or which_sensors:
            message = "it is the same in all episodes of a run."
            hint = "Sample the sensors' own settings." if which_sensors else "Give one value."
            raise error_of([(place, message, hint)])
        self.samples[path] = raw
        self.places[path] = place

    def in_words_of_the_user(self, error: ConfigError) -> ConfigError:
        """The error with the paths of the document that the user wrote."""
        if not error.problems:
            return error
        return error_of((self._own(path), said, hint) for path, said, hint in error.problems)

    def _own(self, path: Path) -> Path:
        for sampled, place in self.places.items():
            moved = ("campaign", "sample", path_text(sampled))
            if path[:3] == moved:
                return (*place, *path[3:])
            if path[: len(sampled)] == sampled:
                rest = path[len(sampled) :]
                if not _is_in_sample(rest, self.samples[sampled]):
                    rest = (*_first_place(self.samples[sampled]), *rest)
                if sampled in self.flat and rest[0] == "choice":
                    rest = rest[1:]
                return (*place, *rest)
        return path


def _lengthen_short_forms(document: dict[str, Any], found: _Found) -> None:
    """``map: {choice: [A, B], layers: …}`` samples ``map.choice``."""
    for name in _SHORT_FORMS:
        section = document.get(name)
        if not isinstance(section, dict) or not isinstance(section.get("choice"), list):
            continue
        if all(isinstance(choice, str) for choice in section["choice"]):
            rest = {key: value for key, value in section.items() if key != "weights"}
            sample = {key: section[key] for key in ("choice", "weights") if key in section}
            document[name] = {**rest, "choice": sample}
            found.flat.add((name, "choice"))


def _is_sample(value: Any) -> bool:
    """A mapping with the list of a range, a choice or a distribution; no setting looks so."""
    return isinstance(value, dict) and any(isinstance(value.get(mark), list) for mark in _MARKS)


def _names_arguments(key: str | int, value: Any) -> bool:
    """Whether a mapping has a user's own names as keys: ``range`` in it is one of them.

    Such mappings as a whole are sampled by a choice of mappings alone.
    """
    if key not in _OF_ARGUMENTS or not isinstance(value, dict):
        return False
    choice = value.get("choice")
    return not (isinstance(choice, list) and all(isinstance(one, dict) for one in choice))


def _search(parent: Any, key: str | int, path: Path, found: _Found) -> None:
    """Keep the samples at and below a place."""
    value = parent[key]
    if _is_sample(value) and not _names_arguments(key, value):
        found.add(path, value, path)
    elif isinstance(value, dict | list):
        for below in value if isinstance(value, dict) else range(len(value)):
            _search(value, below, (*path, below), found)


def _checked(raw: Any, place: Path) -> Sampled:
    """A sample that may be one.

    Raises:
        ConfigError: with its path in the user's document.
    """
    try:
        sampled = Sampled.model_validate_json(json.dumps(raw))
    except ValidationError as error:
        found = config_error(error, raw).problems
        raise error_of(((*place, *path), said, hint) for path, said, hint in found) from error
    for position, choice in enumerate(sampled.choice or ()):
        if any(_samples_in(choice)):
            message = "a choice holds no further range, choice or distribution."
            raise error_of([((*place, "choice", position), message, "Give plain values.")])
    return sampled


def _samples_in(value: Any) -> Iterator[bool]:
    if _is_sample(value):
        yield True
    elif isinstance(value, dict | list):
        for below in value.values() if isinstance(value, dict) else value:
            yield from _samples_in(below)


def _is_in_sample(path: Path, raw: Mapping[str, Any]) -> bool:
    """Whether a path leads into how a setting is sampled, and not into one of its values."""
    if path[:1] in (("min",), ("max",)):
        return path[0] in raw
    first, position = path[:1], path[1:2]
    return (
        first in (("range",), ("choice",))
        and first[0] in raw
        and any(isinstance(part, int) for part in position)
    )


def _first_place(raw: Any) -> Path:
    """Where the first value of a sample stands in it."""
    if isinstance(raw, Mapping):
        for mark, place in (("range", ("range", 0)), ("choice", ("choice", 0))):
            if mark in raw:
                return place
    return ("min",)


def _inside(at: Path, path: Path, place: Path) -> Path:
    """The path of a problem with one value of a sample, within the sample."""
    return (*path, *place, *(at[len(path) :] if at[: len(path)] == path else ()))
