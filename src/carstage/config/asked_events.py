"""The events that a scenario is asked for; ``events`` has their models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Strict

from carstage.config.fields import Section, problem, setting
from carstage.config.of_its_kind import OfItsKind
from carstage.config.timing import Timing

MOST_EVENTS = 100


class Event(Section):
    """Something that happens to the ego on its way; the base of the kinds."""

    kind: str


def _models() -> Mapping[str, type[Event]]:
    from carstage.config.events import EVENT_KINDS  # few configurations ask for any

    return EVENT_KINDS


Events = Annotated[tuple[Annotated[Event, OfItsKind(Event, _models)], ...], Strict(strict=False)]


def no_events() -> Any:
    """The setting of a scenario; by default nothing happens but traffic."""
    return setting(
        (),
        title="Events",
        description="What happens to the ego on its way, such as `{kind: pedestrian_crosses}`; "
        "see docs/how-to/events.md.",
        group="ego",
        max_length=MOST_EVENTS,
    )


def check_events(scenario: Section, timing: Timing) -> None:
    """Refuse events where the world does not wait for who moves them.

    Raises:
        PydanticCustomError: it runs by the clock.
    """
    if getattr(scenario, "events", ()) and timing.mode != "sync":
        raise problem(
            "events need a world that waits for each step.",
            "Set timing.mode to sync, or leave the events out.",
            "scenario",
            "events",
        )
