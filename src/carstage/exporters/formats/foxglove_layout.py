"""A layout for Foxglove and Lichtblick: the scene in 3D, pictures, plots of the ego, its signals.

The file is what these programs write themselves under "Export layout": panels with their settings
by id, and a tree that says where each panel is.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from carstage.exporters.formats.mcap_records import EGO, MAP

_MOST_PICTURES: Final = 6
_PICTURES: Final = {
    "foxglove.CompressedImage", "foxglove.RawImage",
    "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image",
}  # fmt: skip
_CALIBRATIONS: Final = {"foxglove.CameraCalibration", "sensor_msgs/msg/CameraInfo"}
_ANNOTATIONS: Final = {"foxglove.ImageAnnotations"}
_CLOUDS: Final = {"foxglove.PointCloud", "sensor_msgs/msg/PointCloud2"}
_SCENES: Final = {"foxglove.SceneUpdate", "visualization_msgs/msg/MarkerArray"}
_FIXES: Final = {"foxglove.LocationFix", "sensor_msgs/msg/NavSatFix"}
_SPEEDS: Final = {
    "carstage.EgoState": ("speed_m_s", "yaw_rate_rad_s", "throttle", "brake", "steer"),
    "nav_msgs/msg/Odometry": ("twist.twist.linear.x", "twist.twist.angular.z"),
}
"""What is plotted of the ego, by the schema that has it."""
_STATES: Final = {"carstage.EgoState", "diagnostic_msgs/msg/DiagnosticArray"}


def layout(topics: Mapping[str, str]) -> dict[str, Any]:
    """The layout for files with these topics.

    Args:
        topics: the full name of the schema by topic, in the order in which they shall appear.

    Returns:
        A JSON object; it names no other topics.
    """
    panels: dict[str, Any] = {"3D!scene": _scene(topics)}
    pictures = _pictures(topics)
    for number, topic in enumerate(pictures):
        panels[f"Image!camera{number}"] = _picture(topic, topics)
    below = []
    speeds = [f"{topic}.{path}" for topic, kind in topics.items() for path in _SPEEDS.get(kind, ())]
    if speeds:
        panels["Plot!ego"] = {"title": "Ego", "paths": [_path(path) for path in speeds]}
        below.append("Plot!ego")
    fixes = _of(topics, _FIXES)
    if fixes:
        panels["map!fix"] = {"followTopic": fixes[0], "zoomLevel": 17}
        below.append("map!fix")
    states = [topic for topic in _of(topics, _STATES) if topic.startswith(f"/{EGO}")]
    if states:
        panels["RawMessages!ego"] = {"topicPath": states[0]}
        below.append("RawMessages!ego")
    cameras = _halves([f"Image!camera{number}" for number in range(len(pictures))], "column")
    upper = "3D!scene" if cameras is None else _split("row", "3D!scene", cameras, 60)
    lower = _halves(below, "row")
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": upper if lower is None else _split("column", upper, lower, 70),
    }


def _scene(topics: Mapping[str, str]) -> dict[str, Any]:
    """The 3D panel: it goes with the ego, and looks at it from above and behind."""
    shown: dict[str, Any] = {}
    for topic in _of(topics, _CLOUDS):
        shown[topic] = {"visible": True, "colorMode": "colormap", "colorMap": "turbo",
                        "colorField": "z", "pointSize": 3}  # fmt: skip
    shown |= {topic: {"visible": True} for topic in _of(topics, _SCENES)}
    return {
        "followTf": EGO,
        "followMode": "follow-pose",
        "fixedFrame": MAP,
        "cameraState": {"perspective": True, "distance": 35, "phi": 60, "thetaOffset": 90,
                        "targetOffset": [0, 0, 0], "fovy": 45, "near": 0.5, "far": 5000},
        "layers": {"grid": {"layerId": "foxglove.Grid", "instanceId": "grid", "visible": True,
                            "frameId": EGO, "size": 100, "divisions": 20}},
        "topics": shown,
    }  # fmt: skip


def _pictures(topics: Mapping[str, str]) -> Sequence[str]:
    """What is worth a panel: pictures that people can read, one of each camera."""
    by_camera: dict[str, str] = {}
    for topic in _of(topics, _PICTURES):
        camera = topic.split("/")[1]
        if camera not in by_camera or topic.endswith("/colors"):
            by_camera[camera] = topic
    return list(by_camera.values())[:_MOST_PICTURES]


def _picture(topic: str, topics: Mapping[str, str]) -> dict[str, Any]:
    camera = "/" + topic.split("/")[1] + "/"
    mode: dict[str, Any] = {"imageTopic": topic}
    for calibration in _of(topics, _CALIBRATIONS):
        if calibration.startswith(camera):
            mode["calibrationTopic"] = calibration
    mode["annotations"] = {
        name: {"visible": True} for name in _of(topics, _ANNOTATIONS) if name.startswith(camera)
    }
    return {"imageMode": mode}


def _of(topics: Mapping[str, str], schemas: Iterable[str]) -> list[str]:
    wanted = set(schemas)
    return [topic for topic, schema in topics.items() if schema in wanted]


def _path(value: str) -> dict[str, Any]:
    return {"value": value, "enabled": True, "timestampMethod": "receiveTime"}


def _split(direction: str, first: Any, second: Any, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}


def _halves(panels: Sequence[str], direction: str) -> Any:
    """Panels beside one another, as a tree; ``None`` of none."""
    if len(panels) < 2:
        return panels[0] if panels else None
    middle = (len(panels) + 1) // 2
    first, second = _halves(panels[:middle], direction), _halves(panels[middle:], direction)
    return _split(direction, first, second, 100 * middle / len(panels))
