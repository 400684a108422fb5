"""Variants of each episode: the same world recorded under other skies, or by other rigs."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

from pydantic import Field
from pydantic_core import PydanticCustomError

from carstage.config.attributes import ImageSize
from carstage.config.drivers import DeviceDriver
from carstage.config.fields import Section, problem, setting, shortened
from carstage.config.rig import Rig
from carstage.config.servers import EmbeddedServerConfig
from carstage.config.weather import WeatherConfig
from carstage.spec import is_variant_name

if TYPE_CHECKING:
    from carstage.config.model import Config

MOST_VARIANTS = 64
_MOST_EPISODES = 100_000


class Variant(Section):
    """What one variant has in place of the configuration's own; the rest stays as it is."""

    weather: WeatherConfig | None = setting(
        None,
        title="Weather",
        description="Its weather, in place of the configuration's; keys as in `weather`.",
    )
    rig: Rig | None = setting(
        None,
        title="Rig",
        description="The ego's sensors, in place of the configuration's; keys as in `rig`.",
    )
    image_size: ImageSize | None = setting(
        None,
        title="Image size",
        description="Of cameras that do not say otherwise, in place of the configuration's.",
        unit="px",
    )
    show_patches: bool | None = setting(
        None,
        title="Show patches",
        description="Whether it shows the patches, in place of the configuration's.",
    )


VariantsByName = Annotated[dict[str, Variant], Field(max_length=MOST_VARIANTS)]


def check_variants(config: Config) -> None:
    """Refuse variants that would not show one world, or that do not go with the rest.

    Raises:
        PydanticCustomError: with the path of a setting.
    """
    if not config.variants:
        return
    for name in config.variants:
        if not is_variant_name(name):
            raise problem(
                f"{shortened(repr(name))} cannot be a variant's name.",
                "Use up to 32 letters, digits, '_' and '-', beginning with a letter or digit.",
                "variants",
                name,
            )
    if config.planned_episodes > _MOST_EPISODES:
        message = f"{config.planned_episodes} episodes of all variants are more than a run has."
        raise problem(message, f"Have at most {_MOST_EPISODES}.", "variants")
    _check_repeatable(config)
    for name in config.variants:
        varied = config.as_variant(name)
        with _below("variants", name):
            varied.check_sensors()


def _check_repeatable(config: Config) -> None:
    """Refuse what makes every recording another one."""
    if config.timing.mode != "sync":
        message = "the frames of variants are the same only in a world that waits for each step."
        raise problem(message, "Set timing.mode to sync, or leave variants out.", "timing", "mode")
    if isinstance(config.ego.driver, DeviceDriver):
        message = "nobody drives alike in each variant."
        hint = "Drive once without variants, then replay the commands: `driver: {kind: replay}`."
        raise problem(message, hint, "ego", "driver", "kind")
    server = config.server
    if isinstance(server, EmbeddedServerConfig) and server.wet_grip == "on" and _skies(config):
        message = "water on the road would change the traffic from variant to variant."
        raise problem(message, "Leave it out, or set it to off.", "server", "wet_grip")


def _skies(config: Config) -> bool:
    """Whether variants have weathers of their own."""
    return any(variant.weather is not None for variant in config.variants.values())


def has_wet_grip(config: Config) -> bool:
    """Whether water on the road takes grip of the tyres, see ``server.wet_grip``.

    A CARLA server has no such rule, so nothing is to be switched off there.
    """
    server = config.server
    if not isinstance(server, EmbeddedServerConfig):
        return True
    return server.wet_grip == "on" or (server.wet_grip == "auto" and not _skies(config))


@contextmanager
def _below(*place: str) -> Iterator[None]:
    """Problems inside are those of a section at a place."""
    try:
        yield
    except PydanticCustomError as error:
        context = error.context or {}
        path = (*place, *context["path"])
        raise problem(context["sentence"], context["hint"], *path) from None
