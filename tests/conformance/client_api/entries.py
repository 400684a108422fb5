"""What the check knows of each name of the client: who tries it, and how the verdict reads."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from client_api.trial_scene import TrialScene

    Act = Callable[[TrialScene], None]


class Support(Enum):
    """How far a name of the client is served."""

    WORKS = "works"
    LIMITED = "limited"
    CLIENT_SIDE = "client-side"


@dataclass(frozen=True)
class Entry:
    """Names that are tried together.

    Attributes:
        names: as :func:`client_api.surface.surface` gives them; ``Class.*`` stands for
            all of a class, which its trial then looks at one by one.
        support: how far they are served.
        sentence: what the trial sees happen; for a limited name, what is different from CARLA.
        act: does it and raises ``AssertionError`` when the effect is not there.
        own_process: whether it replaces the episode or the Traffic Manager; it is played after the
            others, in a process of its own.
    """

    names: tuple[str, ...]
    support: Support
    sentence: str
    act: Act
    own_process: bool = False

    def covers(self, name: str) -> bool:
        """Whether a name of the client is among its own."""
        group = name.rpartition(".")[0] or name
        return name in self.names or f"{group}.*" in self.names


_ENTRIES: list[Entry] = []


def _register(
    names: tuple[str, ...], support: Support, different: str, own_process: bool
) -> Callable[[Act], Act]:
    def add(act: Act) -> Act:
        seen = " ".join((act.__doc__ or "").split())
        _ENTRIES.append(Entry(names, support, different or seen, act, own_process))
        return act

    return add


def works(*names: str, own_process: bool = False) -> Callable[[Act], Act]:
    """These names do what they do in CARLA; the trial's docstring says what it sees."""
    return _register(names, Support.WORKS, "", own_process)


def limited(different: str, *names: str, own_process: bool = False) -> Callable[[Act], Act]:
    """These names are answered, with a difference from CARLA that the sentence states."""
    return _register(names, Support.LIMITED, different, own_process)


def client_side(*names: str) -> Callable[[Act], Act]:
    """These names live in the client alone; they are exercised all the same."""
    return _register(names, Support.CLIENT_SIDE, "", False)


def entries() -> Iterator[Entry]:
    """All entries, in the order of their modules."""
    return iter(_ENTRIES)
