"""What the self-test says of a server, in tables and in JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Check:
    """One convention or property of the server.

    Attributes:
        name: what was asked.
        ok: whether the server does what the labels take for granted.
        found: what it does, in words.
        expected: what is taken for granted, in the same words.
        figure: how well what was found explains the recording, in ``unit``; None where nothing
            could be measured.
        unit: of ``figure``: ``share`` (of pixels or points that agree, 0 to 1), ``px`` or
            ``m``.
    """

    name: str
    ok: bool
    found: str
    expected: str
    figure: float | None = None
    unit: str = "share"

    def line(self) -> str:
        """For people."""
        figure = "" if self.figure is None else f" ({self.figure:.3g} {self.unit})"
        wanted = "" if self.ok else f"; expected: {self.expected}"
        return f"{'ok  ' if self.ok else 'FAIL'} {self.name}: {self.found}{figure}{wanted}"


@dataclass(frozen=True, slots=True)
class Verdict:
    """What the self-test found on a server.

    Attributes:
        server: its CARLA version.
        client: version of the client wheel that recorded.
        map: where it was recorded.
        checks: in the order that they were made in.
        gnss: ``projection`` and ``north`` of its GNSS sensors; None where they are of no known
            kind or it has none.
    """

    server: str
    client: str
    map: str
    checks: tuple[Check, ...]
    gnss: Mapping[str, str] | None = None

    @property
    def ok(self) -> bool:
        """Whether every check holds."""
        return all(check.ok for check in self.checks)

    @property
    def failed(self) -> tuple[str, ...]:
        """Names of the checks that do not hold."""
        return tuple(check.name for check in self.checks if not check.ok)

    @classmethod
    def from_json(cls, document: Mapping[str, Any]) -> Verdict:
        """The verdict that ``to_json`` wrote.

        Raises:
            KeyError, TypeError: it is something else.
        """
        return cls(
            document["server"],
            document["client"],
            document["map"],
            tuple(Check(**check) for check in document["checks"]),
            document["gnss"],
        )

    def to_json(self) -> dict[str, Any]:
        """As the commit marker keeps it; the same recording gives the same document."""
        return {
            "ok": self.ok,
            "server": self.server,
            "client": self.client,
            "map": self.map,
            "checks": [
                asdict(check)
                | {"figure": None if check.figure is None else round(float(check.figure), 4)}
                for check in self.checks
            ],
            "gnss": None if self.gnss is None else dict(self.gnss),
        }


def failed_verdict(server: str, client: str, reason: str) -> Verdict:
    """The verdict where the recording itself failed."""
    check = Check("recording", False, reason, "a recording of a few frames")
    return Verdict(server, client, "", (check,))
