"""What a configuration samples, and the configuration with one value or another."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from pydantic import ValidationError, create_model
from pydantic_core import PydanticCustomError

from carstage.config.campaign import Sampled
from carstage.config.explain import config_error, error_of
from carstage.config.fields import Section, path_text, unknown
from carstage.config.model import Config
from carstage.config.paths import steps_of
from carstage.errors import ConfigError

Path = tuple[str | int, ...]

_ALONE = frozenset(
    ("duration_s", "save_every", "map", "weather", "vehicles", "pedestrians", "traffic", "ego")
)
"""Settings that go together with any others, but for the number of steps and _NOT_ALONE."""
_NOT_ALONE = (("map",), ("ego", "driver"), ("ego", "spawn"))


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
        self._alone = _ALONE.issuperset(keys) and not any(map(_meets_others, paths))
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


def _meets_others(path: Path) -> bool:
    """Whether a path is at, above or below one of ``_NOT_ALONE``."""
    return any(one[: len(path)] == path[: len(one)] for one in _NOT_ALONE)


@cache
def _sections_model(keys: tuple[str, ...]) -> type[Section]:
    """A model of some keys of the configuration alone."""
    known = Config.model_fields
    fields: dict[str, Any] = {key: (known[key].annotation, known[key]) for key in keys}
    made: type[Section] = create_model("Varied", __base__=Section, **fields)
    return made


def dimensions(config: Config) -> tuple[Dimension, ...]:
    """What a configuration samples, sorted by path; empty without a campaign."""
    if config.campaign is None:
        return ()
    found = []
    for name, sampled in sorted(config.campaign.sample.items()):
        path = path_of(name)
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
    return tuple(dict.fromkeys(name for _, name in located_maps(config)))


def located_maps(config: Config) -> list[tuple[Path, str]]:
    """All maps that a configuration's episodes may play in, as written, each behind its path."""
    found: list[tuple[Path, str]] = [
        (("map", *place), name) for place, name in config.map.located_names()
    ]
    for dimension in dimensions(config):
        if dimension.path[0] == "map":
            variants = Variants(config, [dimension.path])
            for _, value in dimension.sampled.ends:
                varied = variants.with_values({dimension.path: value}).map
                found += [(dimension.path, name) for _, name in varied.located_names()]
    return found


def path_of(text: str) -> Path:
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
