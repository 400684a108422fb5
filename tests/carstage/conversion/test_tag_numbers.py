"""What a server up to 0.9.13 calls a vehicle is called so in the dataset, too."""

from __future__ import annotations

import numpy as np
import pytest

from carstage.annotation.point_sensors import record_dtype
from carstage.conversion.tag_numbers import dataset_payload, dataset_tag_image
from carstage.tags import TAGS_0_9_13, TAGS_0_9_14, dataset_tags

OLD, NEW = "0.9.13", "0.9.14"


@pytest.mark.parametrize("kind", ["semantic", "instance"])
def test_tags_of_old_pictures_are_renumbered_and_nothing_else(kind: str) -> None:
    pixels = np.array([[11, 22, 10, 255], [33, 44, 7, 255], [1, 2, 200, 255]], np.uint8)
    found = np.frombuffer(dataset_payload(kind, OLD, memoryview(pixels).cast("B")), np.uint8)
    expected = pixels.copy()
    expected[:, 2] = [14, 1, 200]  # vehicle, road, and a number that the table lacks
    assert found.tolist() == expected.ravel().tolist()


def test_tags_of_old_points_are_renumbered_and_nothing_else() -> None:
    points = np.zeros(2, record_dtype("semantic_lidar"))
    points["x"], points["object_idx"], points["object_tag"] = 1.5, 70_000, [4, 13]
    payload = memoryview(points.tobytes())
    found = np.frombuffer(
        dataset_payload("semantic_lidar", OLD, payload), record_dtype("semantic_lidar")
    )
    assert found["object_tag"].tolist() == [12, 11]  # pedestrian, sky
    assert found["object_idx"].tolist() == [70_000, 70_000]
    assert found["x"].tolist() == [1.5, 1.5]


@pytest.mark.parametrize(("kind", "server"), [("semantic", NEW), ("rgb", OLD), ("depth", OLD)])
def test_other_payloads_are_not_touched(kind: str, server: str) -> None:
    payload = memoryview(bytes(range(16)))
    assert dataset_payload(kind, server, payload) is payload


def test_tags_of_actors_are_in_the_datasets_numbering() -> None:
    assert dataset_tags([10], OLD) == (14,)
    assert dataset_tags([10], NEW) == (10,)
    names = {TAGS_0_9_14[tag].name for tag in dataset_tags(TAGS_0_9_13, OLD)}
    assert {"Roads", "Car", "Pedestrian", "TrafficLight"} <= names


def test_tags_of_old_pictures_by_themselves_are_renumbered() -> None:
    tags = np.array([[10, 7], [8, 13]], np.uint8)
    found = dataset_tag_image(OLD, tags)
    assert [[TAGS_0_9_14[tag].name for tag in row] for row in found.tolist()] == [
        ["Car", "Roads"],
        ["SideWalks", "Sky"],
    ]
    assert dataset_tag_image(NEW, tags) is tags
