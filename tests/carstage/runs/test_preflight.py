"""A server that would start is not refused before, and one that would not is."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from carstage.config import load_demo
from carstage.errors import BadInputError
from carstage.runs.preflight import check_server
from carstage.server import allot_ports


def carla(path: Path) -> None:
    check_server(load_demo([f"server={{kind: carla, path: {path}}}"]))


@pytest.fixture
def script(tmp_path: Path) -> Path:
    path = tmp_path / "CarlaUE4.sh"
    path.write_text("#!/bin/sh\n")
    path.chmod(0o755)
    return path


def test_folder_of_a_release_and_its_script_are_both_taken(script: Path) -> None:
    carla(script.parent)
    carla(script)


def test_release_that_cannot_be_started_is_refused(script: Path) -> None:
    script.chmod(0o644)
    with pytest.raises(BadInputError, match=r"server\.path.*CarlaUE4\.sh cannot be run"):
        carla(script.parent)
    script.rename(script.with_name("CarlaUnreal.sh"))
    with pytest.raises(BadInputError, match=r"server\.path.*CarlaUE4\.sh is missing"):
        carla(script.parent)


def test_each_server_needs_its_own_number_of_ports(script: Path) -> None:
    ports = allot_ports()
    with socket.create_server(("127.0.0.1", ports.secondary)):
        check_server(load_demo([f"server={{kind: embedded, port: {ports.rpc}}}"]))
        with pytest.raises(BadInputError, match=rf"server\.port: port {ports.secondary} "):
            check_server(load_demo([f"server={{kind: carla, path: {script}, port: {ports.rpc}}}"]))
