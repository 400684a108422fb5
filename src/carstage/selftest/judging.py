"""All checks of a self-test, in an order in which each may rely on those before it."""

from __future__ import annotations

from pathlib import Path

from carstage.selftest.alignment import available, check_actors, check_pictures, check_poses
from carstage.selftest.codes import check_instance_ids, check_tags
from carstage.selftest.depth_view import check_depth
from carstage.selftest.evidence import read_evidence
from carstage.selftest.frame_consistency import check_frames, check_mounts
from carstage.selftest.globe import check_gnss
from carstage.selftest.lidar_axes import check_lidar_axes
from carstage.selftest.optical_flow import check_optical_flow
from carstage.selftest.verdict import Verdict
from carstage.tags import server_release

#: Before it, CARLA's instance camera wrote ids of Unreal's objects, and labels do without.
ACTOR_IDS_SINCE = (0, 9, 16)


def judge_log(folder: Path) -> Verdict:
    """Judge the raw log of a self-test.

    Args:
        folder: the attempt's folder, with ``episode.json``.

    Raises:
        RawLogError: it is damaged, or frames are missing in it.
    """
    evidence = read_evidence(folder)
    server = str(evidence.header["server_version"])
    depth, view = check_depth(evidence)
    checks = [check_frames(evidence), check_mounts(evidence), depth, check_poses(view)]
    checks += [check_pictures(view, name) for name in available(evidence)]
    checks.append(check_actors(view))
    if "instance" in evidence.pictures:
        needed = server_release(server) >= ACTOR_IDS_SINCE
        checks.append(check_instance_ids(view, actor_ids_needed=needed))
    if "semantic" in evidence.pictures:
        checks.append(check_tags(view, server))
    if "flow" in evidence.pictures:
        checks.append(check_optical_flow(view))
    if evidence.world_from_lidar is not None:
        checks.append(check_lidar_axes(view))
    gnss = None
    if evidence.world_from_gnss is not None:
        check, gnss = check_gnss(evidence)
        checks.append(check)
    return Verdict(
        server=server,
        client=str(evidence.header["client_version"]),
        map=str(evidence.header["map"]).rsplit("/", 1)[-1],
        checks=tuple(checks),
        gnss=None if gnss is None else gnss._asdict(),
    )
