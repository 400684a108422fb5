"""Sampled settings: taken out of a document, put back with a value, and checked before all else.

In a file, how a setting is sampled stands where its value would: ``vehicles: {count: {range: [10,
50]}}``. Here it is moved to ``campaign.sample`` by its path, and one of its values takes its place.
So the rest is an ordinary configuration, and a configuration that was written down reads the same.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import prod
from typing import Any

from pydantic import ValidationError, create_model
from pydantic_core import PydanticCustomError

from carstage.config.campaign import Sampled
from carstage.config.explain import config_error, error_of
from carstage.config.fields import Section, path_text, unknown
from carstage.config.model import Config
from carstage.config.paths import place_value, steps_of
from carstage.config.scene import ReplayScenario
from carstage.errors import ConfigError

Path = tuple[str | int, ...]
Problem = tuple[Path, str, str]
"""Path, message and hint."""

MOST_EPISODES = 100_000
_OF_A_RUN = frozenset(
    ("name", "seed", "episodes", "server", "supervision", "conversion", "output", "campaign")
)
"""Settings that are the same for all episodes of a run."""
_ALONE = frozenset(
    ("duration_s", "save_every", "map", "weather", "vehicles", "pedestrians", "traffic", "ego")
)
"""Settings that go together with any others, but for the number of steps."""
_SHORT_FORMS = ("map", "weather")
_MARKS = ("range", "normal", "choice")


@dataclass(frozen=True, slots=True)
class Dimension:
    """One setting that is sampled.

    Attributes:
        path: of the setting.
        sampled: how.
        is_integer: it takes whole numbers alone.
    """

    path: Path
    sampled: Sampled
    is_integer: bool = False

    @property
    def name(self) -> str:
        """The path as users write it."""
        return path_text(self.path)

    def path_to(self, place: Path) -> str:
        """The path of one of its values, as users write it: a choice of choices is a list.

        Args:
            place: as ``Sampled.ends`` has it.
        """
        once = self.path[-1] == place[0] == "choice"
        return path_text((*self.path, *place[1:]) if once else (*self.path, *place))

    @property
    def levels(self) -> tuple[Any, ...] | None:
        """All its values, for grids and strata; None where there is no end of them."""
        if self.sampled.choice is not None:
            return self.sampled.choice
        if self.sampled.range is None or self.sampled.steps is None:
            return None
        low, high = self.sampled.range
        last = self.sampled.steps - 1
        values = [low + (high - low) * step / last for step in range(last)] + [high]
        return tuple(dict.fromkeys(map(round, values))) if self.is_integer else tuple(values)


class Variants:
    """A configuration with other values at some paths, each checked as if it stood in the file.

    Args:
        config: the configuration.
        paths: where values may be others.
    """

    def __init__(self, config: Config, paths: Sequence[Path]) -> None:
        self._config = config
        keys = sorted({str(path[0]) for path in paths})
        base = config.model_dump(mode="json")
        self._base = {key: base[key] for key in keys}
        self._alone = _ALONE.issuperset(keys)
        self._model = _sections_model(tuple(keys))

    def with_values(self, values: Mapping[Path, Any]) -> Config:
        """The configuration with some values.

        Args:
            values: plain values by path.

        Raises:
            ConfigError: one of them cannot be, or they do not go together.
        """
        document = dict(self._base)
        for path, value in values.items():
            _set(document, path, value)
        try:
            varied = self._model.model_validate_json(json.dumps(document))
        except ValidationError as error:
            raise config_error(error, document) from error
        made = self._config.model_copy(update={key: getattr(varied, key) for key in self._base})
        try:
            if self._alone:
                made.check_steps()
            else:
                made.check_together()
        except PydanticCustomError as error:
            context = error.context or {}
            found = (tuple(context["path"]), context["sentence"], context["hint"])
            raise error_of([found]) from error
        return made


@cache
def _sections_model(keys: tuple[str, ...]) -> type[Section]:
    """A model of some keys of the configuration alone."""
    known = Config.model_fields
    fields: dict[str, Any] = {key: (known[key].annotation, known[key]) for key in keys}
    made: type[Section] = create_model("Varied", __base__=Section, **fields)
    return made


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
            path = _path_of(text)
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
        path = _path_of(name)
        variants = Variants(config, [path])
        for place, value in sampled.ends:
            try:
                varied = variants.with_values({path: value})
                if path[0] == "scenario" and isinstance(varied.scenario, ReplayScenario):
                    raise error_of([(path, "a replay is the same in all episodes.", "Fix it.")])
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
    if cells > MOST_EPISODES or episodes > MOST_EPISODES:
        path = ("campaign", "method" if cells > MOST_EPISODES else "repeats")
        message = f"{max(cells, episodes)} combinations are more than {MOST_EPISODES} episodes."
        raise error_of([(path, message, "Give fewer choices, steps or repeats.")])
    return config.model_copy(update={"episodes": episodes})


def dimensions(config: Config) -> tuple[Dimension, ...]:
    """What a configuration samples, sorted by path; empty without a campaign."""
    if config.campaign is None:
        return ()
    found = []
    for name, sampled in sorted(config.campaign.sample.items()):
        path = _path_of(name)
        found.append(Dimension(path, sampled, _takes_whole_numbers(config, path, sampled)))
    return tuple(found)


def crossed(config: Config) -> tuple[Dimension, ...]:
    """The dimensions whose combinations a grid or strata go through, the slowest first.

    Raises:
        ConfigError: one of them has no levels, or weights, or is not there.
    """
    campaign = config.campaign
    if campaign is None or campaign.method not in ("grid", "stratified"):
        return ()
    known = {dimension.name: dimension for dimension in dimensions(config)}
    strata = campaign.method == "stratified"
    found = []
    for position, name in enumerate(campaign.strata if strata else known):
        if name not in known:
            message, hint = unknown("sampled setting", name, known)
            if known.keys() & {f"{name}.choice"}:
                hint = f"Did you mean '{name}.choice'?"
            raise error_of([(("campaign", "strata", position), message, hint)])
        dimension = known[name]
        if dimension.levels is None or dimension.sampled.weights is not None:
            weighted = dimension.sampled.weights is not None
            message = "weights have no place in" if weighted else "it is no choice and no range for"
            hint = "Leave them out." if weighted else "Give a choice, or a range with steps."
            what = f"{message} {'strata' if strata else 'a grid'}."
            raise error_of([(dimension.path, what, hint)])
        found.append(dimension)
    return tuple(found)


def maps_of(config: Config) -> tuple[str, ...]:
    """The names of all maps that a configuration's episodes may play in, ``all`` among them."""
    names = [config.map.choice, *(config.map.random_from or ())]
    for dimension in dimensions(config):
        if dimension.path[0] == "map":
            variants = Variants(config, [dimension.path])
            for _, value in dimension.sampled.ends:
                varied = variants.with_values({dimension.path: value}).map
                names += [varied.choice, *(varied.random_from or ())]
    return tuple(dict.fromkeys(name for name in names if name is not None))


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
                if not rest or rest[0] not in (*_MARKS, "min", "max"):
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


def _search(parent: Any, key: str | int, path: Path, found: _Found) -> None:
    """Keep the samples at and below a place."""
    value = parent[key]
    if _is_sample(value):
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


def _path_of(text: str) -> Path:
    """A path from its text.

    Raises:
        ConfigError: it is none.
    """
    steps = steps_of(text)
    if steps is None:
        place = ("campaign", "sample", text)
        raise error_of([(place, "this is no path of a setting.", "Write vehicles.count.")])
    return tuple(steps)


def _set(document: dict[str, Any], path: Path, value: Any) -> None:
    """Put a value at a path; what is on the way is copied, the rest is shared."""
    here: Any = document
    for key in path[:-1]:
        below = here.get(key) if isinstance(here, dict) else here[key]
        here[key] = {} if below is None else below.copy()
        here = here[key]
    here[path[-1]] = value


def _takes_whole_numbers(config: Config, path: Path, sampled: Sampled) -> bool:
    """Whether a setting refuses a fraction between two values that it takes."""
    ends = [value for _, value in sampled.ends]
    if sampled.choice is not None or not all(float(value).is_integer() for value in ends):
        return False
    try:
        Variants(config, [path]).with_values({path: ends[0] + 0.5})
    except ConfigError:
        return True
    return False
