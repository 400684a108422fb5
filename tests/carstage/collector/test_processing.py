"""The pipeline from callbacks to sealed segments, on plain data objects."""

from __future__ import annotations

import struct
import subprocess
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any

import carla
import pytest

from carstage.collector import processing
from carstage.collector import timing as collector_timing
from carstage.collector.internals.errors import InterruptedByRequestError, RecordingError
from carstage.collector.internals.matching import ExpectedFrame, FrameMatcher
from carstage.collector.internals.snapshots import ActorPacker, WorldMoment
from carstage.collector.internals.stopping import StopRequest
from carstage.collector.internals.writing import LogWriters, Write
from carstage.collector.processing import MAX_CONSECUTIVE_MISSES, ByteBudget, Pipeline
from carstage.collector.sensors import Sensor, sensor_of
from carstage.collector.sensors.cameras import Camera
from carstage.rawlog.format import WORLD, SealedSegment
from carstage.rawlog.reader import EpisodeLog
from carstage.rawlog.writing import StreamWriter, write_episode_file

FIRST_FRAME = 50
CAMERA = sensor_of("rgb")


def picture(frame: int, width: int = 4, height: int = 3) -> Any:
    pixels = struct.pack("<I", frame) * (width * height)
    return SimpleNamespace(
        frame=frame,
        timestamp=frame / 10,
        width=width,
        height=height,
        fov=90.0,
        raw_data=pixels,
    )


def position(frame: int) -> Any:
    return SimpleNamespace(
        frame=frame, timestamp=frame / 10, latitude=frame / 2, longitude=1.5, altitude=2.5
    )


class Recording:
    """A pipeline with one camera and one GNSS, and what it said."""

    def __init__(
        self,
        folder: Path,
        stack: ExitStack,
        *,
        steps: int,
        save_every: int = 1,
        patience_s: float = 30.0,
        limit_bytes: int = 1 << 20,
        strict: bool = True,
        ticks_per_segment: int = 2,
        camera: Sensor = CAMERA,
        pause_s: float = 0.0,
    ) -> None:
        self.steps = steps
        self.save_every = save_every
        self.sealed: list[SealedSegment] = []
        self.failures: list[BaseException] = []
        self.budget = ByteBudget(limit_bytes)
        self.stop = StopRequest()
        header = {"format_version": 1, "ticks": steps}
        write_episode_file(str(folder), header)
        self.writers = stack.enter_context(
            LogWriters(
                str(folder),
                {"CAM": 1000, "GNSS": 24, WORLD: 68},
                ticks_per_segment,
                2,
                self.budget.give_back,
                self.sealed.append,
                self.failures.append,
            )
        )
        self.pipeline = stack.enter_context(
            Pipeline(
                {"CAM": camera, "GNSS": sensor_of("gnss")},
                self.writers,
                FrameMatcher(["CAM", "GNSS"], patience_s),
                self.budget,
                steps,
                ticks_per_segment,
                strict=strict,
                failures=self.failures,
                pause_s=pause_s,
            )
        )
        self.camera = self.pipeline.callback("CAM")
        self.gnss = self.pipeline.callback("GNSS")
        self.pipeline.begin(FIRST_FRAME - 1)

    def tick(self, number: int, new_actors: Any = ()) -> None:
        frame = FIRST_FRAME + number
        k = number // self.save_every if number % self.save_every == 0 else None
        moment = WorldMoment([], {"delta_s": 0.1}, new_actors)
        self.pipeline.expect(ExpectedFrame(number, frame, number / 10, k, 0.01, moment))

    def finish(self) -> None:
        assert self.pipeline.wait_booked(self.steps, 20.0)
        assert self.writers.wait_sealed(self.steps - 1, 20.0)


class CountedInbox(SimpleQueue[Any]):
    """Counts how often its reader had nothing left to do."""

    def __init__(self) -> None:
        self.times_empty = 0

    def get(self, block: bool = True, timeout: float | None = None) -> Any:
        self.times_empty += self.empty()
        return super().get(block, timeout)


class CountedPuts:
    """An inbox that counts what is put into it this way."""

    def __init__(self, inbox: SimpleQueue[Any]) -> None:
        self._inbox = inbox
        self.times = 0

    def put(self, item: Any) -> None:
        self.times += 1
        self._inbox.put(item)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inbox, name)


def while_recording(running: Recording) -> None:
    """What the main thread does between ticks, until something is wrong."""
    while not running.pipeline.wait_booked(running.steps, 0.05):
        running.pipeline.wait_for_room(running.stop)


@contextmanager
def recording(folder: Path, **options: Any) -> Iterator[Recording]:
    with ExitStack() as stack:
        yield Recording(folder, stack, **options)


@pytest.mark.parametrize(("pause_s", "least", "most"), [(0.0, 10, 1000), (0.5, 1, 8)])
def test_a_pipeline_that_pauses_looks_at_what_came_meanwhile_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, pause_s: float, least: int, most: int
) -> None:
    monkeypatch.setattr(processing, "SimpleQueue", CountedInbox)
    pace = threading.Event()
    with recording(tmp_path, steps=40, pause_s=pause_s, strict=False) as running:
        for number in range(40):
            running.camera(picture(FIRST_FRAME + number))
            running.gnss(position(FIRST_FRAME + number))
            running.tick(number)
            pace.wait(0.01)
        running.finish()
        assert least <= running.pipeline._inbox.times_empty <= most  # type: ignore[attr-defined]
    assert [row["k"] for row in EpisodeLog(tmp_path).ledger()] == list(range(40))


def test_a_pipeline_does_not_pause_while_much_waits(tmp_path: Path) -> None:
    begun_s = time.monotonic()
    with recording(tmp_path, steps=20, pause_s=30.0, limit_bytes=100, strict=False) as running:
        assert running.budget.is_roomy
        running.budget.take(60)  # of somebody who does not give it back
        for number in range(20):
            running.camera(picture(FIRST_FRAME + number))
            running.gnss(position(FIRST_FRAME + number))
            running.tick(number)
        running.finish()
        assert not running.budget.is_roomy
    assert time.monotonic() - begun_s < 30.0


def test_every_tick_comes_back_from_the_log(tmp_path: Path) -> None:
    with recording(tmp_path, steps=5) as running:
        for number in range(5):
            running.camera(picture(FIRST_FRAME + number))
            running.tick(number, [{"id": 1}] if number == 0 else [])
            running.gnss(position(FIRST_FRAME + number))
        running.finish()
    log = EpisodeLog(tmp_path)
    assert log.is_complete()
    for stream in ("CAM", "GNSS", WORLD, "ledger"):
        assert log.sealed_segments(stream) == (0, 1, 2)
    pictures = [record for index in range(3) for record in log.read_segment("CAM", index)]
    assert [record.tick for record in pictures] == [0, 1, 2, 3, 4]
    assert [record.frame for record in pictures] == [50, 51, 52, 53, 54]
    assert pictures[3].payload == picture(53).raw_data
    assert pictures[3].meta == {
        "width": 4,
        "height": 3,
        "fov_deg": 90.0,
        "sensor_timestamp_s": 5.3,
    }
    (first, *_), *_ = (log.read_segment("GNSS", index) for index in range(3))
    assert struct.unpack("<3d", first.payload) == (25.0, 1.5, 2.5)
    assert [record.kind for record in log.read_segment(WORLD, 0)] == [3, 1, 1]
    rows = log.ledger()
    assert [row["k"] for row in rows] == [0, 1, 2, 3, 4]
    assert all(row["sensors"]["CAM"]["state"] == "ok" for row in rows)
    assert running.budget.held_bytes == 0


def test_the_ledger_is_sealed_after_every_other_stream(tmp_path: Path) -> None:
    with recording(tmp_path, steps=6) as running:
        for number in range(6):
            running.tick(number)
            running.camera(picture(FIRST_FRAME + number))
            running.gnss(position(FIRST_FRAME + number))
        running.finish()
    for segment in range(3):
        streams = [sealed.stream for sealed in running.sealed if sealed.segment == segment]
        assert sorted(streams) == ["CAM", "GNSS", "ledger", "world"]
        assert streams[-1] == "ledger"


def test_ticks_that_are_not_saved_are_in_the_ledger_only(tmp_path: Path) -> None:
    with recording(tmp_path, steps=5, save_every=3, ticks_per_segment=1) as running:
        for number in range(5):
            running.tick(number)
            running.camera(picture(FIRST_FRAME + number))
            running.gnss(position(FIRST_FRAME + number))
        running.finish()
    log = EpisodeLog(tmp_path)
    assert [row["k"] for row in log.ledger()] == [0, None, None, 1, None]
    assert [len(log.read_segment("CAM", index)) for index in range(5)] == [1, 0, 0, 1, 0]
    assert [len(log.read_segment(WORLD, index)) for index in range(5)] == [1] * 5
    assert running.budget.held_bytes == 0


def test_a_missing_frame_is_recorded_and_the_others_are_kept(tmp_path: Path) -> None:
    with recording(tmp_path, steps=3, patience_s=0.05, strict=False) as running:
        for number in range(3):
            running.tick(number)
            running.gnss(position(FIRST_FRAME + number))
        running.finish()
        assert running.pipeline.incomplete_ticks == 3
    log = EpisodeLog(tmp_path)
    assert log.is_complete()
    assert {row["sensors"]["CAM"]["state"] for row in log.ledger()} == {"missing"}
    assert [record.tick for record in log.read_segment("GNSS", 0)] == [0, 1]


@pytest.mark.parametrize("whole", [3, 4])
def test_a_recording_whose_server_is_gone_ends_with_the_last_whole_frame(
    tmp_path: Path, whole: int
) -> None:
    with recording(tmp_path, steps=9, strict=False) as running:
        for number in range(whole + 1):
            running.tick(number)
            running.gnss(position(FIRST_FRAME + number))
            if number < whole:
                running.camera(picture(FIRST_FRAME + number))
        running.pipeline.hold(True)
        running.steps = running.pipeline.end_with_whole()
        assert running.steps == whole
        running.finish()
        assert running.pipeline.incomplete_ticks == 0
    assert len(list(EpisodeLog(tmp_path).ledger())) == whole


def test_a_dead_sensor_ends_the_recording(tmp_path: Path) -> None:
    with recording(tmp_path, steps=20, patience_s=0.05) as running:
        for number in range(MAX_CONSECUTIVE_MISSES):
            running.tick(number)
            running.gnss(position(FIRST_FRAME + number))
        with pytest.raises(RecordingError, match="CAM delivered nothing for 5 ticks in a row"):
            running.pipeline.wait_booked(20, 20.0)


def test_the_tick_waits_while_too_many_bytes_wait_for_the_disk(tmp_path: Path) -> None:
    with recording(tmp_path, steps=2, limit_bytes=60) as running:
        running.camera(picture(FIRST_FRAME))
        running.pipeline.wait_for_room(running.stop)
        running.camera(picture(FIRST_FRAME + 1))
        room = threading.Event()

        def wait() -> None:
            running.pipeline.wait_for_room(running.stop)
            room.set()

        waiting = threading.Thread(target=wait)
        waiting.start()
        assert not room.wait(0.3)
        running.tick(0)
        running.gnss(position(FIRST_FRAME))
        assert room.wait(20.0)
        waiting.join()
        running.tick(1)
        running.gnss(position(FIRST_FRAME + 1))
        running.finish()


def test_there_is_room_for_a_tick_only_if_all_of_it_fits() -> None:
    budget = ByteBudget(100, tick_bytes=60)
    budget.take(40)
    assert budget.wait_for_room(0.0)
    budget.take(1)
    assert not budget.wait_for_room(0.0)


def test_data_on_the_way_take_room_too() -> None:
    budget = ByteBudget(100, tick_bytes=40)
    budget.expect_tick()
    assert budget.wait_for_room(0.0)
    budget.expect_tick()
    assert not budget.wait_for_room(0.0)
    budget.take(40)
    budget.tick_came()
    assert not budget.wait_for_room(0.0)
    budget.give_back(40)
    assert budget.wait_for_room(0.0)


def test_a_tick_larger_than_the_budget_is_let_in_when_nothing_waits() -> None:
    budget = ByteBudget(100, tick_bytes=300)
    assert budget.wait_for_room(0.0)
    budget.take(300)
    assert not budget.wait_for_room(0.0)
    budget.give_back(300)
    assert budget.wait_for_room(0.0)


def test_how_long_ticks_waited_and_what_is_queued_is_counted(tmp_path: Path) -> None:
    with recording(tmp_path, steps=1, limit_bytes=60) as running:
        running.pipeline.wait_for_room(running.stop)
        before_s = running.pipeline.waited_s
        running.camera(picture(FIRST_FRAME))
        running.camera(picture(FIRST_FRAME + 1))
        assert running.pipeline.queued_bytes == 96
        threading.Timer(0.2, running.stop.request, ["test"]).start()
        with pytest.raises(InterruptedByRequestError):
            running.pipeline.wait_for_room(running.stop)
        assert running.pipeline.waited_s > before_s


def test_a_server_that_runs_on_while_the_tick_waits_does_not_block_it_for_ever(
    tmp_path: Path,
) -> None:
    with recording(tmp_path, steps=2, limit_bytes=60, strict=False) as running:
        running.tick(0)
        running.gnss(position(FIRST_FRAME))
        running.camera(picture(FIRST_FRAME))
        for passed_unseen in range(1, 4):
            running.camera(picture(FIRST_FRAME + passed_unseen))
        deadline = threading.Timer(20.0, running.stop.request, ["it waited for ever"])
        deadline.start()
        try:
            running.pipeline.wait_for_room(running.stop)
        finally:
            deadline.cancel()


def test_waiting_for_room_ends_when_somebody_asks_to_end(tmp_path: Path) -> None:
    with recording(tmp_path, steps=2, limit_bytes=0) as running:
        running.camera(picture(FIRST_FRAME))
        running.stop.request("test")
        with pytest.raises(InterruptedByRequestError):
            running.pipeline.wait_for_room(running.stop)


def test_who_ticks_wakes_nobody_and_what_is_announced_is_seen_with_the_next_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with recording(tmp_path, steps=3) as running:
        pipeline, told = running.pipeline, SimpleQueue[tuple[int, str]]()
        put = CountedPuts(pipeline._inbox)
        monkeypatch.setattr(pipeline, "_inbox", put)
        monkeypatch.setattr(
            pipeline,
            "_on_expected",
            lambda made: told.put((made.tick, threading.current_thread().name)),
        )
        running.tick(0)
        assert put.times == 0
        running.camera(picture(FIRST_FRAME))  # this way to the inbox is not counted
        assert told.get(timeout=20.0) == (0, "matcher")
        # Where no data come, the matcher lags behind by a tick, until somebody waits for it.
        running.tick(1)
        running.tick(2)
        assert put.times == 1
        assert told.get(timeout=20.0) == (1, "matcher")
        assert not pipeline.wait_booked(3, 0.01)
        assert told.get(timeout=20.0) == (2, "matcher")


def test_a_disk_that_refuses_ends_the_recording(tmp_path: Path) -> None:
    with recording(tmp_path, steps=4) as running:
        (tmp_path / "CAM" / "000000.seg.open").touch()  # where the first segment should go
        running.tick(0)
        running.camera(picture(FIRST_FRAME))
        running.gnss(position(FIRST_FRAME))
        with pytest.raises(RecordingError, match=r"Writing the raw log failed: .*File exists"):
            while_recording(running)


def test_an_abandoned_recording_leaves_whole_records_unsealed(tmp_path: Path) -> None:
    with recording(tmp_path, steps=4) as running:
        running.tick(0)
        running.camera(picture(FIRST_FRAME))
        running.gnss(position(FIRST_FRAME))
        assert running.pipeline.wait_booked(1, 20.0)
    log = EpisodeLog(tmp_path)
    assert log.sealed_segments("CAM") == ()
    assert not log.is_complete()
    assert (tmp_path / "CAM" / "000000.seg.open").stat().st_size > 0


def test_everything_booked_is_written_when_the_recording_is_abandoned(tmp_path: Path) -> None:
    class Slow(Camera):
        def encode(self, data: Any) -> Any:
            threading.Event().wait(0.05)
            return super().encode(data)

    with recording(tmp_path, steps=50, ticks_per_segment=1, camera=Slow(CAMERA.kind)) as running:
        for number in range(4):
            running.tick(number)
            running.camera(picture(FIRST_FRAME + number))
            running.gnss(position(FIRST_FRAME + number))
        assert running.pipeline.wait_booked(4, 20.0)
    assert running.failures == []
    log = EpisodeLog(tmp_path)
    assert log.sealed_segments("CAM") == log.sealed_segments("ledger") == (0, 1, 2, 3)


def test_the_warm_up_sees_what_was_delivered(tmp_path: Path) -> None:
    with recording(tmp_path, steps=1) as running:
        running.camera(picture(FIRST_FRAME - 1))
        assert running.pipeline.wait_delivered(FIRST_FRAME - 1, 0.2) == ("GNSS",)
        running.gnss(position(FIRST_FRAME - 1))
        assert running.pipeline.wait_delivered(FIRST_FRAME - 1, 20.0) == ()


@pytest.mark.py38
def test_the_pipeline_runs_under_python_3_8(tmp_path: Path, python38: str) -> None:
    code = """
import sys
from types import SimpleNamespace
sys.path.insert(0, sys.argv[2])
from carstage.collector import paths, timing
from carstage.collector.internals import events
from carstage.collector.internals.matching import ExpectedFrame, FrameMatcher
from carstage.collector.internals.plan import parse_plan
from carstage.collector.processing import ByteBudget, Pipeline
from carstage.collector.sensors import Sensor, sensor_of
from carstage.collector.internals.snapshots import ActorPacker, WorldMoment
from carstage.collector.internals.writing import LogWriters, Write
from carstage.rawlog.writing import StreamWriter, write_episode_file
folder = paths.prepare_folder(sys.argv[1])
write_episode_file(folder, {"format_version": 1, "ticks": 2})
budget, failures = ByteBudget(1000), []
sizes = {"GNSS": 24, "world": 68}
writers = LogWriters(folder, sizes, 2, 1, budget.give_back, lambda sealed: None, failures.append)
gnss = {"GNSS": sensor_of("gnss")}
with writers, Pipeline(gnss, writers, FrameMatcher(["GNSS"], 5.0), budget, 2, 2) as pipeline:
    pipeline.begin(9)
    for tick in range(2):
        data = SimpleNamespace(
            frame=10 + tick, timestamp=tick / 10, latitude=1.0, longitude=2.0, altitude=3.0
        )
        pipeline.callback("GNSS")(data)
        moment = WorldMoment([], {}, [])
        pipeline.expect(ExpectedFrame(tick, 10 + tick, tick / 10, tick, 0.0, moment))
    assert pipeline.wait_booked(2, 10.0) and writers.wait_sealed(1, 10.0)
"""
    source = Path(collector_timing.__file__).parents[2]
    subprocess.run([python38, "-I", "-c", code, str(tmp_path / "log"), str(source)], check=True)
    log = EpisodeLog(tmp_path / "log")
    assert log.is_complete()
    assert [record.frame for record in log.read_segment("GNSS", 0)] == [10, 11]


def test_what_comes_together_is_handled_at_once_and_in_order(tmp_path: Path) -> None:
    with recording(tmp_path, steps=4, pause_s=0.2) as running:
        for number in range(4):
            running.camera(picture(FIRST_FRAME + number))
            running.tick(number)
            running.gnss(position(FIRST_FRAME + number))
        running.finish()
        assert running.budget.held_bytes == 0
    log = EpisodeLog(tmp_path)
    frames = [record.frame for index in (0, 1) for record in log.read_segment("CAM", index)]
    assert frames == [FIRST_FRAME + number for number in range(4)]


def test_signs_are_packed_again_only_where_they_were_moved() -> None:
    asked: list[int] = []

    class Sign:
        id = 7

        def __init__(self, x: float) -> None:
            self._at = carla.Transform(carla.Location(x, 0.0, 0.0))

        def get_transform(self) -> carla.Transform:
            return self._at

        def get_velocity(self) -> carla.Vector3D:
            asked.append(self.id)
            return carla.Vector3D()

        get_angular_velocity = get_acceleration = lambda self: carla.Vector3D()

    packer, fixed = ActorPacker(), frozenset({7})
    first, again, moved = (packer.pack([Sign(x)], fixed) for x in (1.0, 1.0, 2.0))
    assert first == again == ActorPacker().pack([Sign(1.0)])
    assert moved == ActorPacker().pack([Sign(2.0)])
    assert len(asked) == 2 + 2


def test_data_live_until_they_are_with_the_kernel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client's view of a picture does not keep the picture's memory."""
    gone: list[bool] = []
    written: list[bool] = []

    class Data:
        def __del__(self) -> None:
            gone.append(True)

    def task(tick: int) -> Write:
        data = Data()
        return Write("CAM", 1, tick, tick, 0.0, lambda: ({"of": bool(data)}, b"picture"), 7)

    flush = StreamWriter.flush

    def watched(writer: StreamWriter) -> None:
        written.append(not gone)
        flush(writer)

    monkeypatch.setattr(StreamWriter, "flush", watched)
    writers = LogWriters(
        str(tmp_path),
        {"CAM": 10},
        10,
        1,
        lambda size: None,
        lambda sealed: None,
        lambda error: None,
    )
    for tick in range(3):
        writers.write(task(tick))
    with writers:
        pass
    assert written[0]
    assert gone == [True] * 3


def test_functions_of_a_moment_are_called_by_who_writes() -> None:
    called: list[str] = []

    def lights() -> dict[str, int]:
        called.append("lights")
        return {"7": 3}

    moment = WorldMoment([], {"delta_s": 0.1, "vehicle_lights": lights}, [])
    assert called == []
    assert moment.encode() == ({"delta_s": 0.1, "vehicle_lights": {"7": 3}}, b"")
