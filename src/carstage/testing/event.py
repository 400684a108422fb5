"""What every kind of event must do; subclass ``EventTests`` in a test module and name a kind."""

# ruff: noqa: D102 (the name of a test states its rule)

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, ClassVar

import pytest

import carstage
from carstage.config import parse_config
from carstage.dataset import Dataset, Episode
from carstage.errors import ConfigError
from carstage.spec import EpisodeSpec, event_plugins, known_events

NEVER_S = 80_000.0
"""A time that no episode reaches."""


class EventTests:
    """The contract of a kind of event, as tests: one episode is recorded twice.

    The episode has this event, and once more at a time that it does not reach.

    Attributes:
        kind: of the event.
        parameters: other than the defaults; with them it has to happen in the episode.
        configuration: of the episode, such as ``map``, ``seed`` or ``duration_s``.
    """

    kind: str
    parameters: ClassVar[Mapping[str, Any]] = {}
    configuration: ClassVar[Mapping[str, Any]] = {}

    @pytest.fixture(scope="class")
    def datasets(self, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
        """Two datasets with the same episode."""
        event = {"kind": self.kind, **self.parameters}
        config = {
            "duration_s": 20.0,
            "vehicles": {"count": 0},
            "pedestrians": {"count": 0},
            "rig": {"sensors": [{"id": "GNSS", "kind": "gnss"}]},
            "labels": {"cameras": []},
            "server": {"kind": "embedded", "self_test": "off"},
            **self.configuration,
            "scenario": {"kind": "autopilot", "events": [event, {**event, "at_s": NEVER_S}]},
        }
        folders = [tmp_path_factory.mktemp(name) / "dataset" for name in ("one", "again")]
        for folder in folders:
            result = carstage.run(config, folder)
            assert result.exit_code == 0
        return folders

    def test_the_configuration_keeps_the_limits_of_the_specification(self) -> None:
        for each in fields(known_events()[self.kind]):
            for bound, beyond in (("low", -1.0), ("high", 1.0)):
                if bound not in each.metadata:
                    continue
                event = {"kind": self.kind, each.name: each.metadata[bound] + beyond}
                text = json.dumps({"scenario": {"kind": "autopilot", "events": [event]}})
                with pytest.raises(ConfigError, match=rf"^scenario.events\[0\].{each.name}: "):
                    parse_config(text)

    def test_the_specification_is_read_as_it_was_written(self, datasets: list[Path]) -> None:
        spec = _episode(datasets[0]).spec
        assert EpisodeSpec.from_json(json.loads(spec.canonical_json())) == spec
        for event in spec.scenario.events or ():
            assert event.kind == self.kind
            assert bool(event.collector) == bool(event_plugins([event]))

    def test_it_happens_and_tells_who_took_part(self, datasets: list[Path]) -> None:
        row, _ = _rows(datasets[0])
        assert row["state"] == "happened", row["reason"]
        assert row["placed_tick"] <= row["begin_tick"]
        assert len(row["actors"]) > 0

    def test_one_whose_time_does_not_come_is_not_placed(self, datasets: list[Path]) -> None:
        _, row = _rows(datasets[0])
        assert row["state"] == "not placed"
        assert row["reason"] == "its time has not come"
        assert row["actors"] == []

    def test_the_dataset_is_valid(self, datasets: list[Path]) -> None:
        report = carstage.validate(datasets[0])
        assert report.ok, report

    def test_the_same_configuration_gives_the_same_again(self, datasets: list[Path]) -> None:
        one, again = (_episode(folder) for folder in datasets)
        assert _rows(datasets[0]) == _rows(datasets[1])
        assert one.objects().equals(again.objects())
        assert one.ego().equals(again.ego())


def _episode(folder: Path) -> Episode:
    (episode,) = Dataset(folder).episodes
    return episode


def _rows(folder: Path) -> list[dict[str, Any]]:
    table = _episode(folder).events()
    assert table is not None
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows
