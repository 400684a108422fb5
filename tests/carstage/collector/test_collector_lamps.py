"""Each vehicle is told its lights once, also one that appears later."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from carstage.collector.internals.lamps import Lamps

NIGHT = {"sun_altitude_angle": -30.0, "precipitation": 0.0, "fog_density": 0.0}
NOON = {**NIGHT, "sun_altitude_angle": 60.0}


def test_vehicle_that_appears_later_is_lit_as_the_others_are() -> None:
    batches: list[list[Any]] = []
    client = SimpleNamespace(apply_batch=batches.append)
    session: Any = SimpleNamespace(client=client)
    lamps = Lamps(session, "auto")
    first, later = SimpleNamespace(id=7), SimpleNamespace(id=9)
    lamps.light([first], NIGHT)
    lamps.light([first], NIGHT)
    lamps.light([first, later], NIGHT)
    assert [[command.actor_id for command in batch] for batch in batches] == [[7], [9]]
    lamps.light([first, later], NOON)
    assert [command.actor_id for command in batches[-1]] == [7, 9]
