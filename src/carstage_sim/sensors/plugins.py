"""Sensors of other packages: ``--plugin MODULE`` imports a module that registers its own."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from typing import TypeVar

from carstage_sim.sensors.sensor import Sensor, SensorRegistry
from carstage_sim.world.blueprints import AttributeType, add_sensor

_S = TypeVar("_S", bound=Sensor)


class PluginError(Exception):
    """A plug-in cannot be imported."""


def register_sensor(
    type_id: str, *, like: str, attributes: Sequence[tuple[str, AttributeType, str]] = ()
) -> Callable[[type[_S]], type[_S]]:
    """Class decorator: clients may spawn ``type_id``; this class makes its data.

    Args:
        type_id: blueprint id, such as ``sensor.camera.night_vision``.
        like: the sensor of CARLA whose attributes it has, and whose messages it sends: a client
            can read no others.
        attributes: further ones: name, type, default.

    Raises:
        ValueError: the id is taken or no sensor's, or there is no sensor ``like``.
    """

    def add(sensor_class: type[_S]) -> type[_S]:
        add_sensor(type_id, like, attributes)
        return SensorRegistry.register(type_id)(sensor_class)

    return add


def import_plugins(modules: Iterable[str]) -> None:
    """Import the modules of plug-ins; before anything asks for the blueprint library.

    Raises:
        PluginError: one cannot be imported, or what it registers is refused.
    """
    for module in modules:
        try:
            import_module(module)
        except Exception as error:
            raise PluginError(f"--plugin {module}: {error}") from error
