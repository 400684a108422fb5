"""Files of an attempt below one of its folders."""

from __future__ import annotations

from pathlib import Path

from carstage.storage.attempt_files import FilesBelow, FolderFiles, write_document


def test_files_below_a_folder_are_the_attempt_s_and_hide_the_others(tmp_path: Path) -> None:
    whole = FolderFiles(tmp_path / "a1")
    below = FilesBelow(whole, "agents/car2")
    write_document(whole, "episode.json", b"{}")
    write_document(below, "episode.json", b"[]")
    with below.stream() as files:
        entry = files.write("sensors/LIDAR/000000.bin", b"points")
    assert entry.path == "agents/car2/sensors/LIDAR/000000.bin"
    assert below.names() == ["episode.json", "sensors/LIDAR/000000.bin"]
    assert below.holds(entry)
    assert whole.holds(entry)
    below.remove(["sensors/LIDAR/000000.bin"])
    assert whole.names() == ["agents/car2/episode.json", "episode.json"]
    below.discard()
    assert whole.names() == ["episode.json"]


def test_entries_of_others_are_not_held(tmp_path: Path) -> None:
    whole = FolderFiles(tmp_path / "a1")
    with whole.stream() as files:
        entry = files.write("episode.json", b"{}")
    assert not FilesBelow(whole, "agents/car2").holds(entry)
