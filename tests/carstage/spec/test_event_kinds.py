"""Kinds of events of other packages: registered once, by name, with who makes them happen."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from carstage.collector.internals.errors import SceneError
from carstage.collector.scenario.events.base import event_class
from carstage.config.events import section_of
from carstage.spec import EVENT_SPECS, EventSpec, event_plugins
from carstage.spec.events import CutIn, flag, named, quantity, register_event, word


@dataclass(frozen=True)
class Hail(EventSpec):
    """Hail falls on the road ahead."""

    collector = "no_such_module:Hail"

    kind: str = named("hail")
    size_mm: float = quantity(5.0, 1.0, 60.0, unit="mm", sentence="Of a stone.")
    where: str = word("road", ("road", "roof"))
    wind: bool = flag(False)


@pytest.fixture(autouse=True)
def as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    for_now = dict(EVENT_SPECS)
    monkeypatch.setattr("carstage.spec.events.EVENT_SPECS", for_now)
    monkeypatch.setattr("carstage.config.events.EVENT_SPECS", for_now)


def test_a_kind_is_registered_and_its_module_goes_to_the_collector() -> None:
    register_event(Hail)
    register_event(Hail)
    assert event_plugins([Hail(), CutIn()]) == [__name__]
    assert event_plugins(None) == []


def test_what_contradicts_itself_is_refused() -> None:
    @dataclass(frozen=True)
    class Taken(Hail):
        kind: str = named("cut_in")

    @dataclass(frozen=True)
    class Unnamed(Hail):
        kind: str = named("Hail storm")

    @dataclass(frozen=True)
    class Idle(Hail):
        collector = ""
        kind: str = named("idle")

    for cls, words in ((Taken, "registered already"), (Unnamed, "small"), (Idle, "collector")):
        with pytest.raises(ValueError, match=words):
            register_event(cls)


def test_the_configuration_takes_defaults_limits_and_words_from_the_specification() -> None:
    register_event(Hail)
    section = section_of(Hail)
    assert section(kind="hail").model_dump() == {**Hail().parameters(), "kind": "hail"}
    schema = section.model_json_schema()["properties"]
    assert schema["size_mm"]["title"] == "Size (mm)"
    assert (schema["size_mm"]["minimum"], schema["size_mm"]["maximum"]) == (1.0, 60.0)
    for wrong in ({"size_mm": 61.0}, {"where": "sea"}, {"wind": 3}, {"colour": "white"}):
        with pytest.raises(ValueError, match=next(iter(wrong))):
            section(kind="hail", **wrong)


def test_a_class_that_cannot_be_imported_is_named() -> None:
    with pytest.raises(SceneError, match="no_such_module:Hail of event hail cannot be imported"):
        event_class(Hail())
