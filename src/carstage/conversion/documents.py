"""The small files of an episode: ``episode.json``, ``calibration.json``, ``frames.parquet``."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import pyarrow as pa

from carstage.annotation.rig import Mount, camera_geometry, planned_lens
from carstage.conversion.sensors import SensorPlan
from carstage.errors import ConversionError
from carstage.geometry import Lens, horizontal_fov_deg, intrinsics
from carstage.rawlog.clock import elapsed_s
from carstage.rawlog.reader import ActorInfo
from carstage.spec import EpisodeSpec, SensorSpec
from carstage.spec.plain import plain

FORMAT_VERSION = 1
_EPISODE_KEYS = (
    "episode_id",
    "spec",
    "client_version",
    "server_version",
    "map",
    "geo_reference",
    "ego_id",
    "first_frame",
    "requested",
    "spawned",
)
_ROAD_USERS = ("vehicle.", "walker.")
_GOOD: Final[Mapping[str, Any]] = {"state": "ok", "reason": None}
# A server's clock is a sum of steps that it keeps in float32: allow it a hundredth of a step, and
# what rounding each step can add up to.
_CLOCK_TOLERANCE_STEPS = 0.01
_CLOCK_DRIFT = 1e-6


def episode_document(
    header: Mapping[str, Any],
    plan: SensorPlan,
    frames: int,
    actors: Mapping[int, ActorInfo],
    opendrive: str | None,
    vector_map: Mapping[str, str | None],
) -> dict[str, Any]:
    """``episode.json`` of the dataset: the raw log's header without facts of a try or machine.

    Args:
        header: the raw log's ``episode.json``, as ``EpisodeLog`` has it.
        plan: which sensors the dataset has.
        frames: number of saved frames.
        actors: everybody that the world log names.
        opendrive: named hash of the town's OpenDRIVE text; None where it was not recorded.
        vector_map: what it says of the town's vector map.
    """
    document = {key: header[key] for key in _EPISODE_KEYS}
    if "agent" in header:
        document["agent"] = header["agent"]
    ids = header["sensor_actor_ids"]
    return {
        "format_version": FORMAT_VERSION,
        **document,
        "opendrive": opendrive,
        **vector_map,
        "sensor_actor_ids": {s.id: ids[s.id] for s in plan.written if s.id in ids},
        "frames": frames,
        "actors": {
            str(actor.id): {"type_id": actor.type_id, "attributes": dict(actor.attributes)}
            for actor in sorted(actors.values(), key=lambda actor: actor.id)
            if actor.type_id.startswith(_ROAD_USERS)
        },
    }


def calibration_document(spec: EpisodeSpec, plan: SensorPlan, ego: ActorInfo) -> dict[str, Any]:
    """``calibration.json``: every requested sensor's pose, attributes and intrinsics."""
    by_id = {sensor.id: sensor for sensor in spec.sensors}
    shown = {sensor.id for sensor in plan.written}
    sensors = {}
    for written in plan.written:
        sensor = by_id[written.id]
        attributes = sensor.attributes
        mount = Mount.from_spec(sensor, {})
        entry: dict[str, Any] = {
            "kind": sensor.kind,
            "blueprint": sensor.blueprint,
            "attributes": dict(attributes),
            "attach_to": mount.attach_to,
            **({"attach_index": sensor.attach_index} if sensor.attach_index else {}),
            "attachment": sensor.attachment,
            "carrier_from_sensor": mount.carrier_from_sensor.tolist(),
            "ego_from_sensor": mount.carrier_from_sensor.tolist() if mount.on_ego else None,
        }
        if sensor.blueprint.startswith("sensor.camera.") and sensor.flash is None:
            width, height, fov_deg = camera_geometry(attributes)
            entry |= {
                "width": width,
                "height": height,
                "fov_deg": fov_deg,
                "K": intrinsics(width, height, fov_deg).tolist(),
            }
        if sensor.lens is not None:
            entry |= lens_entries(planned_lens(sensor.lens), sensor)
        if sensor.flash is not None:
            entry["flash"] = {**plain(sensor.flash), "recorded_from": list(sensor.streams)}
        twins = {"depth": sensor.depth, "instance": sensor.instance}
        sensors[written.id] = {
            **entry,
            "files": written.codec,
            "labelled": sensor.labelled,
            **{key: twin if twin in shown else None for key, twin in twins.items()},
        }
    box = {
        "location": ego.box_location.tolist(),
        "extent": ego.box_extent.tolist(),
        "rotation_deg": ego.box_rotation_deg.tolist(),
    }
    return {"format_version": FORMAT_VERSION, "ego_box": box, "sensors": sensors}


def lens_entries(lens: Lens, sensor: SensorSpec) -> dict[str, Any]:
    """What the calibration says of a camera whose pictures are re-projected."""
    assert sensor.lens is not None
    return {
        "width": lens.width,
        "height": lens.height,
        "fov_deg": horizontal_fov_deg(lens),
        "K": lens.k.tolist(),
        "lens": {
            "model": sensor.lens.model,
            "distortion": list(lens.distortion),
            "max_angle_deg": sensor.lens.max_angle_deg,
            "depth": "range" if lens.depth_is_range else "z",
            "recorded_from": list(sensor.streams),
        },
    }


def ledger_table(
    header: Mapping[str, Any],
    spec: EpisodeSpec,
    plan: SensorPlan,
    ledger: Sequence[Mapping[str, Any]],
) -> pa.Table:
    """``frames.parquet``: one row per tick.

    Raises:
        ConversionError: ticks are missing, or in synchronous mode the server's clock does not
            advance by ``1 / fps`` per tick.
    """
    fps, synchronous = spec.fps, spec.timing.synchronous
    start_s = float(header["first_timestamp_s"])
    by_id = {sensor.id: sensor for sensor in spec.sensors}
    rows = []
    for index, entry in enumerate(ledger):
        tick, since_start_s = entry["tick"], entry["timestamp_s"] - start_s
        if tick != index:
            raise ConversionError(
                f"Episode {header['episode_id']}: the ledger has no entry for tick {index}.",
                "Record the episode again.",
            )
        tolerance = _CLOCK_TOLERANCE_STEPS + _CLOCK_DRIFT * tick
        if synchronous and abs(since_start_s * fps - tick) > tolerance:
            raise ConversionError(
                f"Episode {header['episode_id']}, tick {tick}: the server's clock shows "
                f"{since_start_s:.6f} s since the first tick, not {tick / fps:.6f} s.",
                "Another client may have ticked or reconfigured the server: give it to one run.",
            )
        row = {
            "tick": tick,
            "k": entry["k"],
            "server_frame": entry["frame"],
            "timestamp_s": elapsed_s(spec, start_s, tick, entry["timestamp_s"]),
        }
        # Some servers let cameras rest in steps that are not saved: nothing is missing.
        may_rest = entry["k"] is None and spec.timing.demands_all
        for sensor in plan.written:
            state = _state(entry["sensors"], sensor.streams, may_rest=may_rest)
            row[f"{sensor.id}.state"] = state["state"]
            row[f"{sensor.id}.reason"] = state["reason"]
            if depth := _labelled_by(by_id[sensor.id]):
                state = _state(entry["sensors"], by_id[depth].streams, may_rest=may_rest)
                row[f"{sensor.id}.labels"] = None if entry["k"] is None else state["state"]
        rows.append(row)
    return pa.Table.from_pylist(rows, schema=_ledger_schema(spec, plan))


def _state(
    found: Mapping[str, Mapping[str, Any]], streams: Iterable[str], *, may_rest: bool
) -> Mapping[str, Any]:
    """Of a sensor in one tick: a picture that lacks a face of its cube is missing as that is."""
    states = [found.get(stream, {"state": "off", "reason": None}) for stream in streams]
    if may_rest:
        states = [_GOOD if one["state"] == "off" else one for one in states]
    return next((one for one in states if one["state"] != "ok"), states[0])


def _labelled_by(sensor: SensorSpec) -> str | None:
    """The depth camera without which a camera's pictures get no labels; None: it has none."""
    return sensor.depth if sensor.labelled else None


def _ledger_schema(spec: EpisodeSpec, plan: SensorPlan) -> pa.Schema:
    by_id = {sensor.id: sensor for sensor in spec.sensors}
    fields: list[pa.Field[Any]] = [
        pa.field("tick", pa.int32(), nullable=False),
        pa.field("k", pa.int32()),
        pa.field("server_frame", pa.uint64(), nullable=False),
        pa.field("timestamp_s", pa.float64(), nullable=False),
    ]
    for sensor in plan.written:
        fields.append(pa.field(f"{sensor.id}.state", pa.string(), nullable=False))
        fields.append(pa.field(f"{sensor.id}.reason", pa.string()))
        if _labelled_by(by_id[sensor.id]):
            fields.append(pa.field(f"{sensor.id}.labels", pa.string()))
    return pa.schema(fields)


def to_json(document: Mapping[str, Any]) -> bytes:
    """A document as the bytes of its file; floats as Python's ``repr``, NaN refused."""
    return (json.dumps(document, indent=1, allow_nan=False) + "\n").encode()
