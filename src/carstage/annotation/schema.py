"""The columns of the label tables: name, type, unit and meaning, in file order.

``python -m carstage.annotation.schema`` prints them as Markdown; the page
``docs/formats/dataset.md`` holds that output.

Types: ``bool str i32 i64 u8 u32 u64 f64`` scalars; ``f64[n]`` a list of n, of fixed size where
the column is never null; ``f64[8][2]`` a list of eight such lists, where an inner one may be null;
``u8[]``, ``i64[]``, ``f64[]`` a list of any length; ``map[str,u32]`` a list of
``(key, value)`` pairs; ``json`` a string that holds a JSON object with sorted keys.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a label table.

    Attributes:
        name: the key in a row.
        type: one of the type names of this module's docstring.
        unit: unit of the value, or the set of allowed values; empty where neither applies.
        description: what it means, with its frame of reference.
        nullable: whether a row may hold ``None`` here.
    """

    name: str
    type: str
    unit: str
    description: str
    nullable: bool = False


# fmt: off
_K = Column("k", "i32", "", "index of the saved frame, from 0")
_TIMESTAMP = Column("timestamp_s", "f64", "s",
    "simulated time since the first frame; tick / fps in synchronous mode")
_TRACK_ID = Column("track_id", "i64", "",
    "actor id, unique within an episode; a rider's: 2³² + the two-wheeler's; level objects': from "
    "2⁵² on")
_EGO_TRACK_ID = Column("track_id", "i64", "", "actor id; unique within an episode")

_NO_3D = "null: no valid box, or no `3d` in `labels.boxes`"
_NO_2D = "null: no `2d` in `labels.boxes`"
_NO_AMODAL = f"{_NO_2D}, or a rider"
_NO_BOX = "null: a rider"
_NO_PIXELS = "null: `labels.method` is `stage_vo`"

_NO_HULL = f"{_NO_PIXELS}, or a rider"

OBJECT_COLUMNS: tuple[Column, ...] = (
    _K,
    _TIMESTAMP,
    _TRACK_ID,
    Column("episode_id", "str", "", "the episode's id"),
    Column("instance_uid", "str", "", "`episode_id:track_id`; unique in a dataset"),
    Column("class", "str",
        "car, van, truck, bus, motorcycle, bicycle, walker_adult, walker_child, walker_wheelchair, "
        "rider, traffic_light, traffic_sign; on request building, pole, vegetation, …",
        "Car-STAGE class, from the blueprint's attributes; of a level object from its label"),
    Column("blueprint", "str", "",
        "CARLA type id, such as `vehicle.tesla.model3`; the name of a level object"),
    Column("base_type", "str", "", "blueprint attribute; empty where the server has none"),
    Column("special_type", "str", "", "blueprint attribute, such as `emergency`, `taxi`"),
    Column("role_name", "str", "", "blueprint attribute, such as `hero`, `autopilot`"),
    Column("is_static", "bool", "",
        "part of the map, not an actor: a parked vehicle, a light, a sign"),
    Column("is_ego", "bool", "", "the vehicle that carries the sensors"),
    Column("is_dormant", "bool", "", "asleep on a large map; null: not recorded", nullable=True),
    Column("box_center", "f64[3]", "m", f"box centre, world; {_NO_3D}", nullable=True),
    Column("box_rotation_deg", "f64[3]", "deg",
        f"pitch, yaw, roll of the box, world (left-handed); {_NO_3D}", nullable=True),
    Column("box_quaternion", "f64[4]", "",
        f"w, x, y, z of the box's rotation in east-north-up (right-handed); {_NO_3D}",
        nullable=True),
    Column("box_extent", "f64[3]", "m", f"half length, width, height; {_NO_3D}", nullable=True),
    Column("box_source", "str", "actor, capsule, mesh, measured, level, invalid, none",
        "source of the box; `invalid`: the server's is of no use, no 3D label; `none`: a rider"),
    Column("box_center_ego", "f64[3]", "m", f"box centre in the ego actor's frame; {_NO_3D}", True),
    Column("box_yaw_ego", "f64", "rad", f"box yaw in the ego actor's frame; {_NO_3D}", True),
    Column("box_rotation_ego_deg", "f64[3]", "deg",
        f"pitch, yaw, roll of the box in the ego actor's frame; {_NO_3D}", nullable=True),
    Column("distance_ego", "f64", "m", f"ego pivot to box centre; {_NO_3D}", nullable=True),
    Column("actor_location", "f64[3]", "m", "actor pivot, world; middle of a level object's box"),
    Column("actor_rotation_deg", "f64[3]", "deg", "pitch, yaw, roll of the actor, world"),
    Column("velocity", "f64[3]", "m/s", "world"),
    Column("acceleration", "f64[3]", "m/s²",
        "world; null in the first frame of an episode without warm-up", nullable=True),
    Column("velocity_ego", "f64[3]", "m/s", "`velocity` along the ego actor's axes"),
    Column("acceleration_ego", "f64[3]", "m/s²", "`acceleration` along the ego actor's axes",
        nullable=True),
    Column("angular_velocity", "f64[3]", "rad/s",
        "world, left-handed components; null for walkers, whose servers report none to rely on",
        nullable=True),
    Column("num_lidar_points", "map[str,u32]", "points",
        "points of this tick's sweep inside the box, per `lidar`, not per `semantic_lidar`; "
        "empty without a valid box"),
    Column("num_radar_points", "map[str,u32]", "points",
        "detections of this tick inside the box, per radar; empty without a valid box"),
    Column("visibility", "f64", "ratio",
        f"visible over amodal pixels, summed over the cameras; {_NO_PIXELS}, a rider, or no "
        "labelled camera has a picture",
        nullable=True),
    Column("visibility_token", "u8", "1..4",
        "nuScenes bins of `visibility`: below 0.4, 0.6, 0.8, and the rest; null with it",
        nullable=True),
    Column("light_state", "u32", "`carla.VehicleLightState` bits",
        "null: not a vehicle, or not recorded", nullable=True),
    Column("traffic_light_state", "str", "Red, Yellow, Green, Off, Unknown",
        "what a traffic light shows; null: no light, or no actor of the server belongs to it",
        nullable=True),
    Column("parent_track_id", "i64", "",
        "the actor it is attached to, a rider's two-wheeler, the actor of a traffic light; or null",
        nullable=True),
    Column("semantic_tags", "u8[]", "tags of dataset.json", "the object's semantic tags"),
)

CAMERA_OBJECT_COLUMNS: tuple[Column, ...] = (
    _K,
    _TIMESTAMP,
    _TRACK_ID,
    Column("sensor_id", "str", "", "the labelled camera"),
    Column("center_cam", "f64[3]", "m", f"box centre, optical frame; {_NO_3D}", nullable=True),
    Column("location", "f64[3]", "m",
        f"centre of the bottom face, optical: centre + (0, h/2, 0), as in KITTI; {_NO_3D}",
        nullable=True),
    Column("dimensions", "f64[3]", "m", f"height, width, length; {_NO_3D}", nullable=True),
    Column("rotation_y", "f64", "rad",
        f"heading about the optical y axis, [-pi, pi), 0 = along +x; {_NO_3D}", nullable=True),
    Column("alpha", "f64", "rad", f"observation angle: rotation_y - atan2(X, Z); {_NO_3D}", True),
    Column("rotation_cam", "f64[4]", "",
        f"w, x, y, z of box (forward, left, up) to optical; {_NO_3D}",
        nullable=True),
    Column("distance", "f64", "m", "camera to box centre; a rider: of the two-wheeler"),
    Column("depth_center", "f64", "m", "optical z of the box centre; a rider: likewise"),
    Column("corners_uv", "f64[8][2]", "px",
        f"projected box corners in LibCarla's order, null where behind the camera; {_NO_3D}",
        nullable=True),
    Column("bbox_amodal_unclipped", "f64[4]", "px",
        f"x0, y0, x1, y1 around the box's silhouette; may exceed the image; {_NO_AMODAL}",
        nullable=True),
    Column("bbox_amodal", "f64[4]", "px",
        f"x0, y0, x1, y1 around the silhouette's part inside the image; {_NO_AMODAL}",
        nullable=True),
    Column("bbox_modal", "f64[4]", "px",
        f"x0, y0, x1, y1 around the visible pixels, half open; null without any; {_NO_2D}",
        nullable=True),
    Column("mask_modal", "str", "COCO RLE",
        "visible pixels, compressed COCO run lengths; size = [height, width] of the camera; "
        f"null without any; {_NO_2D}", nullable=True),
    Column("n_visible", "u8", "vertices", f"STAGE-VO: in the image, nothing nearer; {_NO_BOX}",
        True),
    Column("n_occluded", "u8", "vertices", f"STAGE-VO: in the image, something nearer; {_NO_BOX}",
        True),
    Column("n_outside", "u8", "vertices", f"STAGE-VO: ahead, but not in the image; {_NO_BOX}",
        True),
    Column("n_behind", "u8", "vertices", f"STAGE-VO: nearer than z_near or behind; {_NO_BOX}",
        True),
    Column("occluded", "u8", "0, 1, 2, 3",
        "STAGE-VO level by visible vertices: 6 or more, 4 or 5, fewer; 3: none in the image, or a "
        "rider"),
    Column("truncation_paper", "f64", "ratio",
        f"(8 - n_visible) / 8, as the paper defines it; {_NO_BOX}", nullable=True),
    Column("truncated", "f64", "ratio",
        f"share of the silhouette's area outside the image; independent of occlusion; {_NO_BOX}",
        nullable=True),
    Column("visible_px", "u32", "px", f"pixels of the object; {_NO_PIXELS}", nullable=True),
    Column("outside_px", "u32", "px",
        f"of these, outside the silhouette: limbs that leave a walker's capsule; {_NO_HULL}",
        nullable=True),
    Column("front_px", "u32", "px", f"pixels of what stands in front; {_NO_HULL}", nullable=True),
    Column("hull_px", "u32", "px", f"pixels of the silhouette; {_NO_HULL}", nullable=True),
    Column("amodal_px", "f64", "px",
        f"estimated pixels without occluders, inside the image; {_NO_HULL}", nullable=True),
    Column("occlusion_ratio", "f64", "ratio", f"1 - visible_px / amodal_px; {_NO_HULL}", True),
    Column("occluded_px", "u8", "0, 1, 2, 3",
        "0 up to a ratio of 0.10, 1 up to 0.50, else 2; 3 not computed"),
    Column("visibility_method", "str", "instance, depth, none",
        "how visible pixels were found; of level objects always by depth and tag"),
    Column("amodal_method", "str", "hull_depth, hull_prior, none",
        "how amodal_px was estimated: from pixels, or 0.8 of the silhouette when none is visible"),
    Column("instance_ambiguous", "bool", "", "another live actor shares the low 16 bits of the id"),
    Column("visible_stage_vo", "bool", "", f"at least one vertex is visible; {_NO_BOX}", True),
    Column("visible_pixel", "bool", "",
        f"visible_px reaches labels.min_visible_px (10); {_NO_PIXELS}", nullable=True),
    Column("visible", "bool", "",
        "the verdict of labels.method (`both`: pixels), and, if there are LiDARs, enough points; "
        "lights and signs need none"),
    Column("crosses_near", "bool", "", "reaches behind the near plane; `truncated` is saturated"),
    Column("pinhole", "bool", "", "the camera has no lens distortion, so that projection holds"),
)

EGO_COLUMNS: tuple[Column, ...] = (
    _K,
    _TIMESTAMP,
    _EGO_TRACK_ID,
    Column("episode_id", "str", "", "the episode's id"),
    Column("location", "f64[3]", "m", "actor pivot, world"),
    Column("rotation_deg", "f64[3]", "deg", "pitch, yaw, roll, world (left-handed)"),
    Column("quaternion", "f64[4]", "", "w, x, y, z in east-north-up (right-handed)"),
    Column("velocity", "f64[3]", "m/s", "world"),
    Column("velocity_ego", "f64[3]", "m/s", "along the ego actor's axes"),
    Column("acceleration", "f64[3]", "m/s²",
        "world; null in the first frame of an episode without warm-up", nullable=True),
    Column("acceleration_ego", "f64[3]", "m/s²", "along the ego actor's axes", nullable=True),
    Column("angular_velocity", "f64[3]", "rad/s", "world, left-handed components"),
    Column("angular_velocity_ego", "f64[3]", "rad/s", "along the ego actor's axes, left-handed"),
    Column("speed", "f64", "m/s", "length of `velocity`"),
    Column("yaw_rate", "f64", "rad/s", "about the world's up axis, clockwise positive"),
    Column("yaw_rate_flu", "f64", "rad/s", "counter-clockwise positive: -yaw_rate"),
    Column("throttle", "f64", "0..1", "applied control", nullable=True),
    Column("steer", "f64", "-1..1", "applied control, positive to the right", nullable=True),
    Column("brake", "f64", "0..1", "applied control", nullable=True),
    Column("hand_brake", "bool", "", "applied control", nullable=True),
    Column("reverse", "bool", "", "applied control", nullable=True),
    Column("gear", "i32", "", "applied control", nullable=True),
    Column("speed_limit_kmh", "f64", "km/h", "limit where the ego drives", nullable=True),
    Column("traffic_light_state", "str", "", "of the light that affects the ego", nullable=True),
    Column("weather_preset", "str", "",
           "preset of this frame's weather; null: none, or changing", nullable=True),
    Column("weather", "json", "", "weather parameters of this frame"),
    Column("map", "str", "", "the map's name as the server gives it"),
    Column("latitude_deg", "f64", "deg", "of the pivot, by `geo_reference`; north is -y"),
    Column("longitude_deg", "f64", "deg", "of the pivot, by `geo_reference`; north is -y"),
    Column("altitude_m", "f64", "m", "of the pivot, by `geo_reference`; north is -y"),
)

SENSOR_POSE_COLUMNS: tuple[Column, ...] = (
    _K,
    _TIMESTAMP,
    Column("sensor_id", "str", "", "the sensor"),
    Column("carrier_track_id", "i64", "", "the actor that carries it; null: fixed on the map",
        nullable=True),
    Column("location", "f64[3]", "m", "of the sensor, world"),
    Column("rotation_deg", "f64[3]", "deg", "pitch, yaw, roll of the sensor, world (left-handed)"),
    Column("ego_from_sensor", "f64[16]", "",
        "4x4 rows: sensor axes to the ego actor's, left-handed"),
)

_BEGAN = "null: it did not happen"

EVENT_COLUMNS: tuple[Column, ...] = (
    Column("event", "i32", "", "position in the scenario's `events`, from 0"),
    Column("episode_id", "str", "", "the episode's id"),
    Column("kind", "str", "", "such as `pedestrian_crosses`"),
    Column("state", "str", "happened, did not happen, not placed",
        "`did not happen`: it was placed and never began"),
    Column("reason", "str", "", "why it did not happen, as it was last; else null", nullable=True),
    Column("placed_tick", "i32", "", "first tick in which its actors stood there; null: never",
        nullable=True),
    Column("begin_tick", "i32", "", f"tick in which it began; {_BEGAN}", nullable=True),
    Column("end_tick", "i32", "", "last tick of it; null: it went on when the episode ended",
        nullable=True),
    Column("begin_s", "f64", "s", f"time of `begin_tick`; {_BEGAN}", nullable=True),
    Column("end_s", "f64", "s", "time of `end_tick`; null with it", nullable=True),
    Column("actors", "i64[]", "",
        "track ids of who took part, the one that acts first; empty: it did not happen"),
    Column("parameters", "json", "", "what was asked for"),
    Column("min_distance", "f64", "m",
        f"smallest distance of the ego's and the first actor's box on the ground; {_BEGAN}",
        nullable=True),
    Column("min_distance_tick", "i32", "", "tick of it; null with it", nullable=True),
    Column("min_ttc", "f64", "s",
        "smallest time until both boxes touch if both go straight on; null: they never would",
        nullable=True),
    Column("min_ttc_tick", "i32", "", "tick of it; null with it", nullable=True),
    Column("collision", "bool", "", f"both boxes overlapped; {_BEGAN}", nullable=True),
    Column("ego_speed_begin", "f64", "m/s", f"the ego's speed at the begin; {_BEGAN}",
        nullable=True),
    Column("ego_deceleration", "f64", "m/s²",
        f"hardest braking of the ego while it went on; {_BEGAN}", nullable=True),
)

CONTROL_COLUMNS: tuple[Column, ...] = (
    Column("tick", "i32", "", "tick that it acted in, from 0, saved or not"),
    Column("k", "i32", "", "saved frame of it; null: the tick was not saved", nullable=True),
    Column("server_frame", "i64", "", "frame of the server that it acted in, as in the ledger"),
    Column("episode_id", "str", "", "the episode's id"),
    Column("throttle", "f64", "0..1", "as the driver commanded it"),
    Column("steer", "f64", "-1..1", "as the driver commanded it, positive to the right"),
    Column("brake", "f64", "0..1", "as the driver commanded it"),
    Column("hand_brake", "bool", "", "as the driver commanded it"),
    Column("reverse", "bool", "", "as the driver commanded it"),
    Column("manual_gear_shift", "bool", "", "`gear` was commanded; else the gear box chose"),
    Column("gear", "i32", "", "as the driver commanded it; `ego.parquet` has the gear that was in"),
)

# fmt: on

CONTROLS = "controls.parquet"
"""The table of a driver's commands: only where the ego has a driver of its own."""

EVENTS = "events.parquet"
"""The table of events: of the episode as a whole, and only where events are planned."""

LANE_LINE_COLUMNS: tuple[Column, ...] = (
    _K,
    Column("sensor_id", "str", "", "the labelled camera"),
    Column(
        "kind",
        "str",
        "marking, boundary, crosswalk, stop_line, painted_object",
        "a `boundary` is that of a driven lane where nothing is painted",
    ),
    Column(
        "map_id",
        "str",
        "",
        "id in the vector map; of a boundary `LANE/left` or `LANE/right`, of its later stretches "
        "with a number",
    ),
    Column("part", "i32", "", "from 0: a line may leave the picture and come back"),
    Column("type", "str", "", "of a marking or a painted object, as in the vector map; else empty"),
    Column(
        "colour", "str", "", "of a marking or a painted object, as in the vector map; else empty"
    ),
    Column(
        "width",
        "f64",
        "m",
        "of a marking's paint, of double lines over both; of a stop line; 0: not known",
    ),
    Column("u", "f64[]", "px", "to the right, of each place of a line or corner of an area"),
    Column("v", "f64[]", "px", "down"),
    Column("x", "f64[]", "m", "the same place in the camera's optical axes: to the right"),
    Column("y", "f64[]", "m", "down"),
    Column("z", "f64[]", "m", "ahead"),
    Column("visible", "u8[]", "0 or 1", "whether nothing stands before the place"),
    Column(
        "visible_share",
        "f64",
        "",
        "of the places of a line, and of places all over an area, that are visible",
    ),
)
LANE_LINES = "lane_lines.parquet"
PATCH_COLUMNS: tuple[Column, ...] = (
    _K,
    Column("sensor_id", "str", "", "the labelled camera"),
    Column("patch", "str", "", "name of the patch, `patch0` is the first of `patches`"),
    Column("target", "str", "billboard, shop_front, vehicle_rear, person", "what it is on"),
    Column("shown", "bool", "", "whether the picture is there; else the board is plain"),
    Column("actor_id", "i64", "", "actor id of the board"),
    Column("target_id", "i64", "", "track id of the vehicle or person that carries it; 0: none"),
    Column("face", "str", "front, back", "of the board, as the embedded simulator shows both"),
    Column("u", "f64[]", "px", "outline, cut at the picture's edges: to the right"),
    Column("v", "f64[]", "px", "down"),
    Column("pixels", "i32", "px", "whose middle lies in the outline, seen or not"),
    Column("visible_share", "f64", "", "of these pixels, before which nothing stands"),
    Column("distance", "f64", "m", "of the patch's middle from the camera"),
    Column("facing", "f64", "", "cosine between the patch's normal and the way to the camera"),
    Column(
        "corners",
        "f64[]",
        "m",
        "12 numbers: x, y, z in the world of top left, top right, bottom right, bottom left",
    ),
)
PATCHES = "patches.parquet"

TABLES: dict[str, tuple[Column, ...]] = {
    "objects.parquet": OBJECT_COLUMNS,
    "camera_objects.parquet": CAMERA_OBJECT_COLUMNS,
    "ego.parquet": EGO_COLUMNS,
    "sensor_poses.parquet": SENSOR_POSE_COLUMNS,
}


def frame_tables(*, lane_lines: bool, patches: bool = False) -> dict[str, tuple[Column, ...]]:
    """The tables with rows of frames, by their files.

    Args:
        lane_lines: whether lines in pictures are asked for.
        patches: whether there are patches.
    """
    optional = {LANE_LINES: (lane_lines, LANE_LINE_COLUMNS), PATCHES: (patches, PATCH_COLUMNS)}
    return {**TABLES, **{name: columns for name, (asked, columns) in optional.items() if asked}}


def markdown() -> str:
    """The tables as Markdown, as they stand in ``docs/formats/dataset.md``."""
    lines: list[str] = []
    optional = {
        EVENTS: EVENT_COLUMNS,
        CONTROLS: CONTROL_COLUMNS,
        LANE_LINES: LANE_LINE_COLUMNS,
        PATCHES: PATCH_COLUMNS,
    }
    for file, columns in {**TABLES, **optional}.items():
        lines += [
            f"### {file}",
            "",
            "| column | type | unit or values | meaning |",
            "|---|---|---|---|",
        ]
        for column in columns:
            type_ = f"`{column.type}`" + (" or null" if column.nullable else "")
            unit = column.unit or "-"
            lines.append(f"| `{column.name}` | {type_} | {unit} | {column.description} |")
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    sys.stdout.write(markdown())
