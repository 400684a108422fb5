"""Two images of one pose show the same semantic tags."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carstage.sensor_kinds.columns import Instance
from carstage.tags import TAGS_0_9_14
from carstage.validation.checks.findings import Findings

MIN_SHARE = 0.98


def check_tags(
    semantic: NDArray[np.uint8],
    instance: NDArray[np.uint16],
    *,
    frame: int,
    semantic_id: str,
    instance_id: str,
    findings: Findings,
) -> None:
    """Compare a semantic image with the tags of an instance image of the same pose (``tags``).

    Args:
        semantic: ``(H, W)`` tags.
        instance: ``(H, W, 2)`` id and tag.
        frame: the frame.
        semantic_id: the semantic camera, that problems are reported of.
        instance_id: the instance camera.
        findings: where problems go.
    """
    same = semantic == instance[..., Instance.TAG]
    share = np.count_nonzero(same) / same.size
    if share < MIN_SHARE:
        findings.add(
            "tags",
            f"{share:.1%} of the pixels have the tag that {instance_id} shows there; "
            f"at least {MIN_SHARE:.0%} must",
            frame=frame,
            sensor=semantic_id,
        )


def check_tag_table(description: Mapping[str, Any], findings: Findings) -> None:
    """Compare the table of ``dataset.json`` with ours (check ``tag_table``)."""
    table = description.get("tags")
    entries = [one for one in table if isinstance(one, dict)] if isinstance(table, list) else []
    listed = {str(entry.get("value")): entry.get("name") for entry in entries}
    for value, tag in TAGS_0_9_14.items():
        name = listed.get(str(value))
        if name != tag.name:
            message = f"dataset.json: tag {value} is called {name!r}, it is {tag.name!r}"
            findings.add("tag_table", message)
