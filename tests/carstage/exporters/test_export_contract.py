"""Every format that ships keeps the contract of exporters."""

from __future__ import annotations

import pytest

from carstage.cli.export import FORMATS
from carstage.exporters import exporters
from carstage.testing.exporter import ExporterTests

pytestmark = pytest.mark.xdist_group("export")


class TestCoco(ExporterTests):
    name = "coco"


class TestKittiObject(ExporterTests):
    name = "kitti-object"


class TestKittiTracking(ExporterTests):
    name = "kitti-tracking"


class TestLogs123d(ExporterTests):
    name = "123d"


class TestMcap(ExporterTests):
    name = "mcap"


class TestNuscenes(ExporterTests):
    name = "nuscenes"


class TestWebdataset(ExporterTests):
    name = "webdataset"


class TestYolo(ExporterTests):
    name = "yolo"


def test_the_command_lists_all_formats() -> None:
    assert tuple(exporters()) == FORMATS
