"""What sensors measured last, for a driver that looks at it."""

from __future__ import annotations

import threading
from typing import Any, Callable, Dict, Iterable, List, Mapping

from carstage.collector.internals.errors import RecordingError


class NewestData:
    """The newest data of some sensors: taken in the client's threads, asked for by the main one.

    Args:
        sensors: their ids.
    """

    def __init__(self, sensors: Iterable[str]) -> None:
        self._sensors = tuple(sensors)
        self._data: Dict[str, Any] = {}
        self._changed = threading.Condition()

    def callbacks(self) -> Dict[str, Callable[[Any], None]]:
        """What to call with the data of each sensor."""

        def take(sensor: str) -> Callable[[Any], None]:
            return lambda data: self._take(sensor, data)

        return {sensor: take(sensor) for sensor in self._sensors}

    def newest(self) -> Mapping[str, Any]:
        """The last data of each sensor that has delivered any."""
        with self._changed:
            return dict(self._data)

    def of_frame(self, frame: int, timeout_s: float) -> Mapping[str, Any]:
        """The data of that frame, once all sensors have delivered them.

        Raises:
            RecordingError: one did not in that time.
        """

        def lacking() -> List[str]:
            return [one for one in self._sensors if self._frame(one) < frame]

        with self._changed:
            if not self._changed.wait_for(lambda: not lacking(), timeout_s):
                raise RecordingError(
                    "Sensor %s, which the driver looks at, delivered nothing of frame %d within "
                    "%g s." % (", ".join(lacking()), frame, timeout_s),
                    "Look into the server's log; a retry starts the episode anew.",
                )
            return dict(self._data)

    def _frame(self, sensor: str) -> int:
        return int(self._data[sensor].frame) if sensor in self._data else -1

    def _take(self, sensor: str, data: Any) -> None:
        with self._changed:
            self._data[sensor] = data
            self._changed.notify_all()
