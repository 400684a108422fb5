"""CARLA's weather: the names of its presets and the ranges of its parameters.

Source: ``carla.WeatherParameters`` of the 0.9.16 client, which also knows the presets' values.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Strict, model_validator

from carstage.config.fields import Names, Section, problem, setting, unknown

WEATHER_PRESETS: tuple[str, ...] = (
    "ClearNoon",
    "CloudyNoon",
    "WetNoon",
    "WetCloudyNoon",
    "SoftRainNoon",
    "MidRainyNoon",
    "HardRainNoon",
    "ClearSunset",
    "CloudySunset",
    "WetSunset",
    "WetCloudySunset",
    "SoftRainSunset",
    "MidRainSunset",
    "HardRainSunset",
    "ClearNight",
    "CloudyNight",
    "WetNight",
    "WetCloudyNight",
    "SoftRainNight",
    "MidRainyNight",
    "HardRainNight",
    "DustStorm",
)

DEFAULT_PRESET = "ClearNoon"

Lights = Literal["auto", "on", "off"]


def _parameter(title: str, low: float, high: float, unit: str, sentence: str) -> Any:
    return setting(None, title=title, description=sentence, unit=unit, ge=low, le=high)


class WeatherParameters(Section):
    """Single values of the weather; they override the preset's."""

    cloudiness: float | None = _parameter("Cloudiness", 0, 100, "%", "Cover of the sky.")
    precipitation: float | None = _parameter("Rain", 0, 100, "%", "Strength of the rain.")
    precipitation_deposits: float | None = _parameter(
        "Puddles", 0, 100, "%", "Water that stands on the road."
    )
    wind_intensity: float | None = _parameter("Wind", 0, 100, "%", "Strength of the wind.")
    sun_azimuth_angle: float | None = _parameter(
        "Sun azimuth", -360, 360, "deg", "Direction of the sun."
    )
    sun_altitude_angle: float | None = _parameter(
        "Sun altitude", -90, 90, "deg", "Height of the sun; negative at night."
    )
    fog_density: float | None = _parameter("Fog", 0, 100, "%", "Density of the fog.")
    fog_distance: float | None = _parameter("Fog distance", 0, 10_000, "m", "Where the fog starts.")
    fog_falloff: float | None = _parameter(
        "Fog fall-off", 0, 10_000, "1/m", "How fast fog thins with height."
    )
    wetness: float | None = _parameter("Wetness", 0, 100, "%", "How wet surfaces look.")
    scattering_intensity: float | None = _parameter(
        "Scattering", 0, 100, "1", "Light that fog scatters."
    )
    mie_scattering_scale: float | None = _parameter(
        "Mie scattering", 0, 5, "1", "Scattering by large particles such as haze."
    )
    rayleigh_scattering_scale: float | None = _parameter(
        "Rayleigh scattering", 0, 2, "1", "Scattering by the air."
    )
    dust_storm: float | None = _parameter(
        "Dust", 0, 100, "%", "Strength of a dust storm (CARLA 0.9.14 and later)."
    )

    def given(self) -> dict[str, float]:
        """The values that are set, by CARLA's names."""
        return {name: float(value) for name, value in self if value is not None}


def _check_preset(name: str, *path: str | int) -> None:
    if name not in WEATHER_PRESETS:
        raise problem(*unknown("weather preset", name, WEATHER_PRESETS), *path)


class WeatherChange(Section):
    """The weather at one moment of an episode; between two moments it changes linearly."""

    at_s: float = setting(
        title="At",
        description="Seconds since the first recorded step.",
        unit="s",
        group="scene",
        ge=0,
        le=86_400,
    )
    choice: str | None = setting(
        None,
        title="Preset",
        description="The weather then; left out: the weather of the moment before.",
        group="scene",
    )
    parameters: WeatherParameters = setting(
        WeatherParameters,
        title="Parameters",
        description="Single values then, on top.",
        group="scene",
    )

    @model_validator(mode="after")
    def _check(self) -> WeatherChange:
        if self.choice is None and not self.parameters.given():
            raise problem("nothing changes.", "Give choice or parameters.", "choice")
        if self.choice is not None:
            _check_preset(self.choice, "choice")
        return self


class WeatherConfig(Section):
    """Sky, rain, fog and sun of an episode."""

    choice: str | None = setting(
        None,
        title="Preset",
        basic=True,
        description="One of CARLA's weather presets, for all episodes.",
        group="scene",
    )
    random_from: Names | None = setting(
        None,
        title="Random from",
        description="Presets to draw one from for each episode; `[all]` is every one that the "
        "server has.",
        min_length=1,
        group="scene",
    )
    parameters: WeatherParameters = setting(
        WeatherParameters,
        title="Parameters",
        description="Single values that override the preset; without a preset, all 14.",
        group="scene",
    )
    lights: Lights = setting(
        "auto",
        title="Lamps",
        basic=True,
        description="Street lamps and vehicles' lights: `auto` turns them on when the sun is low, "
        "vehicles' in rain and fog, too.",
        group="scene",
    )
    changes: Annotated[tuple[WeatherChange, ...], Strict(strict=False)] = setting(
        (),
        title="Changes",
        description="What the weather becomes at which second; it moves there in a straight line, "
        "then stays.",
        group="scene",
    )

    @model_validator(mode="before")
    @classmethod
    def _accept_short_form(cls, data: Any) -> Any:
        if isinstance(data, str):
            return {"choice": data}
        if isinstance(data, dict) and not {"choice", "random_from"} & set(data):
            given = data.get("parameters")
            if not isinstance(given, dict) or len(given) < len(WeatherParameters.model_fields):
                return {"choice": DEFAULT_PRESET, **data}
        return data

    @model_validator(mode="after")
    def _check_presets(self) -> WeatherConfig:
        if self.choice is not None and self.random_from is not None:
            raise problem(
                "both choice and random_from are given.", "Keep one of them.", "random_from"
            )
        if self.choice is not None:
            _check_preset(self.choice, "choice")
        for position, name in enumerate(self.random_from or ()):
            if name != "all":
                _check_preset(name, "random_from", position)
        for position, (before, after) in enumerate(pairwise(self.changes), start=1):
            if after.at_s <= before.at_s:
                raise problem(
                    f"{after.at_s:g} s is not after {before.at_s:g} s, the moment before it.",
                    "List the changes in the order of time.",
                    "changes",
                    position,
                    "at_s",
                )
        if self.choice is None and self.random_from is None:
            missing = set(WeatherParameters.model_fields) - set(self.parameters.given())
            if missing:
                raise problem(
                    f"without a preset all 14 parameters are needed; {min(missing)} is missing.",
                    "Give `choice: ClearNoon`, or the missing parameters.",
                    "parameters",
                )
        return self

    @property
    def presets(self) -> tuple[str, ...]:
        """The presets that an episode may get; empty when all 14 parameters are explicit."""
        if self.choice is not None:
            return (self.choice,)
        if self.random_from is None:
            return ()
        return WEATHER_PRESETS if "all" in self.random_from else self.random_from
