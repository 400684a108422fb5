"""No frame is missing, every sensor's state is accounted for, and time advances by 1 / fps."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from carstage.dataset.ledger import saved_times_s, unlabelled_frames
from carstage.dataset.reading import Episode, Sensor
from carstage.dataset.tables import row_sensor
from carstage.validation.checks.findings import Findings, Severity

TIMESTAMP_TOLERANCE_S = 1e-6
_GOOD_STATES = ("ok", "off")


def check_ledger(episode: Episode, ledger: pa.Table, findings: Findings) -> None:
    """Check ``frames.parquet`` against the spec.

    The declared mode decides: in synchronous mode with sensors in step and ``on_incomplete: wait``
    any state but ``ok`` and ``off`` is an error, else a warning; in synchronous mode timestamps are
    ``tick / fps`` and the server's frame numbers consecutive, else both only have to increase.
    """
    spec = episode.spec
    synchronous = spec.timing.synchronous
    ticks = ledger["tick"].to_pylist()
    if ticks != list(range(spec.steps)):
        findings.add(
            "ledger_ticks", f"{len(ticks)} ticks are in the ledger, {spec.steps} were asked for"
        )
    ks = ledger["k"].to_pylist()
    saved = [k for k in ks if k is not None]
    if saved != list(range(episode.frames)):
        findings.add(
            "frames_missing", f"{len(saved)} frames are in the ledger, {episode.frames} committed"
        )
    if synchronous and saved != list(range(spec.saved_frames)):
        findings.add(
            "frames_missing",
            f"{len(saved)} frames are saved; {spec.steps} steps, every {spec.save_every} saved, "
            f"are {spec.saved_frames}",
        )
    _check_time(ledger, spec.fps, synchronous, findings)
    severity: Severity = "error" if spec.timing.demands_all else "warning"
    sensors = episode.calibration.sensors
    for sensor in sensors:
        states = ledger[f"{sensor}.state"].to_pylist()
        reasons = ledger[f"{sensor}.reason"].to_pylist()
        sparse = spec.save_every > 1 and "sensor_tick" in sensors[sensor].attributes
        why = ": its rate_hz and save_every do not meet" if sparse else ""
        if saved and {states[tick] for tick, k in enumerate(ks) if k is not None} == {"off"}:
            findings.add(
                "ledger_state",
                f"it measured in no frame that is saved{why}",
                sensor=sensor,
                severity="warning",
            )
        for tick, k, state, reason in zip(ticks, ks, states, reasons, strict=True):
            if state not in _GOOD_STATES:
                findings.add(
                    "ledger_state",
                    f"tick {tick} is {state}: {reason or 'no reason given'}",
                    frame=k,
                    sensor=sensor,
                    severity=severity,
                )
    for camera, frames in unlabelled_frames(ledger).items():
        for k in frames:
            text = "its picture has no labels: the depth image that they are made from is missing"
            findings.add("ledger_state", text, frame=k, sensor=camera, severity=severity)


def _check_time(ledger: pa.Table, fps: float, synchronous: bool, findings: Findings) -> None:
    times: list[Any] = ledger["timestamp_s"].to_pylist()
    frames: list[Any] = ledger["server_frame"].to_pylist()
    ks = ledger["k"].to_pylist()
    if synchronous:
        for tick, (k, time_s) in enumerate(zip(ks, times, strict=True)):
            if abs(time_s - tick / fps) > TIMESTAMP_TOLERANCE_S:
                findings.add(
                    "timestamps",
                    f"tick {tick} is at {time_s:.6f} s instead of {tick / fps:.6f} s",
                    frame=k,
                )
    for tick, ((a, b), (time_a, time_b)) in enumerate(
        zip(pairwise(frames), pairwise(times), strict=True)
    ):
        if b <= a or (synchronous and b != a + 1):
            findings.add(
                "server_frames",
                f"after server frame {a} of tick {tick} comes frame {b}",
                frame=ks[tick + 1],
            )
        if time_b <= time_a:
            findings.add("timestamps", f"time does not advance after tick {tick}", frame=ks[tick])


def check_row_sensors(
    episode: Episode, ledger: pa.Table, recorded: dict[str, list[int]], findings: Findings
) -> None:
    """Check the tables of IMU, GNSS, radar, radio: a row for each recorded frame, at its time.

    Raises:
        DatasetError: a table is missing or damaged.
    """
    times = saved_times_s(ledger)
    for sensor in episode.sensors:
        row_kind = row_sensor(sensor.kind)
        if row_kind is None:
            continue
        table = sensor.table
        if not table.schema.equals(row_kind.schema):
            findings.add("schema", f"{sensor.id}.parquet has other columns", sensor=sensor.id)
            continue
        ks: list[Any] = table["k"].to_pylist()
        _check_lists(sensor, findings)
        if ks != recorded[sensor.id]:
            findings.add(
                "frames_missing",
                f"{sensor.id}.parquet has {len(ks)} rows for {len(recorded[sensor.id])} frames",
                sensor=sensor.id,
            )
        row_times: list[Any] = table["timestamp_s"].to_pylist()
        for k, time_s in zip(ks, row_times, strict=True):
            at_s = times.get(k, time_s)
            if not abs(time_s - at_s) <= TIMESTAMP_TOLERANCE_S:  # NaN is no time
                findings.add(
                    "timestamps",
                    f"the row is at {time_s:.6f} s, the frame at {at_s:.6f} s",
                    frame=k,
                    sensor=sensor.id,
                )


def _check_lists(sensor: Sensor, findings: Findings) -> None:
    """Lists of a row have an entry for each detection or message: they are of one length."""
    table = sensor.table
    lists = [column for column in table.columns if pa.types.is_list(column.type)]
    lengths = [pc.list_value_length(column).to_pylist() for column in lists]
    for k, *of_row in zip(table["k"].to_pylist(), *lengths, strict=True):
        if len(set(of_row)) > 1:
            text = f"lists of the row have {min(of_row)} to {max(of_row)} entries"
            findings.add("schema", text, frame=k, sensor=sensor.id)
