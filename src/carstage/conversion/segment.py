"""The work on one segment, as functions that run where the pool works.

What few recordings need is imported where they need it: processes that convert pictures load it
before they are forked, see ``import_libraries``.
"""

from __future__ import annotations

import zipfile
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from carstage.annotation import CameraImages, CameraInputs, EpisodeLabeller
from carstage.annotation.decoding import decode_depth_bgra
from carstage.annotation.point_sensors import radar_detections, radar_points
from carstage.annotation.schema import LANE_LINES, PATCHES, Column, frame_tables
from carstage.codecs import codec_for
from carstage.codecs.codec import image_bgra
from carstage.conversion.encoded import EncodedSegment, parts_folder
from carstage.conversion.reprojection import Picture, record_picture
from carstage.conversion.sensors import RecordedSensor
from carstage.conversion.surroundings import Surroundings
from carstage.conversion.tag_numbers import dataset_payload
from carstage.dataset.tables import RowSensor, arrow_type, row_sensor
from carstage.errors import ConversionError
from carstage.files.whole import whole_file, write_whole
from carstage.rawlog.clock import elapsed_s
from carstage.rawlog.format import KIND_DATA, LEDGER
from carstage.rawlog.reader import ActorInfo, EpisodeLog, Record
from carstage.sensor_kinds.columns import Point
from carstage.sensor_kinds.model import DETECTIONS, POINTS
from carstage.spec import EpisodeSpec, SensorSpec
from carstage.storage.attempt_files import AttemptFiles

if TYPE_CHECKING:
    from carstage.conversion.disparity import DisparityMaker
    from carstage.conversion.lane_lines import LaneLineMaker
    from carstage.conversion.patches import PatchMaker

_NO_ROWS = b"no rows\n"
"""In place of a part of labels without any: Arrow's takes several times as long."""


def saved_ticks(log: EpisodeLog, segment: int) -> dict[int, int]:
    """Saved-frame index ``k`` by tick, for the ticks of a segment that are saved."""
    return {
        record.tick: int(record.meta["k"])
        for record in log.read_segment(LEDGER, segment)
        if record.kind == KIND_DATA and record.meta["k"] is not None
    }


def encode_segment(
    raw_folder: Path,
    attempt_files: AttemptFiles,
    sensor: RecordedSensor,
    segment: int,
    agent: str | None = None,
) -> EncodedSegment:
    """Write the files of one sensor for the saved ticks of one segment, or make its rows.

    Args:
        raw_folder: of the raw log.
        attempt_files: receives the files.
        sensor: whose.
        segment: number of the segment.
        agent: name of the agent beside the ego whose sensor it is; None: the ego's.

    Raises:
        ConversionError: a record is not what its meta says; names sensor and tick.
        RawLogError: the segment is damaged.
    """
    log = EpisodeLog(raw_folder, agent)
    ticks = saved_ticks(log, segment)
    records = [r for r in _data(log, sensor.id, segment) if r.tick in ticks]
    if row_kind := row_sensor(sensor.kind):
        return EncodedSegment(
            rows=tuple(
                _row(log, sensor, row_kind, record, ticks[record.tick]) for record in records
            )
        )
    _, codec = codec_for(sensor.kind, sensor.codec)
    below = f"sensors/{sensor.id}"
    server = str(log.header["server_version"])
    planned = next(one for one in log.spec.sensors if one.id == sensor.id)
    faces = [_by_tick(log, stream, segment) for stream in sensor.faces]
    entries = []
    with attempt_files.stream() as files:
        for record in records:
            try:
                found = [record, *(f.get(record.tick) for f in faces)]
                frame = _frame(planned, found, log.spec)
                if frame is None:
                    continue  # the ledger says why
                meta, recorded = frame
                contents = codec.encode(meta, dataset_payload(sensor.kind, server, recorded))
            except (ValueError, KeyError) as error:
                raise _bad_record(sensor, record, str(error)) from error
            for suffix, content in zip(codec.suffixes, contents, strict=True):
                name = f"{below}/{ticks[record.tick]:06d}{suffix}"
                entries.append(files.write(name, content))
    return EncodedSegment(files=tuple(entries))


def label_segment(
    raw_folder: Path, attempt_files: AttemptFiles, segment: int, agent: str | None = None
) -> EncodedSegment:
    """Label the saved ticks of one segment into part files below the raw log.

    Bird's-eye grids and disparity are files of the attempt. An agent beside the ego is taken for
    the ego.

    Raises:
        ConversionError: a label row does not fit the schema.
        AnnotationError, RawLogError: the recording cannot be labelled or read.
    """
    log = EpisodeLog(raw_folder, agent)
    ticks = saved_ticks(log, segment)
    actors = log.actors(up_to_segment=segment)
    labeller = EpisodeLabeller(
        log.header,
        actors,
        level_objects=log.level_objects(up_to_segment=segment),
    )
    around, stereo = Surroundings(log), _stereo(log.spec)
    lines = _lane_lines(log)
    patches = _patches(log, actors)
    tables = frame_tables(lane_lines=lines is not None, patches=patches is not None)
    streams = {camera: labeller.inputs(camera) for camera in labeller.labelled_cameras}
    by_id = {sensor.id: sensor for sensor in log.spec.sensors}
    image_streams = {
        stream
        for inputs in streams.values()
        for name in (inputs.depth, inputs.instance)
        if name is not None
        for stream in by_id[name].streams
    }
    counted = labeller.labels_objects or around.asked
    radars = {one.id: one.kind for one in log.spec.sensors_of(DETECTIONS) if counted}
    lidars = [one for one in log.spec.sensors_of(POINTS) if counted]
    clouds_of = [stream for lidar in lidars for stream in lidar.streams]
    by_tick = {
        stream: _by_tick(log, stream, segment)
        for stream in dict.fromkeys([*sorted(image_streams), *clouds_of, *radars, *around.swept])
    }
    files: list[tuple[str, bytes]] = []
    rows: dict[str, list[dict[str, Any]]] = {name: [] for name in tables}
    for world in log.world_frames(segment):
        if world.tick not in ticks:
            continue
        images = _camera_images(streams, by_id, by_tick, world.tick)
        clouds = _clouds(log.spec, lidars, by_tick, world.tick)
        detections = {
            radar: radar_points(radar_detections(kind, record.payload))
            for radar, kind in radars.items()
            if (record := by_tick[radar].get(world.tick)) is not None
        }
        labels = labeller.label_frame(world, ticks[world.tick], images, clouds, detections)
        rows["objects.parquet"] += labels.objects
        rows["camera_objects.parquet"] += labels.camera_objects
        rows["ego.parquet"] += [labels.ego] if labels.ego else []
        rows["sensor_poses.parquet"] += labels.sensor_poses
        if lines is not None:
            rows[LANE_LINES] += lines.rows(ticks[world.tick], labels, images)
        if patches is not None:
            rows[PATCHES] += patches.rows(ticks[world.tick], world, labels, images)
        sweeps = {name: by_tick[name].get(world.tick) for name in around.swept}
        files += around.files(world, ticks[world.tick], labels, images, clouds, sweeps)
        if stereo is not None:
            files += stereo.files(ticks[world.tick], images)
    folder = parts_folder(raw_folder, agent)
    folder.mkdir(exist_ok=True)
    around.end(folder, segment)
    for name, columns in tables.items():
        path = _part(folder, name, segment)
        if rows[name]:
            _write_part(rows_to_table(rows[name], columns, name), path)
        else:
            write_whole(path, _NO_ROWS)
    with attempt_files.stream() as written:
        entries = tuple(written.write(name, content) for name, content in files)
    return EncodedSegment(files=entries)


def _stereo(spec: EpisodeSpec) -> DisparityMaker | None:
    """What makes the disparity of stereo pairs, where that is asked for."""
    if not spec.labels.disparity:
        return None
    from carstage.conversion.disparity import DisparityMaker

    return DisparityMaker(spec)


def _lane_lines(log: EpisodeLog) -> LaneLineMaker | None:
    """What makes the rows of lane lines, where those are asked for."""
    if not log.spec.labels.lane_lines:
        return None
    from carstage.conversion.lane_lines import LaneLineMaker

    return LaneLineMaker(log)


def _patches(log: EpisodeLog, actors: Mapping[int, ActorInfo]) -> PatchMaker | None:
    """What makes the rows of patches, where there are any."""
    if not log.spec.patches:
        return None
    from carstage.conversion.patches import PatchMaker

    return PatchMaker(log, actors)


def place_voxels(
    raw_folder: Path,
    attempt_files: AttemptFiles,
    segment: int,
    segments: int,
    agent: str | None = None,
) -> EncodedSegment:
    """Write the voxels of one segment's frames, once all segments are labelled.

    Raises:
        ConversionError: what a segment left is gone or damaged.
    """
    from carstage.conversion.occupancy import occupancy_files

    asked = EpisodeLog(raw_folder, agent).spec.labels.occupancy
    folder = parts_folder(raw_folder, agent)
    assert asked is not None
    objects: dict[int, list[dict[str, Any]]] = defaultdict(list)
    for row in read_label_part(folder, "objects.parquet", segment).to_pylist():
        objects[row["k"]].append(row)
    try:
        files = occupancy_files(asked, folder, segment, segments, objects)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConversionError(f"A label part is gone or damaged: {error}", "Try again.") from error
    with attempt_files.stream() as written:
        return EncodedSegment(files=tuple(written.write(*file) for file in files))


def read_label_part(folder: Path, table: str, segment: int) -> pa.Table:
    """What ``label_segment`` has made of one segment for a table; ``folder`` has the parts.

    Returns:
        Its rows; a table without columns where there are none.

    Raises:
        ConversionError: it is gone or damaged.
    """
    path = _part(folder, table, segment)
    try:
        if path.stat().st_size == len(_NO_ROWS) and path.read_bytes() == _NO_ROWS:
            return pa.table({})
        with pa.OSFile(str(path), "rb") as file:
            return pa.ipc.open_file(file).read_all()
    except (OSError, pa.ArrowException) as error:
        raise ConversionError(f"A label part is gone or damaged: {error}", "Try again.") from error


def _write_part(table: pa.Table, path: Path) -> None:
    """Keep a part as Arrow has it in memory: to compress what is read once takes far longer."""
    with (
        whole_file(path) as temporary,
        pa.OSFile(str(temporary), "wb") as file,
        pa.ipc.new_file(file, table.schema) as writer,
    ):
        writer.write_table(table)


def _part(folder: Path, table: str, segment: int) -> Path:
    return folder / f"{segment:06d}.{Path(table).stem}.arrow"


def rows_to_table(rows: Sequence[dict[str, Any]], columns: Sequence[Column], name: str) -> pa.Table:
    """An Arrow table of label rows, exactly with the schema's columns.

    Raises:
        ConversionError: a row has other keys, or a value of another type, than the schema says.
    """
    expected = {column.name for column in columns}
    for row in rows:
        if row.keys() != expected:
            odd = sorted(row.keys() ^ expected)
            raise ConversionError(f"{name}: a row and the schema differ in {', '.join(odd)}.")
    schema = label_schema(columns)
    try:
        table = pa.Table.from_pylist(list(rows), schema=schema)
        table.validate(full=True)
    except (pa.ArrowException, TypeError) as error:
        raise ConversionError(f"{name}: a value does not fit its column: {error}") from error
    for field, column in zip(schema, table.columns, strict=True):
        if not field.nullable and column.null_count:
            raise ConversionError(f"{name}: column {field.name} has a row without a value.")
    return table


def label_schema(columns: Sequence[Column]) -> pa.Schema:
    """The Arrow schema of a label table."""
    return pa.schema(
        [
            pa.field(c.name, arrow_type(c.type, nullable=c.nullable), nullable=c.nullable)
            for c in columns
        ]
    )


def _camera_images(
    streams: Mapping[str, CameraInputs],
    by_id: Mapping[str, SensorSpec],
    by_tick: Mapping[str, Mapping[int, Record]],
    tick: int,
) -> dict[str, CameraImages]:
    """What labelled cameras see in a tick; one without depth is left out, the ledger says why."""
    images = {}
    for camera, inputs in streams.items():
        depth = _picture(by_id[inputs.depth], by_tick, tick)
        if depth is None:
            continue
        instance = _picture(by_id[inputs.instance], by_tick, tick) if inputs.instance else None
        images[camera] = CameraImages(
            decode_depth_bgra(image_bgra(*depth)),
            None if instance is None else image_bgra(*instance),
        )
    return images


def _picture(
    sensor: SensorSpec, by_tick: Mapping[str, Mapping[int, Record]], tick: int
) -> Picture | None:
    return record_picture(sensor, _records(sensor, by_tick, tick))


def _records(
    sensor: SensorSpec, by_tick: Mapping[str, Mapping[int, Record]], tick: int
) -> list[Record | None]:
    """Of the streams that a sensor's frame of that tick is made from."""
    return [by_tick[stream].get(tick) for stream in sensor.streams]


def _clouds(
    spec: EpisodeSpec,
    lidars: Sequence[SensorSpec],
    by_tick: Mapping[str, Mapping[int, Record]],
    tick: int,
) -> dict[str, NDArray[np.float32]]:
    """``(N, 4)`` points of that tick by LiDAR; one that the tick lacks has none."""
    found = {lidar.id: _frame(lidar, _records(lidar, by_tick, tick), spec) for lidar in lidars}
    kinds = {lidar.id: lidar.kind for lidar in lidars}
    clouds: dict[str, NDArray[np.float32]] = {}
    for name, frame in found.items():
        if frame is not None:
            try:
                points = codec_for(kinds[name])[1].raw_array(frame[0], frame[1])
            except ValueError as error:
                raise ConversionError(
                    f"Sensor {name}, tick {tick}: the recorded data is not usable: {error}.",
                    "Record the episode again.",
                ) from error
            clouds[name] = points[:, : Point.INTENSITY + 1]
    return clouds


def _frame(
    sensor: SensorSpec, records: Sequence[Record | None], spec: EpisodeSpec
) -> Picture | None:
    """Meta and payload of a sensor's frame, whatever it is made from; None: the tick lacks it."""
    if sensor.flash is not None:
        from carstage.conversion.flash_lidar import flash_payload

        return flash_payload(sensor, records, spec.seeds.sensor_noise)
    return record_picture(sensor, records)


def _by_tick(log: EpisodeLog, stream: str, segment: int) -> dict[int, Record]:
    return {record.tick: record for record in _data(log, stream, segment)}


def _data(log: EpisodeLog, stream: str, segment: int) -> list[Record]:
    return [r for r in log.read_segment(stream, segment) if r.kind == KIND_DATA]


def _row(
    log: EpisodeLog, sensor: RecordedSensor, row_kind: RowSensor, record: Record, k: int
) -> dict[str, Any]:
    time_s = elapsed_s(log.spec, log.first_timestamp_s, record.tick, record.timestamp_s)
    try:
        return row_kind.row(k, time_s, record.payload)
    except ValueError as error:
        raise _bad_record(sensor, record, str(error)) from error


def _bad_record(sensor: RecordedSensor, record: Record, why: str) -> ConversionError:
    return ConversionError(
        f"Sensor {sensor.id}, tick {record.tick}: the recorded data is not usable: {why}.",
        "Record the episode again.",
    )
