"""What labelling costs: the crowd that is labelled, and what is made of its CPU times."""

from __future__ import annotations

import numpy as np

from benchmarks.framework import annotation
from carstage.annotation.decoding import decode_instance_bgra


def test_the_crowd_is_as_large_as_the_targets_say_and_partly_visible() -> None:
    crowd = annotation.Crowd()
    pictures = crowd.pictures()
    rows = crowd.labeller("both").label_frame(crowd.world, 0, {"CAM": pictures}, {}).camera_objects
    assert len(rows) == annotation.ACTORS
    assert sum(row["hull_px"] for row in rows) >= annotation.HULL_PX
    assert pictures.instance_bgra is not None
    ids, _ = decode_instance_bgra(pictures.instance_bgra)
    painted = {row["track_id"]: int(np.count_nonzero(ids == row["track_id"])) for row in rows}
    assert {row["track_id"]: row["visible_px"] for row in rows} == painted
    assert 30 < sum(count > 0 for count in painted.values()) < annotation.ACTORS


def test_both_methods_have_to_be_fast_enough_on_a_scaled_machine() -> None:
    cpu_ms = {"stage_vo": 11.0, "pixels": 79.0}
    crowd = (annotation.ACTORS, annotation.HULL_PX)
    assert annotation.judge(cpu_ms, *crowd, slow=2.0).ok
    assert not annotation.judge(cpu_ms, *crowd, slow=1.8).ok
    assert not annotation.judge({**cpu_ms, "pixels": 81.0}, *crowd, slow=2.0).ok


def test_a_small_crowd_proves_nothing() -> None:
    cpu_ms = {"stage_vo": 1.0, "pixels": 1.0}
    assert not annotation.judge(cpu_ms, 99, annotation.HULL_PX, slow=1.0).ok
    assert not annotation.judge(cpu_ms, 100, annotation.HULL_PX - 1, slow=1.0).ok
