"""From a raw log to files: complete, and the same bytes however and wherever it is done."""

from __future__ import annotations

import json
import multiprocessing
import os
import random
import shutil
import time
from collections.abc import Callable
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

import analytic_dataset
import analytic_scene
from analytic_dataset import convert
from carstage.annotation.schema import EGO_COLUMNS, frame_tables
from carstage.conversion import EpisodeConversion
from carstage.conversion.documents import ledger_table
from carstage.conversion.encoded import parts_folder
from carstage.conversion.segment import label_segment, read_label_part, rows_to_table
from carstage.conversion.sensors import plan_sensors
from carstage.conversion.town import Town
from carstage.conversion.whole_episode import write_episode
from carstage.dataset.ledger import unlabelled_frames
from carstage.dataset.tables import read_table
from carstage.errors import BadInputError, ConversionError, RawLogError
from carstage.processes import process_pool
from carstage.rawlog.reader import EpisodeLog
from carstage.spec import EpisodeSpec
from carstage.storage import FolderFiles
from carstage.validation import validate_dataset


def contents(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def raw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scene") / "raw"
    analytic_scene.write_raw_log(folder)
    return folder


@pytest.fixture(scope="module")
def converted(raw: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("converted") / "a1"
    convert(raw, folder)
    return folder


def test_every_requested_sensor_has_its_files_and_no_hidden_one(converted: Path) -> None:
    names = set(contents(converted))
    for k in range(6):
        for stem in ("CAM_FRONT", "CAM_LEFT", "DEPTH_FRONT", "SEM_FRONT", "INST_FRONT"):
            assert f"sensors/{stem}/{k:06d}.png" in names
        assert f"sensors/INST_FRONT/{k:06d}.tag.png" in names
        assert f"sensors/LIDAR_TOP/{k:06d}.bin" in names
    assert {"sensors/IMU.parquet", "sensors/GNSS.parquet"} <= names
    assert len(names) == 6 * 7 + 2 + 7
    assert not any("CAM_LEFT.depth" in name for name in names)


def test_announced_in_any_order_the_bytes_are_the_same(
    raw: Path, converted: Path, tmp_path: Path
) -> None:
    log = EpisodeLog(raw)
    seals = [(s, i) for s in log.streams for i in log.sealed_segments(s)] * 2
    random.Random(3).shuffle(seals)
    with ThreadPoolExecutor(3) as pool:
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "other"), pool)
        done = [conversion.frames_done]
        for stream, segment in seals:
            conversion.segment_sealed(stream, segment)
            done.append(conversion.frames_done)
        conversion.finish()
    assert done == sorted(done)
    assert conversion.frames_done == 6
    assert contents(tmp_path / "other") == contents(converted)


def test_what_is_converted_may_go_and_the_bytes_are_the_same(
    converted: Path, tmp_path: Path
) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    log = EpisodeLog(tmp_path / "raw")

    class Held(ThreadPoolExecutor):
        """Begins nothing before it is told to."""

        def __init__(self) -> None:
            super().__init__(2)
            self.go = Event()

        def submit(self, function: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
            return super().submit(lambda: (self.go.wait(), function(*arguments))[1])

    with Held() as pool:
        conversion = EpisodeConversion(log.folder, FolderFiles(tmp_path / "other"), pool)
        conversion.remove_converted()
        conversion.scan()
        conversion.remove_converted()
        assert all(log.sealed_segments(stream) == (0, 1) for stream in log.streams)
        pool.go.set()
        while conversion.frames_done < 6:
            conversion.remove_converted()
        conversion.remove_converted()
        kept = {stream for stream in log.streams if log.sealed_segments(stream) == (0, 1)}
        assert kept == {"world", "ledger"}
        assert not any(log.sealed_segments(stream) for stream in set(log.streams) - kept)
        conversion.finish()
    assert contents(tmp_path / "other") == contents(converted)


def test_whoever_asks_whether_all_is_written_need_not_wait(
    raw: Path, converted: Path, tmp_path: Path
) -> None:
    begun, go = Event(), Event()

    class HoldsTheRest(ThreadPoolExecutor):
        """Begins what belongs to the whole episode when it is told to."""

        def submit(self, function: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
            def work() -> Any:
                if function.__name__ == "write_episode":
                    begun.set()
                    go.wait()
                return function(*arguments)

            return super().submit(work)

    with HoldsTheRest(2) as pool:
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "other"), pool)
        conversion.scan()
        while not begun.is_set():
            assert not conversion.is_written()
        assert not conversion.is_written()
        assert not (tmp_path / "other/episode.json").exists()
        go.set()
        while not conversion.is_written():
            pass
        assert contents(tmp_path / "other") == contents(converted)
        assert conversion.finish().frames == 6


def test_what_fails_at_the_end_is_raised_by_the_finish(tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    with ThreadPoolExecutor(1) as pool:
        conversion = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
        while conversion.frames_done < 6:
            pass
        shutil.rmtree(tmp_path / "raw/.labels")
        while not conversion.is_written():
            pass
        with pytest.raises(ConversionError, match="label part"):
            conversion.finish()


def test_what_could_not_be_converted_stays(raw: Path, tmp_path: Path) -> None:
    shutil.copytree(raw, tmp_path / "raw")
    path = tmp_path / "raw/CAM_FRONT/000000.seg"
    path.write_bytes(path.read_bytes()[:-100])
    with ThreadPoolExecutor(1) as pool:
        conversion = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
        with pytest.raises(RawLogError):
            conversion.finish()
        conversion.remove_converted()
    log = EpisodeLog(tmp_path / "raw")
    assert log.sealed_segments("CAM_FRONT") == (0,)
    assert log.sealed_segments("CAM_LEFT") == ()


def test_another_attempt_in_processes_gives_the_same_bytes(converted: Path, tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw", attempt="a7")
    with process_pool(2) as pool:
        EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "a7"), pool).finish()
    assert contents(tmp_path / "a7") == contents(converted)


def test_no_path_attempt_or_wall_time_stands_in_any_file(raw: Path, converted: Path) -> None:
    for name, content in contents(converted).items():
        for secret in (str(raw.parent), '"a1"', "attempt", "wait_s", "tick_s"):
            assert secret.encode() not in content, f"{secret} in {name}"


def test_only_frames_that_are_saved_become_files(tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw", steps=7, save_every=3)
    conversion = convert(tmp_path / "raw", tmp_path / "out")
    assert conversion.frames_done == 3
    frames = sorted(path.name for path in (tmp_path / "out/sensors/CAM_FRONT").iterdir())
    assert frames == ["000000.png", "000001.png", "000002.png"]
    ledger = read_table(tmp_path / "out/frames.parquet")
    assert ledger["k"].to_pylist() == [0, None, None, 1, None, None, 2]
    imu = read_table(tmp_path / "out/sensors/IMU.parquet")
    assert imu["k"].to_pylist() == [0, 1, 2]
    np.testing.assert_allclose(imu["timestamp_s"].to_numpy(), [0.0, 0.3, 0.6])
    assert imu["accelerometer"][0].as_py() == [0.0, 0.0, 9.81]
    for table in ("objects", "camera_objects", "ego"):
        ks = read_table(tmp_path / f"out/{table}.parquet")["k"].to_pylist()
        assert set(ks) == {0, 1, 2}
        assert ks == sorted(ks)


@pytest.mark.parametrize("asked", [True, False])
def test_points_are_read_for_labels_only_where_there_are_objects(
    asked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    header = analytic_scene.write_raw_log(tmp_path / "raw")
    header["spec"]["ground_truth"].update(vehicles=asked, pedestrians=False)
    (tmp_path / "raw" / "episode.json").write_text(json.dumps(header))
    whole, read = EpisodeLog.read_segment, set()

    def noted(log: EpisodeLog, stream: str, index: int) -> Any:
        read.add(stream)
        return whole(log, stream, index)

    monkeypatch.setattr(EpisodeLog, "read_segment", noted)
    monkeypatch.setattr(EpisodeLog, "level_objects", lambda _log, up_to_segment: [])
    label_segment(tmp_path / "raw", FolderFiles(tmp_path / "out"), 0)
    assert ("LIDAR_TOP" in read) is asked
    rows = read_label_part(parts_folder(tmp_path / "raw", None), "objects.parquet", 0).num_rows
    assert (rows > 0) is asked


@pytest.mark.parametrize("without", [(0, 1), (1,)])
def test_tables_are_the_same_whatever_stands_for_parts_without_rows(
    without: tuple[int, ...], tmp_path: Path
) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    columns = frame_tables(lane_lines=False)["objects.parquet"]
    segments = EpisodeLog(tmp_path / "raw").segments
    assert set(without) <= set(segments)
    for segment in segments:
        label_segment(tmp_path / "raw", FolderFiles(tmp_path / "label"), segment)
    written = {}
    for made_by in ("Arrow", "us"):
        for segment in without:
            part = parts_folder(tmp_path / "raw", None) / f"{segment:06d}.objects.arrow"
            if made_by == "us":
                part.write_bytes(b"no rows\n")
                continue
            nothing = rows_to_table([], columns, "objects.parquet")
            with pa.OSFile(str(part), "wb") as file, pa.ipc.new_file(file, nothing.schema) as arrow:
                arrow.write_table(nothing)
        out = FolderFiles(tmp_path / made_by)
        write_episode(tmp_path / "raw", out, {}, {"IMU": (), "GNSS": ()}, None, Town())
        written[made_by] = contents(out.folder)
    assert "objects.parquet" in written["us"]
    assert written["us"] == written["Arrow"]


def test_a_part_without_rows_that_is_cut_off_is_damaged(tmp_path: Path) -> None:
    (tmp_path / "000000.objects.arrow").write_bytes(b"no ro")
    with pytest.raises(ConversionError, match="gone or damaged"):
        read_label_part(tmp_path, "objects.parquet", 0)


def test_what_an_earlier_conversion_left_behind_is_removed(raw: Path, tmp_path: Path) -> None:
    convert(raw, tmp_path / "out", codecs={"CAM_FRONT": "jpeg"})
    assert (tmp_path / "out/sensors/CAM_FRONT/000000.jpg").exists()
    (tmp_path / "out/sensors/CAM_FRONT/.000003.png").write_bytes(b"half")
    convert(raw, tmp_path / "out")
    files = {path.name for path in (tmp_path / "out/sensors/CAM_FRONT").iterdir()}
    assert files == {f"{k:06d}.png" for k in range(6)}


def test_an_unfinished_recording_is_refused_and_says_how_much_there_is(tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw", segments=1)
    with pytest.raises(ConversionError, match="only 3 of 6 ticks"):
        convert(tmp_path / "raw", tmp_path / "out")


def test_an_open_segment_is_left_alone(raw: Path, tmp_path: Path) -> None:
    submitted: list[tuple[Any, ...]] = []

    class Recorder(ThreadPoolExecutor):
        def submit(self, function: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
            submitted.append((function.__name__, *arguments))
            return Future()

    with Recorder(1) as pool:
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "out"), pool)
        conversion.segment_sealed("CAM_FRONT", 0)
        assert submitted == []
        conversion.segment_sealed("ledger", 0)
        assert [task[0] for task in submitted] == ["encode_segment"]
        for stream in ("world", "DEPTH_FRONT", "INST_FRONT", "CAM_LEFT.depth", "LIDAR_TOP"):
            conversion.segment_sealed(stream, 0)
        assert "label_segment" not in [task[0] for task in submitted]
        conversion.segment_sealed("CAM_LEFT.instance", 0)
        assert [task[0] for task in submitted].count("label_segment") == 1


def test_a_damaged_segment_fails_with_its_name(tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    segment = tmp_path / "raw" / "LIDAR_TOP" / "000001.seg"
    segment.write_bytes(segment.read_bytes()[:-100])
    with ThreadPoolExecutor(2) as pool:
        conversion = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        with pytest.raises(RawLogError, match=r"LIDAR_TOP/000001\.seg"):
            conversion.finish()
        with pytest.raises(RawLogError):
            conversion.raise_if_failed()


def test_progress_is_told_for_all_work_when_it_is_done(raw: Path, tmp_path: Path) -> None:
    done: list[int] = []
    with ThreadPoolExecutor(2) as pool:
        conversion = EpisodeConversion(
            raw,
            FolderFiles(tmp_path / "out"),
            pool,
            progress=lambda: done.append(conversion.frames_done),
        )
        conversion.finish()
    segments = len(list((raw / "ledger").glob("*.seg")))
    streams = len(list((raw).glob("*/000000.seg")))
    assert segments < len(done) <= segments * streams
    assert max(done) == conversion.frames_done > 0


class AtOnce(Executor):
    """Does each task before it hands it out, as a pool may on a busy machine."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        done: Future[Any] = Future()
        done.set_result(fn(*args, **kwargs))
        return done


def test_progress_may_be_asked_for_by_a_task_that_is_done_at_once(
    raw: Path, tmp_path: Path
) -> None:
    done: list[int] = []
    conversion = EpisodeConversion(
        raw,
        FolderFiles(tmp_path / "out"),
        AtOnce(),
        progress=lambda: done.append(conversion.frames_done),
    )
    conversion.finish()
    assert done
    assert done == sorted(done)
    assert conversion.frames_done >= done[-1]


@pytest.mark.parametrize("damage", [Path.unlink, lambda part: part.write_bytes(b"no table")])
def test_label_part_that_is_gone_or_damaged_is_told(
    damage: Callable[[Path], object], raw: Path, tmp_path: Path
) -> None:
    with ThreadPoolExecutor(2) as pool:
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
    damage(next((raw / ".labels").glob("000001.objects*")))
    with ThreadPoolExecutor(1) as pool:
        conversion.use(pool)
        with pytest.raises(ConversionError, match="label part"):
            conversion.finish()
    conversion.cancel()


def test_cancelling_removes_the_attempt_and_the_label_parts(raw: Path, tmp_path: Path) -> None:
    with ThreadPoolExecutor(1) as pool:
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
        conversion.cancel()
        conversion.cancel()
    assert not (tmp_path / "out").exists()
    assert not (raw / ".labels").exists()


def test_cancelling_after_the_end_leaves_the_files_to_the_store(raw: Path, tmp_path: Path) -> None:
    conversion = convert(raw, tmp_path / "out")
    conversion.cancel()
    assert (tmp_path / "out" / "episode.json").exists()


def test_cancelling_does_not_wait_for_what_a_killed_pool_never_began(
    raw: Path, tmp_path: Path
) -> None:
    pool = process_pool(1)
    pool.submit(time.sleep, 60)
    conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "out"), pool)
    conversion.scan()
    pool.kill()
    conversion.cancel()
    assert conversion.converted() == []


class Some(ThreadPoolExecutor):
    """Does the first tasks that it gets, and none of the others."""

    def __init__(self, count: int) -> None:
        super().__init__(1)
        self._left = count

    def submit(self, function: Any, /, *arguments: Any, **_: Any) -> Future[Any]:
        self._left -= 1
        return super().submit(function, *arguments) if self._left >= 0 else Future()


@pytest.mark.parametrize("count", [0, 1, 5, 100])
def test_another_conversion_goes_on_where_one_was_stopped(
    count: int, converted: Path, tmp_path: Path
) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    with Some(count) as pool:
        conversion = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
    conversion.remove_converted()
    conversion.stop()
    done = conversion.converted()
    assert len(done) == min(count, len(conversion._tasks))
    (tmp_path / "raw").rename(tmp_path / "elsewhere")
    with Some(100) as pool:
        another = EpisodeConversion(tmp_path / "elsewhere", FolderFiles(tmp_path / "out"), pool)
        another.go_on(json.loads(json.dumps(done)))
        another.finish()
    assert contents(tmp_path / "out") == contents(converted)


@pytest.mark.parametrize("change", ["shorter", "other", "gone", "elsewhere", "untold", "nonsense"])
def test_what_is_not_as_it_was_written_is_not_gone_on_with(change: str, tmp_path: Path) -> None:
    analytic_scene.write_raw_log(tmp_path / "raw")
    with ThreadPoolExecutor(1) as pool:
        conversion = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        conversion.scan()
    done: list[Any] = conversion.converted()
    files = [file for entry in done for file in entry.get("files", ())]
    path = tmp_path / "out" / files[0]["path"]
    if change == "shorter":
        path.write_bytes(path.read_bytes()[:-1])
    elif change == "other":
        path.write_bytes(bytes(path.stat().st_size))
    elif change == "gone":
        path.unlink()
    elif change == "elsewhere":
        path.rename(tmp_path / "file")
        files[0]["path"] = "../file"
    elif change == "untold":
        del files[0]["hash"]
    else:
        done[0] = 7
    with ThreadPoolExecutor(1) as pool:
        another = EpisodeConversion(tmp_path / "raw", FolderFiles(tmp_path / "out"), pool)
        with pytest.raises(ConversionError):
            another.go_on(done)


def test_a_pool_whose_process_died_is_a_conversion_error(raw: Path, tmp_path: Path) -> None:
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool:
        with pytest.raises(BrokenExecutor):
            pool.submit(os._exit, 1).result()
        conversion = EpisodeConversion(raw, FolderFiles(tmp_path / "out"), pool)
        with pytest.raises(ConversionError, match="died"):
            conversion.finish()


def test_an_unknown_codec_or_sensor_is_bad_input() -> None:
    spec = EpisodeSpec.from_json(analytic_scene.spec())
    with pytest.raises(BadInputError, match="no sensor 'CAM_BACK'"):
        plan_sensors(spec, {"CAM_BACK": "png"})
    with pytest.raises(BadInputError, match="no codec 'gif'"):
        plan_sensors(spec, {"CAM_FRONT": "gif"})
    with pytest.raises(BadInputError, match="no codec 'png'"):
        plan_sensors(spec, {"IMU": "png"})


def test_in_asynchronous_mode_every_file_has_the_servers_time(tmp_path: Path) -> None:
    folder = analytic_dataset.make_dataset(
        tmp_path / "out", tmp_path, mode="async", period_s=0.25, steps=4
    )
    attempt = analytic_dataset.attempt_of(folder)
    for name in ("frames", "ego", "objects", "camera_objects", "sensors/IMU"):
        times = sorted(set(read_table(attempt / f"{name}.parquet")["timestamp_s"].to_pylist()))
        np.testing.assert_allclose(times, [0.0, 0.25, 0.5, 0.75], atol=1e-9)
    assert validate_dataset(folder).ok


def test_a_clock_that_jumps_is_refused() -> None:
    spec = analytic_scene.spec(steps=3)
    header = analytic_scene.header(spec, attempt="a1", ticks_per_segment=3)
    ledger = [
        {"tick": tick, "k": tick, "frame": 12 + tick, "timestamp_s": time_s, "sensors": {}}
        for tick, time_s in enumerate((1.1, 1.2, 1.35))
    ]
    plan = plan_sensors(EpisodeSpec.from_json(spec), {})
    with pytest.raises(ConversionError, match=r"tick 2: .* 0\.250000 s"):
        ledger_table(header, EpisodeSpec.from_json(spec), plan, ledger)
    ledger[2]["timestamp_s"] = 1.3000001
    assert ledger_table(header, EpisodeSpec.from_json(spec), plan, ledger)[
        "timestamp_s"
    ].to_pylist() == [0.0, 0.1, 0.2]


def test_a_lost_step_is_refused_however_late_it_comes() -> None:
    spec = analytic_scene.spec(steps=3000)
    header = analytic_scene.header(spec, attempt="a1", ticks_per_segment=3)
    plan = plan_sensors(EpisodeSpec.from_json(spec), {})

    def ledger(lost_from: int) -> list[dict[str, Any]]:
        # A step of 0.1 s in float32, as a server adds it up.
        times = [1.1 + float(np.float32(0.1)) * (i + (i >= lost_from)) for i in range(3000)]
        return [
            {"tick": i, "k": i, "frame": 12 + i, "timestamp_s": time_s, "sensors": {}}
            for i, time_s in enumerate(times)
        ]

    assert ledger_table(header, EpisodeSpec.from_json(spec), plan, ledger(3000)).num_rows == 3000
    with pytest.raises(ConversionError, match="tick 2500: "):
        ledger_table(header, EpisodeSpec.from_json(spec), plan, ledger(2500))


def test_a_label_row_that_does_not_fit_the_schema_is_refused(converted: Path) -> None:
    row = read_table(converted / "ego.parquet").to_pylist()[0]
    assert rows_to_table([row], EGO_COLUMNS, "ego").num_rows == 1
    for wrong in (
        {**row, "surprise": 1},
        {key: value for key, value in row.items() if key != "speed"},
        {**row, "location": [1.0, 2.0]},
        {**row, "speed": None},
        {**row, "speed": "fast"},
    ):
        with pytest.raises(ConversionError, match="ego"):
            rows_to_table([wrong], EGO_COLUMNS, "ego")


def test_the_dataset_that_results_is_valid(tmp_path: Path) -> None:
    folder = analytic_dataset.make_dataset(tmp_path / "out", tmp_path)
    report = validate_dataset(folder)
    assert report.problems == ()


def test_the_ledger_says_which_pictures_have_no_labels(tmp_path: Path) -> None:
    """Hidden depth is in no file: a picture without it looks like one that shows no object."""
    document = analytic_scene.spec(steps=3)
    document["save_every"] = 2
    spec = EpisodeSpec.from_json(document)
    header = analytic_scene.header(document, attempt="a1", ticks_per_segment=3)
    plan = plan_sensors(spec, {})
    good, lost = {"state": "ok", "reason": None}, {"state": "missing", "reason": "late"}
    ledger = [
        {
            "tick": tick,
            "k": {0: 0, 2: 1}.get(tick),
            "frame": 12 + tick,
            "timestamp_s": 1.1 + tick / 10,
            "sensors": {sensor.id: good for sensor in spec.sensors}
            | ({"CAM_LEFT.depth": lost, "INST_FRONT": lost} if tick == 2 else {}),
        }
        for tick in range(3)
    ]
    table = ledger_table(header, spec, plan, ledger)
    assert table["CAM_LEFT.state"].to_pylist() == ["ok"] * 3
    assert table["CAM_LEFT.labels"].to_pylist() == ["ok", None, "missing"]
    assert table["CAM_FRONT.labels"].to_pylist() == ["ok", None, "ok"]
    assert "LIDAR.labels" not in table.column_names
    assert unlabelled_frames(table) == {"CAM_FRONT": [], "CAM_LEFT": [1]}
