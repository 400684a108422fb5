"""Reads raw logs: sealed segments mapped into memory, world snapshots as arrays."""

from __future__ import annotations

import json
import mmap
import os
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.errors import RawLogError
from carstage.rawlog import format as raw
from carstage.spec import EpisodeSpec, SpecError, agent_of, stream_of

ACTOR_DTYPE = np.dtype(
    [
        ("id", "<u4"),
        ("reserved", "<u4"),
        ("location", "<f4", 3),
        ("rotation_deg", "<f4", 3),
        ("velocity", "<f4", 3),
        ("angular_velocity_deg", "<f4", 3),
        ("acceleration", "<f4", 3),
    ]
)
"""One actor of a world snapshot, 68 bytes: ``carstage.rawlog.format.ACTOR_RECORD``."""
_TABLES_KEPT = 4096
"""Segments whose tables stay in memory; few but an episode's first have any."""


@dataclass(frozen=True, slots=True)
class Record:
    """One record of a segment.

    Attributes:
        kind: ``KIND_DATA``, ``KIND_TABLE`` or ``KIND_SEAL`` of ``carstage.rawlog.format``.
        tick: index from the first tick after warm-up.
        frame: the server's frame number.
        timestamp_s: the server's simulated time, s.
        sequence: number of the record in its segment.
        meta: the record's JSON object.
        payload: read-only bytes, mapped from the file; they stay valid as long as they are held.
    """

    kind: int
    tick: int
    frame: int
    timestamp_s: float
    sequence: int
    meta: dict[str, Any]
    payload: memoryview


@dataclass(frozen=True, slots=True)
class ActorInfo:
    """What is static about an actor; the box is in the actor's frame, with half sizes.

    Attributes:
        id: actor id.
        type_id: blueprint id, ``vehicle.tesla.model3``.
        parent: id of the actor that it is attached to, 0 for none.
        attributes: blueprint attributes as the server reports them.
        semantic_tags: CARLA's tags, in the server's numbering.
        box_location: ``(3,)`` float64 centre, m.
        box_extent: ``(3,)`` float64 half sizes, m.
        box_rotation_deg: ``(3,)`` float64 pitch, yaw, roll.
    """

    id: int
    type_id: str
    parent: int
    attributes: Mapping[str, str]
    semantic_tags: tuple[int, ...]
    box_location: NDArray[np.float64]
    box_extent: NDArray[np.float64]
    box_rotation_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class LevelObject:
    """Something that stands in the level without being an actor; its box is in the world.

    Attributes:
        id: the server's, up to 64 bits; no actor's id and no pixel's.
        name: the server's.
        label: semantic label, in the server's numbering.
        light: id of the traffic light actor whose head it is, 0 for none.
        box_location: ``(3,)`` float64 centre, m.
        box_extent: ``(3,)`` float64 half sizes, m.
        box_rotation_deg: ``(3,)`` float64 pitch, yaw, roll.
    """

    id: int
    name: str
    label: int
    light: int
    box_location: NDArray[np.float64]
    box_extent: NDArray[np.float64]
    box_rotation_deg: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class WorldFrame:
    """All live actors of one tick, ascending id; everything in the left-handed world frame.

    Attributes:
        tick: index from the first tick after warm-up.
        frame: the server's frame number.
        timestamp_s: the server's simulated time, s.
        actor_id: ``(N,)`` uint32.
        location: ``(N, 3)`` float64 m.
        rotation_deg: ``(N, 3)`` float64 pitch, yaw, roll.
        velocity: ``(N, 3)`` float64 m/s.
        angular_velocity_deg: ``(N, 3)`` float64 deg/s.
        acceleration: ``(N, 3)`` float64 m/s^2.
        meta: weather, ego control, light states; see docs/formats/raw-log.md.
    """

    tick: int
    frame: int
    timestamp_s: float
    actor_id: NDArray[np.uint32]
    location: NDArray[np.float64]
    rotation_deg: NDArray[np.float64]
    velocity: NDArray[np.float64]
    angular_velocity_deg: NDArray[np.float64]
    acceleration: NDArray[np.float64]
    meta: Mapping[str, Any]

    def row(self, actor_id: int) -> int:
        """Row of an actor.

        Raises:
            KeyError: when it is not alive in this frame.
        """
        index = int(np.searchsorted(self.actor_id, actor_id))
        if index == len(self.actor_id) or int(self.actor_id[index]) != actor_id:
            raise KeyError(actor_id)
        return index


class EpisodeLog:
    """The raw log of one attempt; safe to read while it is being written.

    Args:
        folder: the attempt's folder, with ``episode.json``.
        agent: name of an agent beside the ego, who is then taken for the ego: the header, the
            sensors and the world's records are as that agent would have recorded them alone.

    Raises:
        RawLogError: when ``episode.json`` is missing, damaged or of another format version, or
            there is no such agent.
    """

    def __init__(self, folder: Path, agent: str | None = None) -> None:
        self.folder = Path(folder)
        self._agent = agent
        self._number = 0
        path = self.folder / raw.EPISODE_FILE
        try:
            header = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise RawLogError(
                f"{path} is missing: recording never came to its first tick.",
                "Run the episode again.",
            ) from None
        except (OSError, ValueError) as error:
            raise RawLogError(f"{path} cannot be read: {error}") from error
        if not isinstance(header, dict) or header.get("format_version") != raw.FORMAT_VERSION:
            raise RawLogError(
                f"{path} is not a raw log of format version {raw.FORMAT_VERSION}.",
                "Read it with the Car-STAGE version that wrote it.",
            )
        self.header: Mapping[str, Any] = header
        self._path = path
        if agent is not None:
            self._see_as(agent)

    def _see_as(self, agent: str) -> None:
        """Take an agent for the ego.

        Raises:
            RawLogError: the log has none of that name.
        """
        whole = self.spec
        try:
            self._number = whole.agent_number(agent)
            own = self.header["agents"][agent]
        except KeyError as error:
            raise RawLogError(f"{self._path} names no agent {agent}.") from error
        common = {key: value for key, value in self.header.items() if key != "agents"}
        seen = whole.seen_by(agent).to_json()
        self.header = {**common, **own, "agent": agent, "spec": seen}
        del self.spec  # read anew from what the header says now

    def stream(self, name: str) -> str:
        """The stream that a sensor's data is in, by its id; ``world`` and ``ledger`` as they are.

        Streams' names differ from ids for the sensors of agents beside the ego.
        """
        if not self._number or name in (raw.WORLD, raw.LEDGER):
            return name
        return stream_of(name, self._number)

    @cached_property
    def spec(self) -> EpisodeSpec:
        """What the episode is.

        Raises:
            RawLogError: the specification is damaged.
        """
        try:
            return EpisodeSpec.from_json(self.header["spec"])
        except (KeyError, SpecError) as error:
            raise RawLogError(f"{self._path} holds no usable specification: {error}.") from error

    def opendrive(self) -> bytes | None:
        """The town's OpenDRIVE text; ``None``: the collector of this log did not write it.

        Raises:
            RawLogError: it cannot be read, or is not what was written.
        """
        path = self.folder / raw.MAP_FILE
        written = self.header.get("map_crc32")
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            if written is not None:
                raise RawLogError(f"{path} is missing.") from None
            return None
        except OSError as error:
            raise RawLogError(f"{path} cannot be read: {error}") from error
        if written is not None and zlib.crc32(content) != written:
            raise RawLogError(f"{path} is not what was written: its checksum differs.")
        return content

    @property
    def first_timestamp_s(self) -> float:
        """Server time of the first tick (s)."""
        return float(self.header["first_timestamp_s"])

    @property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams that have a folder, sorted; no stream's name begins with a dot."""
        return tuple(
            sorted(
                entry.name
                for entry in self.folder.iterdir()
                if entry.is_dir() and not entry.name.startswith(".")
            )
        )

    @property
    def segments(self) -> range:
        """Numbers of the segments that a whole recording has."""
        return range(-(-int(self.header["ticks"]) // int(self.header["ticks_per_segment"])))

    def sealed_segments(self, stream: str) -> tuple[int, ...]:
        """Numbers of the sealed segments of a sensor, or of ``world`` or ``ledger``, ascending."""
        folder = self.folder / self.stream(stream)
        if not folder.is_dir():
            return ()
        numbers = (raw.segment_index(entry.name) for entry in folder.iterdir())
        return tuple(sorted(number for number in numbers if number is not None))

    def read_segment(self, stream: str, index: int) -> list[Record]:
        """Read the data and table records of a sealed segment; payloads are mapped, not copied.

        Args:
            stream: id of a sensor, ``world`` or ``ledger``.
            index: number of the segment.

        Raises:
            RawLogError: the segment is missing, damaged, of another stream or number, or its seal
                does not fit; names the file and the offset.
        """
        path = self._segment_path(stream, index)
        data = _mapped(path)
        found = _segment_header(path, data)
        if found != (self.stream(stream), index):
            raise RawLogError(f"{path} holds segment {found.segment} of stream {found.stream!r}.")
        return _sealed_records(path, data)

    def remove_segment(self, stream: str, index: int) -> None:
        """Remove a sealed segment that nobody reads any more.

        The files of one with blocks are left to the writer, which uses them again: neither memory
        nor names have to be found for the next one.
        """
        path = self._segment_path(stream, index)
        blocks = path.with_suffix(raw.BLOCKS_SUFFIX)
        # The payloads last: a sealed segment has them.
        if blocks.exists():
            for part in (path, blocks):
                part.rename(f"{part}{raw.FREE}")
        else:
            for part in (path, path.with_suffix(raw.PAYLOAD_SUFFIX)):
                part.unlink(missing_ok=True)

    def _segment_path(self, stream: str, index: int) -> Path:
        return self.folder / self.stream(stream) / f"{index:06d}{raw.SEALED_SUFFIX}"

    def world_frames(self, index: int) -> list[WorldFrame]:
        """World snapshots of segment ``index``, one per tick, in order."""
        frames = [
            _world_frame(record, self._own_meta(record.meta))
            for record in self.read_segment(raw.WORLD, index)
            if record.kind == raw.KIND_DATA
        ]
        for frame in frames:
            self._note_motion(frame)
        return frames

    def _note_motion(self, frame: WorldFrame) -> None:
        """Give a drone taken for the ego the motion that was noted: servers say that it stands."""
        motion = frame.meta.get("motion")
        if motion is None:
            return
        row = frame.actor_id == self.header["ego_id"]
        frame.velocity[row] = motion["velocity"]
        frame.acceleration[row] = motion["acceleration"]
        frame.angular_velocity_deg[row] = motion["angular_velocity_deg"]

    def _own_meta(self, meta: Mapping[str, Any]) -> Mapping[str, Any]:
        """A world record's meta with what is noted of the ego; of the agent taken for it."""
        if self._agent is None:
            return meta
        others = ("ego", "driver", "events", "agents")
        common = {key: value for key, value in meta.items() if key not in others}
        return {**common, **meta.get("agents", {}).get(self._agent, {})}

    def actors(self, up_to_segment: int | None = None) -> dict[int, ActorInfo]:
        """Everything known about actors, by id; ids of actors that have gone are kept.

        Args:
            up_to_segment: last segment to look into; all sealed ones when ``None``.
        """
        found: dict[int, ActorInfo] = {}
        for table in self._tables(up_to_segment):
            found.update((row["id"], _actor_info(row)) for row in table.get("actors", ()))
        return found

    def level_objects(self, up_to_segment: int | None = None) -> list[LevelObject]:
        """What the level holds of the kinds that were asked for; logs of old have none.

        Args:
            up_to_segment: last segment to look into; all sealed ones when ``None``.
        """
        tables = self._tables(up_to_segment)
        return [_level_object(row) for table in tables for row in table.get("level_objects", ())]

    def _tables(self, up_to_segment: int | None) -> Iterator[Mapping[str, Any]]:
        for index in self.sealed_segments(raw.WORLD):
            if up_to_segment is not None and index > up_to_segment:
                break
            path = self._segment_path(raw.WORLD, index)
            try:
                found = path.stat()
            except FileNotFoundError:
                raise RawLogError(f"{path} is missing.") from None
            yield from _tables_of(path, (found.st_ino, found.st_mtime_ns, found.st_size))

    def ledger(self) -> list[dict[str, Any]]:
        """Ledger rows of all sealed segments, in order.

        Each row holds ``tick``, ``frame``, ``timestamp_s`` and what the record's meta holds: ``k``,
        ``sensors`` by their ids, ``tick_s``.
        """
        return [
            {
                "tick": record.tick,
                "frame": record.frame,
                "timestamp_s": record.timestamp_s,
                **record.meta,
                "sensors": self._own_states(record.meta.get("sensors", {})),
            }
            for index in self.sealed_segments(raw.LEDGER)
            for record in self.read_segment(raw.LEDGER, index)
            if record.kind == raw.KIND_DATA
        ]

    def _own_states(self, states: Mapping[str, Any]) -> dict[str, Any]:
        """The states of the ego's sensors by their ids; of those of the agent taken for it."""
        named = ((agent_of(stream), state) for stream, state in states.items())
        return {sensor: state for (sensor, number), state in named if number == self._number}

    def is_complete(self) -> bool:
        """Whether every tick that ``episode.json`` promises is in sealed ledger segments."""
        return len(self.ledger()) == int(self.header["ticks"])


@lru_cache(maxsize=_TABLES_KEPT)
def _tables_of(path: Path, state: tuple[int, ...]) -> tuple[Mapping[str, Any], ...]:
    """What the tables of a sealed segment hold; each segment's labels need all the earlier ones.

    Args:
        path: the segment.
        state: inode, time and size; where they differ, it is another segment of the same name.
    """
    data = _mapped(path)
    # Tables only: the JSON of the snapshots between them is most of the stream.
    return tuple(
        _record(path, data, offset, header).meta
        for offset, header in raw.iter_whole_records(data)[0]
        if header.kind == raw.KIND_TABLE
    )


def _mapped(path: Path, begin: int = 0, most: int | None = None) -> memoryview:
    """A file from one of the pages on, to its end or as much as is wanted of it."""
    try:
        with path.open("rb", buffering=0) as file:
            there = max(0, os.fstat(file.fileno()).st_size - begin)
            length = there if most is None else min(there, most)
            if not length:
                return memoryview(b"")
            found = mmap.mmap(file.fileno(), length, access=mmap.ACCESS_READ, offset=begin)
            return memoryview(found)
    except FileNotFoundError:
        raise RawLogError(f"{path} is missing.") from None
    except OSError as error:
        raise RawLogError(f"{path} cannot be read: {error}") from error


def _segment_header(path: Path, data: memoryview) -> raw.SegmentHeader:
    try:
        return raw.unpack_segment_header(data)
    except (raw.FormatError, UnicodeDecodeError) as error:
        raise RawLogError(f"{path}, offset 0: {error}.") from error


def _sealed_records(path: Path, data: memoryview) -> list[Record]:
    whole, end = raw.iter_whole_records(data)
    if end != len(data):
        raise RawLogError(f"{path}, offset {end}: a sealed segment is damaged or cut here.")
    records = [_record(path, data, offset, header) for offset, header in whole]
    for number, (record, (offset, _)) in enumerate(zip(records, whole, strict=True)):
        if record.sequence != number:
            raise RawLogError(f"{path}, offset {offset}: record {number} is missing.")
    if not records or records[-1].kind != raw.KIND_SEAL:
        raise RawLogError(f"{path}, offset {end}: the seal is missing.")
    seal = records.pop()
    if seal.meta.get("records") != len(records) or seal.meta.get("bytes") != whole[-1][0]:
        raise RawLogError(f"{path}, offset {whole[-1][0]}: the seal does not fit the records.")
    if any(record.kind == raw.KIND_SEAL for record in records):
        raise RawLogError(f"{path}: a seal stands before the end.")
    return records


def _record(path: Path, data: memoryview, offset: int, header: raw.RecordHeader) -> Record:
    meta_at = offset + raw.HEADER_BYTES
    payload_at = meta_at + header.meta_bytes
    place = header.payload_place
    if place is None:
        payload = data[payload_at : payload_at + header.payload_bytes]
    else:
        payload = _payload_elsewhere(path, *place, header.payload_bytes)
    try:
        meta = json.loads(bytes(data[meta_at:payload_at])) if header.meta_bytes else {}
    except ValueError as error:
        raise RawLogError(f"{path}, offset {meta_at}: the meta is not JSON: {error}.") from error
    if not isinstance(meta, dict):
        raise RawLogError(f"{path}, offset {meta_at}: the meta is not a JSON object.")
    return Record(
        kind=header.kind,
        tick=header.tick,
        frame=header.frame,
        timestamp_s=header.timestamp_s,
        sequence=header.sequence,
        meta=meta,
        payload=payload,
    )


def _payload_elsewhere(path: Path, suffix: str, begin: int, size: int) -> memoryview:
    """A payload in the file beside its segment's; no more of that is mapped than needed."""
    payloads = path.with_name(path.name.replace(raw.SEALED_SUFFIX, suffix))
    skipped = begin % mmap.ALLOCATIONGRANULARITY
    payload = _mapped(payloads, begin - skipped, skipped + size)[skipped:]
    if payload.nbytes != size:
        raise RawLogError(f"{payloads}, offset {begin}: the payload file is cut short.")
    return payload


def _world_frame(record: Record, meta: Mapping[str, Any]) -> WorldFrame:
    rows = np.frombuffer(record.payload, dtype=ACTOR_DTYPE)

    def vectors(name: str) -> NDArray[np.float64]:
        return rows[name].astype(np.float64)

    return WorldFrame(
        tick=record.tick,
        frame=record.frame,
        timestamp_s=record.timestamp_s,
        actor_id=rows["id"].copy(),
        location=vectors("location"),
        rotation_deg=vectors("rotation_deg"),
        velocity=vectors("velocity"),
        angular_velocity_deg=vectors("angular_velocity_deg"),
        acceleration=vectors("acceleration"),
        meta=meta,
    )


def _actor_info(row: Mapping[str, Any]) -> ActorInfo:
    return ActorInfo(
        id=row["id"],
        type_id=row["type_id"],
        parent=row["parent"],
        attributes=row["attributes"],
        semantic_tags=tuple(row["semantic_tags"]),
        **_box(row["box"]),
    )


def _level_object(row: Mapping[str, Any]) -> LevelObject:
    return LevelObject(
        id=row["id"],
        name=row["name"],
        label=row["label"],
        light=row["light"],
        **_box(row["box"]),
    )


def _box(record: Mapping[str, Any]) -> dict[str, Any]:
    """The fields of a box, each ``(3,)`` float64."""
    return {
        f"box_{name}": np.asarray(record[name], np.float64)
        for name in ("location", "extent", "rotation_deg")
    }
