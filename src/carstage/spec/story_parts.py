"""What a storyboard does, part by part: its events and their actions, in the order of the file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Dict, Iterator, Optional, Sequence, Tuple

from carstage.spec.storyboard import (
    StoryAct,
    StoryAction,
    StoryEvent,
    StoryGroup,
    StoryManeuver,
    StorySpeed,
)
from carstage.spec.values import Value

STORY_EVENT, STORY_ACTION = "storyboard_event", "storyboard_action"


@dataclass(frozen=True, eq=False, repr=False)
class StoryPart(Value):
    """An event of a storyboard, or one of its actions, as a row of ``events.parquet``.

    Attributes:
        kind: ``STORY_EVENT`` or ``STORY_ACTION``.
        path: names of act, group, maneuver and event.
        actors: names of those who act.
        others: names of those whom its trigger and its actions name beside them.
        most: so often it may happen.
        action: the action; None: the whole event.
        nearest_counts: distances are those to the nearest of who takes part.
    """

    nearest_counts: ClassVar[bool] = True

    kind: str
    path: Tuple[str, str, str, str]
    actors: Tuple[str, ...]
    others: Tuple[str, ...]
    most: int
    action: Optional[StoryAction] = None

    def parameters(self) -> Dict[str, Any]:
        """Where it is in the file, and what it does."""
        found: Dict[str, Any] = dict(zip(("act", "group", "maneuver", "event"), self.path))
        if self.action is not None:
            found["action"] = self.action.name
            found["does"] = self.action.kind
        found["entities"] = list(self.actors)
        return found


def story_parts(acts: Sequence[StoryAct]) -> Tuple[StoryPart, ...]:
    """Each event, followed by its actions."""
    return tuple(
        part
        for act in acts
        for group in act.groups
        for maneuver in group.maneuvers
        for event in maneuver.events
        for part in _parts(act, group, maneuver, event)
    )


def taking_part(part: StoryPart, ego: str) -> Tuple[str, ...]:
    """Names of who takes part: who acts, and where that is the ego alone, whom the event names.

    Args:
        part: of the storyboard.
        ego: the ego's name.
    """
    return part.actors + (part.others if set(part.actors) <= {ego} else ())


def _parts(
    act: StoryAct, group: StoryGroup, maneuver: StoryManeuver, event: StoryEvent
) -> Iterator[StoryPart]:
    path = (act.name, group.name, maneuver.name, event.name)
    others = tuple(name for name in _named(event) if name not in group.actors)
    yield StoryPart(STORY_EVENT, path, group.actors, others, event.most)
    for action in event.actions:
        yield StoryPart(STORY_ACTION, path, group.actors, others, event.most, action)


def _named(event: StoryEvent) -> Tuple[str, ...]:
    """Whom an event's trigger and actions name, each once."""
    found: Dict[str, None] = {}
    for conditions in event.start or ():
        for condition in conditions:
            found.update(dict.fromkeys(condition.entities))
            if condition.other is not None:
                found[condition.other] = None
    for action in event.actions:
        if isinstance(action, StorySpeed) and action.other is not None:
            found[action.other] = None
    return tuple(found)
