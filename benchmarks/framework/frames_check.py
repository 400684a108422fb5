"""Does the log hold, under each frame, what the server sent for that frame?

While the collector records eight sensors, a second client, the stream recorder, subscribes to the
same streams. It notes frame, time and a digest of each message. Each record of the raw log is
compared with the message of that frame number. A second, short recording goes through a proxy that
holds one picture back: the ledger must name that frame and that sensor.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.framework.faults.streams import DisturbedStreams
from benchmarks.framework.journal import Sent, digest_of, read_journal
from benchmarks.framework.late_stream import HeldPicture
from benchmarks.framework.recordings import drop_segment, seals_segment, server_for
from carstage.bench.episodes import (
    Progress,
    camera,
    client_plan,
    events_of,
    planned_episode,
    roof_sensor,
)
from carstage.bench.verdict import Figure, Verdict
from carstage.execution import CollectorProcess
from carstage.rawlog.format import KIND_DATA, LEDGER
from carstage.rawlog.reader import EpisodeLog
from carstage.server import Endpoint
from carstage.spec import EpisodeSpec

TICKS = 20_000
_LOOP = 50
_FPS = 20
_SIZE = (96, 54)
_LATE_SIZE = (80, 45)
_LATE_SENSOR = "DEPTH"
_PROXY_HOST = "127.0.0.2"
_LATE_TICKS = 120
_LATE_MESSAGE = 40
_LATE_S = 1.5
"""The collector waits 1 s for a frame when incomplete ones are skipped. For another second it
separates late from missing."""

_WARMUP_TICKS = 200
"""Time for the stream recorder to subscribe: it has to find the sensors first."""

_LAST_TICKS = 5
"""Recorded and not compared: the stream recorder may miss what was sent last, with the sensors."""

_SAME_TIME_S = 1e-6
_BGRA = 4


@dataclass(slots=True)
class Comparison:
    """What was found so far.

    Attributes:
        ticks: rows of the ledger that were compared.
        records: records of sensors that were compared.
        wrong: by sensor and kind of fault, how many records or rows.
        changed: records whose data differ from those of the tick before; only there a record under
            the wrong frame can be noticed.
    """

    ticks: int = 0
    records: int = 0
    changed: int = 0
    wrong: Counter[tuple[str, str]] = field(default_factory=Counter)
    _last: dict[str, bytes] = field(default_factory=dict)

    def add_row(self, row: Mapping[str, Any]) -> None:
        """Note a row of the ledger: ticks in order, every sensor ok."""
        if row["tick"] != self.ticks:
            self.wrong[LEDGER, "tick"] += 1
        self.ticks += 1
        for sensor, outcome in row["sensors"].items():
            if outcome["state"] != "ok":
                self.wrong[sensor, str(outcome["state"])] += 1

    def add_record(
        self, sensor: str, row: Mapping[str, Any], record: Recorded | None, sent: Sent | None
    ) -> None:
        """Note a sensor's record of that row, and what was sent for its frame."""
        if record is None or sent is None:
            self.wrong[sensor, "no record" if record is None else "no message"] += 1
            return
        self.records += 1
        self.changed += record.digest != self._last.get(sensor)
        self._last[sensor] = record.digest
        if record.frame != row["frame"]:
            self.wrong[sensor, "frame"] += 1
        if abs(record.timestamp_s - sent.timestamp_s) > _SAME_TIME_S:
            self.wrong[sensor, "time"] += 1
        if record.digest != sent.digest:
            self.wrong[sensor, "data"] += 1


@dataclass(frozen=True, slots=True)
class Recorded:
    """What the raw log holds of one sensor in one tick."""

    frame: int
    timestamp_s: float
    digest: bytes


@dataclass(frozen=True, slots=True)
class Lateness:
    """What the ledger holds of a recording in which one picture came late.

    Attributes:
        frame: the frame of that picture.
        state: of the sensor in that frame.
        others: rows in which another sensor is not ok, or frames before in which this one is not.
    """

    frame: int
    state: str
    others: int


def check_frames(
    *,
    ticks: int = TICKS,
    scratch: Path | None = None,
    progress: Progress = lambda done, total: None,
    running: Endpoint | None = None,
) -> Verdict:
    """Record, listen along and compare; then record with one late picture.

    Args:
        ticks: that are compared.
        scratch: where the raw log goes, segment by segment.
        progress: called with the ticks recorded and their total number.
        running: the server, its streaming port behind its RPC port; None starts one.
    """
    with (
        tempfile.TemporaryDirectory(prefix="carstage-bench-", dir=scratch) as folder,
        server_for(_LOOP, running) as endpoint,
    ):
        found = _compare(endpoint, Path(folder) / "compared", ticks, progress)
        late = _record_late(endpoint, Path(folder) / "late")
    wrong = {f"{sensor}: {fault}": count for (sensor, fault), count in sorted(found.wrong.items())}
    return Verdict(
        "frames-check",
        (
            Figure("ticks", found.ticks, "==", ticks),
            Figure("sensors", len(_sensors())),
            Figure("records_compared", found.records, "==", ticks * len(_sensors())),
            Figure("mismatched", sum(found.wrong.values()), "==", 0),
            Figure("records_unlike_the_tick_before", found.changed / max(1, found.records)),
            Figure("state_of_the_late_sensor", late.state, "==", "late"),
            Figure("rows_that_blame_another", late.others, "==", 0),
        ),
        (
            *(f"{fault}: {count}" for fault, count in wrong.items()),
            f"Frame {late.frame} of {_LATE_SENSOR} was held back for {_LATE_S:g} s.",
        ),
    )


def _sensors() -> list[dict[str, Any]]:
    return [
        camera("CAM_FRONT"),
        camera("CAM_WIDE", fov_deg=120.0),
        camera(_LATE_SENSOR, "depth", image_size=list(_LATE_SIZE)),
        camera("SEMANTIC", "semantic"),
        camera("INSTANCE", "instance"),
        roof_sensor("LIDAR", "lidar", channels=8, points_per_second=20_000),
        roof_sensor("IMU", "imu"),
        roof_sensor("GNSS", "gnss"),
    ]


def _spec(ticks: int, warmup_ticks: int, on_incomplete: str) -> EpisodeSpec:
    return planned_episode(
        {
            "fps": _FPS,
            "duration_s": ticks / _FPS,
            "image_size": list(_SIZE),
            "vehicles": {"count": 5},
            "pedestrians": {"count": 0},
            "timing": {"warmup_ticks": warmup_ticks, "on_incomplete": on_incomplete},
            "rig": {"sensors": _sensors()},
        }
    )


def _compare(endpoint: Endpoint, folder: Path, ticks: int, progress: Progress) -> Comparison:
    folder.mkdir()
    raw, journal = folder / "raw", folder / "journal"
    spec = _spec(ticks + _LAST_TICKS, _WARMUP_TICKS, "wait")
    records: dict[tuple[str, int], Recorded] = {}
    with _stream_recorder(endpoint, spec, folder, journal) as recorder:
        reported = events_of(recorder)
        _await(reported, "recorder_waits")
        with _collector(spec, endpoint, folder, raw, endpoint.host) as collector:
            for event in events_of(collector):
                if event["event"] == "tick":
                    progress(min(event["tick"] + 1, ticks), ticks)
                segment = seals_segment(event)
                if segment is not None:
                    records.update(_digests(raw, spec, segment))
                    drop_segment(raw, segment, (sensor.id for sensor in spec.sensors))
        _await(reported, "recorder_listens")
        recorder.stop()
        _await(reported, "episode_recorded")
    return _compared(raw, spec, ticks, records, read_journal(journal))


def _compared(
    raw: Path,
    spec: EpisodeSpec,
    ticks: int,
    records: Mapping[tuple[str, int], Recorded],
    sent: Mapping[tuple[int, int], Sent],
) -> Comparison:
    log, found = EpisodeLog(raw), Comparison()
    actors = log.header["sensor_actor_ids"]
    for row in log.ledger()[:ticks]:
        found.add_row(row)
        for sensor in spec.sensors:
            of_row = sent.get((actors[sensor.id], row["frame"]))
            found.add_record(sensor.id, row, records.get((sensor.id, row["tick"])), of_row)
    return found


def _digests(raw: Path, spec: EpisodeSpec, segment: int) -> dict[tuple[str, int], Recorded]:
    log = EpisodeLog(raw)
    return {
        (sensor.id, record.tick): Recorded(
            record.frame, record.timestamp_s, digest_of(record.payload)
        )
        for sensor in spec.sensors
        for record in log.read_segment(sensor.id, segment)
        if record.kind == KIND_DATA
    }


def _record_late(endpoint: Endpoint, folder: Path) -> Lateness:
    folder.mkdir()
    spec = _spec(_LATE_TICKS, warmup_ticks=10, on_incomplete="skip")
    width, height = _LATE_SIZE
    held = HeldPicture(width * height * _BGRA, _LATE_MESSAGE, _LATE_S)
    with (
        DisturbedStreams(_PROXY_HOST, endpoint.port, endpoint.port + 1, lambda _: held),
        _collector(spec, endpoint, folder, folder / "raw", _PROXY_HOST) as collector,
    ):
        for _ in events_of(collector):
            pass
    frame = held.frame
    if frame is None:
        return Lateness(0, f"only {_LATE_TICKS} ticks and no late picture", 0)
    return lateness_in(EpisodeLog(folder / "raw").ledger(), frame)


def lateness_in(ledger: list[dict[str, Any]], frame: int) -> Lateness:
    """What a ledger holds of the frame that was held back, and of the others."""
    rows = {row["frame"]: row["sensors"] for row in ledger}
    blamed = [
        (number, sensor)
        for number, sensors in rows.items()
        for sensor, outcome in sensors.items()
        if outcome["state"] != "ok"
    ]
    others = sum(sensor != _LATE_SENSOR or number < frame for number, sensor in blamed)
    state = str(rows[frame][_LATE_SENSOR]["state"]) if frame in rows else "no such frame"
    return Lateness(frame, state, others)


def _collector(
    spec: EpisodeSpec, endpoint: Endpoint, folder: Path, raw: Path, host: str
) -> CollectorProcess:
    plan = client_plan(spec, endpoint, raw)
    plan["server"]["host"] = host
    return CollectorProcess(
        plan,
        plan_path=folder / "plan.json",
        log_path=folder / "collector.log",
    )


def _stream_recorder(
    endpoint: Endpoint, spec: EpisodeSpec, folder: Path, journal: Path
) -> CollectorProcess:
    plan = {
        "host": endpoint.host,
        "port": endpoint.port,
        "timeout_s": 60.0,
        "kinds": {sensor.blueprint: sensor.kind for sensor in spec.sensors},
        "sensors": len(spec.sensors),
        "journal": str(journal),
    }
    return CollectorProcess(
        plan,
        plan_path=folder / "stream-recorder.json",
        log_path=folder / "stream-recorder.log",
        module="benchmarks.framework.clients.stream_recorder",
    )


def _await(events: Any, name: str) -> None:
    """Read events until one of that name."""
    for event in events:
        if event["event"] == name:
            return
