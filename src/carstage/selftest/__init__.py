"""Does a server do what the labels take for granted? A short recording, and who judges it.

``staging`` plans an episode in which the rig is moved by hand between ticks, ``evidence`` reads its
raw log; ``frame_consistency``, ``depth_view``, ``alignment``, ``codes``, ``lidar_axes``,
``optical_flow`` and ``globe`` ask one question each, ``judging`` asks all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from carstage.lazy import lazy_names

if TYPE_CHECKING:
    from carstage.selftest.judging import judge_log
    from carstage.selftest.scene_setup import plan_self_test
    from carstage.selftest.verdict import Check, Verdict, failed_verdict

__all__ = ["Check", "Verdict", "failed_verdict", "judge_log", "plan_self_test"]

__getattr__ = lazy_names(
    __name__,
    {
        "judging": "judge_log",
        "scene_setup": "plan_self_test",
        "verdict": "Check Verdict failed_verdict",
    },
)
