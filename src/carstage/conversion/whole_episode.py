"""What belongs to a whole episode, written once all its segments are converted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from carstage.annotation.schema import (
    CONTROL_COLUMNS,
    CONTROLS,
    EVENT_COLUMNS,
    EVENTS,
    frame_tables,
)
from carstage.codecs import codec_for
from carstage.conversion.documents import (
    calibration_document,
    episode_document,
    ledger_table,
    to_json,
)
from carstage.conversion.encoded import parts_folder
from carstage.conversion.segment import label_schema, read_label_part, rows_to_table
from carstage.conversion.sensors import plan_sensors
from carstage.conversion.town import Town, make_vector_map
from carstage.dataset.tables import row_sensor, write_table
from carstage.errors import ConversionError
from carstage.files.hashing import hash_of
from carstage.rawlog.reader import ActorInfo, EpisodeLog, WorldFrame
from carstage.storage.attempt_files import AttemptFiles, write_document

Rows = Sequence[dict[str, Any]]


def write_episode(
    raw_folder: Path,
    attempt_files: AttemptFiles,
    codecs: Mapping[str, str],
    rows: Mapping[str, Rows],
    opendrive: str | None,
    town: Town | None,
    agent: str | None = None,
) -> Town:
    """Write the tables and documents of an episode; remove what is none of its files.

    Args:
        raw_folder: of the raw log.
        attempt_files: receives the files.
        codecs: name of the codec by sensor id, where it is not the default of the sensor's kind.
        rows: of each sensor that becomes a table.
        opendrive: named hash of the town's OpenDRIVE text; None where it was not recorded.
        town: what its vector map is; None: it is made where the episode wants it.
        agent: name of the agent beside the ego whose episode it is; None: the ego's.

    Returns:
        The town.

    Raises:
        ConversionError: the recording is not whole, or a label part is gone or damaged.
        RawLogError: it is damaged.
    """
    log = EpisodeLog(raw_folder, agent)
    writer = _EpisodeWriter(log, attempt_files, codecs, agent)
    actors = log.actors()
    ego = actors.get(int(log.header["ego_id"]))
    if ego is None:
        raise ConversionError(
            f"Episode {log.header['episode_id']}: the world log never names the ego vehicle.",
            "Record the episode again.",
        )
    writer.write_row_sensors(rows)
    writer.merge_labels()
    writer.write_events(actors)
    writer.write_controls()
    if town is None:
        wanted = opendrive is not None and log.spec.labels.vector_map
        town = make_vector_map(raw_folder) if wanted else Town()
    writer.write_documents(actors, ego, opendrive, town)
    writer.remove_strays()
    return town


class _EpisodeWriter:
    def __init__(
        self,
        log: EpisodeLog,
        attempt_files: AttemptFiles,
        codecs: Mapping[str, str],
        agent: str | None,
    ) -> None:
        self._log = log
        self._files = attempt_files
        self._plan = plan_sensors(log.spec, codecs)
        self._parts = parts_folder(log.folder, agent)

    def write_row_sensors(self, rows: Mapping[str, Rows]) -> None:
        for sensor in self._plan.written:
            if row_kind := row_sensor(sensor.kind):
                table = pa.Table.from_pylist(list(rows[sensor.id]), schema=row_kind.schema)
                self._write_table(table, f"sensors/{sensor.id}.parquet")

    def merge_labels(self) -> None:
        spec = self._log.spec
        asked = frame_tables(lane_lines=spec.labels.lane_lines, patches=bool(spec.patches))
        for name, columns in asked.items():
            schema = label_schema(columns)
            found = [read_label_part(self._parts, name, one) for one in self._log.segments]
            parts = [part for part in found if part.num_columns] or [schema.empty_table()]
            if not all(part.schema.equals(schema) for part in parts):
                raise ConversionError(
                    f"Label parts of {name} are of another version of Car-STAGE.", "Try again."
                )
            self._write_table(pa.concat_tables(parts), name)

    def write_events(self, actors: Mapping[int, ActorInfo]) -> None:
        """Write the table of events, where any are planned."""
        log = self._log
        if log.spec.scenario.planned_events():
            from carstage.annotation.events import event_rows

            rows = event_rows(log.spec, self._ticks(), actors, int(log.header["ego_id"]))
            self._write_table(rows_to_table(rows, EVENT_COLUMNS, EVENTS), EVENTS)

    def write_controls(self) -> None:
        """Write the table of the driver's commands, where the ego has a driver of its own."""
        if self._log.spec.ego.driver is not None:
            from carstage.annotation.controls import control_rows

            rows = control_rows(self._log.spec, self._ticks(), self._log.header["episode_id"])
            self._write_table(rows_to_table(rows, CONTROL_COLUMNS, CONTROLS), CONTROLS)

    def write_documents(
        self, actors: Mapping[int, ActorInfo], ego: ActorInfo, opendrive: str | None, town: Town
    ) -> None:
        """Write what is JSON, and the ledger."""
        log, plan = self._log, self._plan
        ledger = log.ledger()
        frames = sum(entry["k"] is not None for entry in ledger)
        drawn = _vector_map_entries(town)
        documents = {
            "episode.json": episode_document(log.header, plan, frames, actors, opendrive, drawn),
            "calibration.json": calibration_document(log.spec, plan, ego),
        }
        for name, document in documents.items():
            write_document(self._files, name, to_json(document))
        self._write_table(ledger_table(log.header, log.spec, plan, ledger), "frames.parquet")

    def remove_strays(self) -> None:
        """Remove what an earlier, broken-off conversion into this folder left behind."""
        endings: dict[str, tuple[str, ...]] = {
            sensor.id: codec_for(sensor.kind, sensor.codec)[1].suffixes
            for sensor in self._plan.written
            if row_sensor(sensor.kind) is None
        }
        strays = []
        for name in self._files.names():
            folder, _, file = name.rpartition("/")
            top, _, sensor_id = folder.partition("/")
            if top != "sensors" or not sensor_id:
                continue
            suffix = file[file.index(".") :] if file[0] != "." else ""
            if suffix not in endings.get(sensor_id, ()):
                strays.append(name)
        self._files.remove(strays)

    def _write_table(self, table: pa.Table, name: str) -> None:
        with self._files.whole(name) as path:
            write_table(table, path)

    def _ticks(self) -> Iterator[WorldFrame]:
        """The world in every tick, saved or not."""
        return (world for index in self._log.segments for world in self._log.world_frames(index))


def _vector_map_entries(town: Town) -> dict[str, str | None]:
    """What ``episode.json`` says of the town's vector map."""
    entries = {"vector_map": None if town.content is None else hash_of(town.content)}
    return entries if town.problem is None else {**entries, "vector_map_problem": town.problem}
