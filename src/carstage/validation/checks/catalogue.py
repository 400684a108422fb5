"""Every check by name, with the rule that it checks: for reports, and for the documentation."""

from __future__ import annotations

from typing import Final

GROUPS: Final[dict[str, dict[str, str]]] = {
    "Files": {
        "empty": "the dataset has a committed episode",
        "unreadable": "the documents and tables of every episode can be read",
        "file_missing": "every file of the marker is there",
        "file_size": "it has the size that was committed",
        "file_hash": "it has the hash that was committed",
        "file_unlisted": "what spec and ledger promise was committed",
        "file_unexpected": "nothing else lies in an episode's folder",
        "map": "the town's OpenDRIVE text is there, and is the one that was committed",
        "vector_map": "the town's vector map holds together and is what the OpenDRIVE text says",
        "splits": "the splits can be read, each has an episode, and every episode is there",
        "decode": "every file decodes",
        "image_size": "every image has the size of the calibration",
        "tag_table": "dataset.json numbers the semantic tags as Car-STAGE does",
        "schema": "the tables of IMU, GNSS, radar and V2X have their columns",
    },
    "Server, ledger and time": {
        "self_test": "the server passed the self-test before the run",
        "ledger_ticks": "the ledger has a row for each step",
        "ledger_state": "every sensor delivered in every tick",
        "frames_missing": "no frame is missing from the ledger and the tables",
        "timestamps": "times are tick / fps, or at least increase",
        "server_frames": "the server's frame numbers follow each other",
        "label_timestamps": "label rows have the ledger's times",
    },
    "Labels among themselves": {
        "label_keys": "no two rows have the same key",
        "label_ranges": "values lie in their ranges",
        "label_references": "rows of cameras speak of objects and cameras that there are",
        "label_gaps": "no object vanishes and returns, the ego is always there",
        "label_missing": "every object whose box a camera's image holds has a row",
        "label_poses": "a box is the same in the world and in the ego's frame",
        "motion": "objects and ego move as their velocities say",
        "motion_rows": "each velocity, acceleration and yaw rate is the change that it says",
        "object_columns": "columns of objects.parquet follow from one another",
        "camera_columns": "3D columns and levels of cameras follow from boxes, poses and counts",
        "ego_columns": "columns of ego.parquet follow from one another",
        "tracks": "an object keeps its class, blueprint, size and tags, and they fit each other",
        "lights": "heads of a traffic light agree, and turn in its order",
        "sensor_poses": "sensors are where ego, calibration and spec put them",
        "events": "events are those that were planned, as near as the labels say",
        "controls": "the driver's commands are one for each tick, and were applied",
        "drones": "drones are where their paths are, and no faster than they may be",
        "fleet": "agents have the ego's frames, and put everybody where the ego's tables do",
        "variants": "variants of an episode have the same frames, and everybody at the same places",
        "patch_pairs": "pictures with and without patches are equal outside of them",
        "readings": "IMU and GNSS read what the motion of their sensor makes them",
        "messages": "received V2X messages tell where their senders are, and are strong enough",
    },
    "Labels against the data": {
        "hull": "the pixels of an object lie inside the projection of its box",
        "bbox_amodal": "the amodal 2D box is the projection of the 3D box",
        "level_boxes": "the boxes of parked vehicles, lights and signs show them",
        "mask": "masks have the pixels, bounds and ids that they should have",
        "birds_eye": "bird's-eye grids are what map, boxes, depth images and points make them",
        "occupancy": "voxels agree with boxes, and explain depth images and points",
        "lane_lines": "lines in pictures are what vector map, poses and depth images make them",
        "disparity": "disparity is focal length times baseline by depth; both pictures agree",
        "patches": "outlines of patches are what corners, poses and depth images make them",
        "lidar_counts": "boxes hold as many LiDAR points as their labels say",
        "lidar_depth": "LiDAR and depth images see the same surfaces",
        "flash_beams": "points of flash LiDARs lie on their beams, within their range",
        "flash_tags": "points of semantic flash LiDARs have tags that there are",
        "sweep_motion": "points of sweeping LiDARs are measured in their turn, motion is undone",
        "radar_rcs": "radar cross sections are those that their model may give",
        "tags": "semantic and instance images of one pose show the same tags",
        "flow": "optical flow is what depth and the camera's motion make it",
        "rgb_edges": "colour images are steep where labels change",
        "mirrored": "no colour image fits its labels better as its mirror image",
        "colour_order": "red and blue are where the sky by day and vehicles' paint say",
        "lidar_intensity": "intensities lie between 0 and 1, and not all are 0",
        "rgb_frame": "colour images fit the labels of their own frame best",
    },
    "Suspicious contents": {
        "exposure": "colour images are neither black, nor blown out, nor of one colour",
        "repeated": "no image or sweep is the one before it again while its sensor moves",
        "repeated_episode": "no two episodes hold the same sensor data",
        "population": "as many road users as asked for could be placed",
        "no_objects": "the labelled cameras of an episode see some object",
        "no_vehicles": "where vehicles were asked for, some vehicle is seen",
        "no_pedestrians": "where pedestrians were asked for, some pedestrian is seen",
        "all_occluded": "not everything that is seen is largely occluded",
        "frozen_traffic": "some vehicle other than the ego moves",
        "ego_still": "the ego moves in some episode",
    },
}
"""Rules by group and name, in the order in which they are checked."""

RULES: Final[dict[str, str]] = {
    name: rule for checks in GROUPS.values() for name, rule in checks.items()
}
"""All rules by name."""
