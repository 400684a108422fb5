"""What a user asks for: the schema, reading and checking it, printing it.

``Config`` is the schema; ``load_config`` reads a YAML file; ``config_template`` writes one.
"""

from carstage.config.loading import (
    check_config,
    dump_config,
    load_config,
    load_demo,
    parse_config,
)
from carstage.config.model import Config
from carstage.config.presets import RIG_PRESETS
from carstage.config.printing import config_reference, config_schema, config_template
from carstage.config.sensors import SENSOR_KINDS, Sensor
from carstage.config.weather import WEATHER_PRESETS

__all__ = [
    "RIG_PRESETS",
    "SENSOR_KINDS",
    "WEATHER_PRESETS",
    "Config",
    "Sensor",
    "check_config",
    "config_reference",
    "config_schema",
    "config_template",
    "dump_config",
    "load_config",
    "load_demo",
    "parse_config",
]
