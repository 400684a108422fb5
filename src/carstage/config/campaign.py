"""How the settings of a campaign's episodes are sampled, and when it has enough."""

from __future__ import annotations

from math import erf, sqrt
from typing import Annotated, Any, Literal

from pydantic import Field, Strict, model_validator

from carstage.config.fields import Names, Section, problem, setting, unknown
from carstage.config.weather import WEATHER_PRESETS

_LARGEST = 1e18
Number = Annotated[int | float, Field(ge=-_LARGEST, le=_LARGEST)]
Pair = Annotated[tuple[Number, Number], Strict(strict=False)]

OBJECT_GROUPS: dict[str, tuple[str, ...]] = {
    "vehicle": ("car", "van", "truck", "bus", "motorcycle", "bicycle"),
    "pedestrian": ("walker_adult", "walker_child", "walker_wheelchair"),
}
"""Words for several classes of the label tables."""
OBJECT_CLASSES = (*OBJECT_GROUPS["vehicle"], *OBJECT_GROUPS["pedestrian"])
_KINDS = ("range", "choice", "normal")
_LEAST_SHARE = 1e-6


class Sampled(Section):
    """How one setting is sampled: exactly one of range, choice and normal."""

    range: Pair | None = setting(
        None,
        title="Range",
        description="`[low, high]`: any number between them, both ends included; whole numbers "
        "where the key is one.",
    )
    steps: int | None = setting(
        None,
        title="Steps",
        description="So many values of a range, evenly spaced, for grids and strata.",
        ge=2,
        le=10_000,
    )
    choice: Annotated[tuple[Any, ...], Strict(strict=False)] | None = setting(
        None,
        title="Choice",
        description="Values of which each episode gets one.",
        min_length=1,
        max_length=1000,
    )
    weights: Annotated[tuple[float, ...], Strict(strict=False)] | None = setting(
        None, title="Weights", description="How likely each choice is; left out: all alike."
    )
    normal: Pair | None = setting(
        None,
        title="Normal",
        description="`[mean, deviation]`: a normal distribution, cut at min and max.",
    )
    min: Number | None = setting(None, title="Minimum", description="Of a normal distribution.")
    max: Number | None = setting(None, title="Maximum", description="Of a normal distribution.")

    @model_validator(mode="after")
    def _check(self) -> Sampled:
        given = [kind for kind in _KINDS if getattr(self, kind) is not None]
        if len(given) != 1:
            raise problem(
                f"{' and '.join(given) or 'nothing'} is given.",
                "Give exactly one of range, choice and normal.",
                given[-1] if given else "range",
            )
        for name, kind in (
            *(("steps", "range"), ("weights", "choice"), ("min", "normal"), ("max", "normal")),
        ):
            if getattr(self, name) is not None and given[0] != kind:
                raise problem(f"it goes with {kind}, not {given[0]}.", "Leave it out.", name)
        if self.range is not None and not self.range[0] < self.range[1]:
            raise problem(
                f"{self.range[0]:g} is not below {self.range[1]:g}.", "Write [low, high].", "range"
            )
        if self.weights is not None:
            _check_weights(self.weights, len(self.choice or ()))
        if self.normal is not None:
            self._check_normal(*self.normal)
        return self

    def _check_normal(self, mean: Number, deviation: Number) -> None:
        if deviation <= 0:
            raise problem(f"{deviation:g} is no deviation.", "Give more than 0.", "normal", 1)
        low, high = self.min, self.max
        for name, value in (("min", low), ("max", high)):
            if value is None:
                raise problem("this is missing.", "Give the smallest and largest value.", name)
        assert low is not None
        assert high is not None
        if not low < high:
            raise problem(f"{high:g} is not above {low:g}, the minimum.", "Give more.", "max")
        if _below(mean, deviation, high) - _below(mean, deviation, low) < _LEAST_SHARE:
            raise problem(
                f"hardly any value of it is between {low:g} and {high:g}.",
                "Move the mean, or widen min and max.",
                "normal",
            )

    @property
    def ends(self) -> tuple[tuple[tuple[str | int, ...], Any], ...]:
        """Values within which all others lie, each with its place in this section."""
        if self.range is not None:
            return ((("range", 0), self.range[0]), (("range", 1), self.range[1]))
        if self.normal is not None:
            return ((("min",), self.min), (("max",), self.max))
        return tuple((("choice", i), value) for i, value in enumerate(self.choice or ()))


def _below(mean: float, deviation: float, value: float) -> float:
    """Share of a normal distribution below a value."""
    return 0.5 * (1.0 + erf((value - mean) / (deviation * sqrt(2.0))))


def _check_weights(weights: tuple[float, ...], choices: int) -> None:
    if len(weights) != choices:
        raise problem(
            f"{len(weights)} weights are not one for each of {choices} choices.",
            f"Give {choices}.",
            "weights",
        )
    for position, weight in enumerate(weights):
        if weight < 0:
            raise problem(f"{weight:g} is too small.", "Give 0 or more.", "weights", position)
    if not sum(weights) > 0:
        raise problem("all of them are 0.", "Give one above 0.", "weights")


class Condition(Section):
    """Which saved frames a quota counts; all that is given must hold."""

    objects: str | Names | None = setting(
        None,
        title="Objects",
        description="`vehicle`, `pedestrian`, a class of the label tables, or a list of them.",
    )
    min_count: int = setting(
        1, title="At least", description="So many of these objects.", ge=1, le=10_000
    )
    min_distance_m: float | None = setting(
        None, title="Not nearer", description="Objects count from here on.", unit="m", ge=0
    )
    max_distance_m: float | None = setting(
        None, title="Not farther", description="Objects count up to here.", unit="m", gt=0
    )
    min_visibility: float | None = setting(
        None,
        title="Visible",
        description="Objects count from this share of visible pixels on.",
        ge=0,
        le=1,
    )
    maps: Names | None = setting(None, title="Maps", description="Only frames of these maps.")
    weathers: Names | None = setting(
        None, title="Weathers", description="Only frames with one of these presets."
    )
    sun_altitude_above_deg: float | None = setting(
        None, title="Sun above", description="Only frames with a higher sun.", unit="deg"
    )
    sun_altitude_below_deg: float | None = setting(
        None, title="Sun below", description="Only frames with a lower sun.", unit="deg"
    )

    @model_validator(mode="after")
    def _check(self) -> Condition:
        words = (self.objects,) if isinstance(self.objects, str) else self.objects or ()
        for position, word in enumerate(words):
            if word not in OBJECT_GROUPS and word not in OBJECT_CLASSES:
                place = ("objects",) if isinstance(self.objects, str) else ("objects", position)
                raise problem(*unknown("class", word, (*OBJECT_GROUPS, *OBJECT_CLASSES)), *place)
        for name in ("min_distance_m", "max_distance_m", "min_visibility"):
            if getattr(self, name) is not None and not words:
                raise problem("of which objects?", "Give objects, too.", name)
        for position, name in enumerate(self.weathers or ()):
            if name not in WEATHER_PRESETS:
                message, hint = unknown("weather preset", name, WEATHER_PRESETS)
                raise problem(message, hint, "weathers", position)
        return self

    @property
    def classes(self) -> tuple[str, ...]:
        """Classes of the objects, as the label tables have them; empty: objects do not matter."""
        words = (self.objects,) if isinstance(self.objects, str) else self.objects or ()
        found = [name for word in words for name in OBJECT_GROUPS.get(word, (word,))]
        return tuple(dict.fromkeys(found))


class Quota(Section):
    """Frames that a campaign wants; when all quotas are met, it begins no further episode."""

    name: str = setting(
        title="Name", description="What reports call it.", min_length=1, max_length=100
    )
    frames: int = setting(title="Frames", description="How many.", ge=1, le=10**9)
    where: Condition = setting(Condition, title="Where", description="Which frames count.")


class Campaign(Section):
    """How values are drawn for settings that are written as a range, a choice or a distribution."""

    method: Literal["random", "grid", "latin_hypercube", "stratified"] = setting(
        "random",
        title="Method",
        description="`random`; `grid`: every combination; `latin_hypercube`: each value evenly; "
        "`stratified`: every combination of the strata, the rest random.",
    )
    strata: Names = setting(
        (),
        title="Strata",
        description="Sampled settings whose combinations get equal shares, such as "
        "`[map.choice, weather.choice]`.",
    )
    repeats: int = setting(
        1,
        title="Repeats",
        description="Episodes of each combination, where `episodes` is left out.",
        ge=1,
        le=100_000,
    )
    block: int = setting(
        100,
        title="Block",
        description="Latin hypercube: so many episodes in a row cover each range evenly.",
        ge=2,
        le=10_000,
    )
    quotas: Annotated[tuple[Quota, ...], Strict(strict=False)] = setting(
        (),
        title="Quotas",
        description="Frames by condition; once all are there, no further episode begins.",
    )
    sample: Annotated[dict[str, Sampled], Field(max_length=200)] = setting(
        dict,
        title="Samples",
        description="By the path of a setting, how it is sampled. `config check` moves what "
        "stands at the setting itself to here.",
    )

    @model_validator(mode="after")
    def _check_method(self) -> Campaign:
        for name, method in (("strata", "stratified"), ("block", "latin_hypercube")):
            default = type(self).model_fields[name].default
            if getattr(self, name) != default and self.method != method:
                raise problem(f"it goes with method {method}.", "Leave it out.", name)
        if self.method == "stratified" and not self.strata:
            raise problem("no strata are named.", "Name sampled settings.", "strata")
        if self.repeats != 1 and self.method not in ("grid", "stratified"):
            raise problem("it goes with grid and stratified.", "Set `episodes`.", "repeats")
        names = [quota.name for quota in self.quotas]
        for position, name in enumerate(names):
            if name in names[:position]:
                message = f"{name!r} is the name of another quota."
                raise problem(message, "Choose another name.", "quotas", position, "name")
        return self
