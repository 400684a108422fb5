"""Configurations as text: YAML in and out, CARLA-style lists of sensors in and out."""

from __future__ import annotations

import re
from typing import Any

from carstage.errors import ConfigError
from carstage.web.configure.calibrations import read_calibration
from carstage.web.configure.carla_sensors import read_sensors, write_sensors
from carstage.web.configure.checking import ConfigChecker
from carstage.web.configure.problems import problems_of
from carstage.web.configure.store import ConfigStore
from carstage.web.messages import (
    ConfigExportRequest,
    ConfigImportRequest,
    ConfigImportResult,
    ConfigText,
)
from carstage.web.messages.base import Document


class ConfigTexts:
    """Reads and writes; keeps nothing.

    Args:
        checker: what is valid.
        store: the saved configuration, for what does not bring its own.
    """

    def __init__(self, checker: ConfigChecker, store: ConfigStore) -> None:
        self._checker = checker
        self._store = store

    def read(self, request: ConfigImportRequest) -> ConfigImportResult:
        """The configuration that a text stands for, and what is wrong with it.

        Raises:
            BadInputError: it cannot be read at all.
        """
        from carstage.config import dump_config

        warnings: list[str] = []
        if request.format == "yaml":
            document = _read_yaml(request.text)
        else:
            base = self._store.state().config if request.base is None else request.base
            others = _without_ids(base)
            if request.format == "calibration":
                read = read_calibration(request.text)
                sensors, warnings = read.sensors, read.warnings
                if not read.is_rig:
                    sensors, others = self._joined(base, sensors), base
            else:
                sensors, warnings = read_sensors(request.text)
            document = {**others, "rig": {"sensors": sensors}}
        try:
            config = self._checker.parse(document)
        except ConfigError as error:
            return ConfigImportResult(config=document, errors=problems_of(error), warnings=warnings)
        return ConfigImportResult(
            config=dump_config(config), warnings=[*warnings, *config.warnings()]
        )

    def _joined(self, base: Document, sensors: list[Document]) -> list[Document]:
        """The sensors of a configuration, and others under names that are free.

        Raises:
            ConfigError: the configuration is wrong, so that its rig is not known.
        """
        from carstage.config import dump_config

        there = dump_config(self._checker.parse(base))["rig"]["sensors"]
        taken = {str(sensor["id"]).lower() for sensor in there}
        for sensor in sensors:
            stem, number = sensor["id"], 2
            while sensor["id"].lower() in taken:
                sensor["id"], number = f"{stem}_{number}", number + 1
            taken.add(sensor["id"].lower())
        return [*there, *sensors]

    def write(self, request: ConfigExportRequest) -> ConfigText:
        """A configuration as text.

        Raises:
            ConfigError: sensors are asked for, and the configuration is wrong.
        """
        document = self._store.state().config if request.config is None else request.config
        name = re.sub(r"[^A-Za-z0-9_.-]+", "-", str(document.get("name", ""))).strip("-.") or "run"
        if request.format == "carla-json":
            text = write_sensors(self._checker.parse(document))
            return ConfigText(text=text, file_name=f"{name[:60]}-sensors.json")
        import yaml

        text = yaml.dump(document, Dumper=_dumper(), sort_keys=False, allow_unicode=True, width=100)
        return ConfigText(text=text, file_name=f"{name[:60]}.yaml")


def _read_yaml(text: str) -> Document:
    from carstage.config.yaml_text import parse_yaml

    document = parse_yaml(text, "the text")
    if document is None:
        return {}
    if not isinstance(document, dict):
        raise ConfigError(
            "The text is not a mapping of keys to values.", "Choose a configuration's file."
        )
    return document


def _without_ids(base: Document) -> Document:
    """Settings that name sensors by id go back to their defaults: those sensors are gone."""
    labels, conversion, ego = (base.get(key) for key in ("labels", "conversion", "ego"))
    changed = dict(base)
    if isinstance(labels, dict):
        changed["labels"] = dict(labels)
        if labels.get("cameras", "all") != "all":
            changed["labels"]["cameras"] = "all"
        if labels.get("lidars", "all") != "all":
            changed["labels"]["lidars"] = []
        occupancy = labels.get("occupancy")
        if isinstance(occupancy, dict) and occupancy.get("frame", "ego") != "ego":
            changed["labels"]["occupancy"] = {**occupancy, "frame": "ego"}
    if isinstance(conversion, dict) and conversion.get("codecs"):
        changed["conversion"] = {**conversion, "codecs": {}}
    if isinstance(ego, dict):
        driver = ego.get("driver")
        if isinstance(driver, dict) and driver.get("camera") is not None:
            changed["ego"] = {**ego, "driver": {**driver, "camera": None}}
    return changed


def _dumper() -> Any:
    """YAML as people write it: short lists of numbers and words on one line."""
    import yaml

    class Dumper(yaml.SafeDumper):
        def ignore_aliases(self, data: Any) -> bool:
            return True

    def sequence(dumper: yaml.SafeDumper, data: list[Any]) -> yaml.Node:
        flat = all(not isinstance(value, dict | list) for value in data)
        return dumper.represent_sequence("tag:yaml.org,2002:seq", data, flow_style=flat)

    Dumper.add_representer(list, sequence)
    return Dumper
