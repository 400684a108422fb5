"""A full disk is told apart from other faults: trying again is pointless then."""

from __future__ import annotations

import errno

import pytest

from carstage.collector.internals.errors import (
    DiskFullError,
    RecordingError,
    client_hint,
    writing_failed,
)


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_lack_of_space_is_an_error_of_its_own(number: int) -> None:
    error = writing_failed(OSError(number, "no room", "CAM/000000.seg"))
    assert isinstance(error, DiskFullError)
    assert error.kind == "disk"
    assert "CAM/000000.seg" in error.message


def test_other_faults_of_the_disk_may_pass() -> None:
    error = writing_failed(OSError(errno.EIO, "Input/output error"))
    assert type(error) is RecordingError


def test_call_that_ran_out_of_time_names_the_setting() -> None:
    late = "time-out of 20000ms while waiting for the simulator, make sure the simulator is ready"
    assert "supervision.hang_s" in client_hint(RuntimeError(late))
    assert "supervision.hang_s" not in client_hint(RuntimeError("failed to generate map"))
