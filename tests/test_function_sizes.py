"""Functions are short and take few parameters; each exception has its reason here."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

SRC = Path(__file__).parents[1] / "src"
MOST_LINES = 80
MOST_PARAMETERS = 8

_KERNEL = "a compiled kernel: arrays and numbers are its parameters, a record costs a copy a ray"
_LOOP = "one compiled loop over shared locals; a function per step would pass all of them"
_OWNER = "puts its parts together: each parameter is one collaborator, all named at the call"
_ROW = "the keys of one row of a table, in the table's order"
_OPTIONS = "typer knows the options of a command by its signature"
_CALL = "the public call: each parameter is an option with a default, told in its docstring"
_PARTS = "a list of parts with their places, read from top to bottom"
_DEFAULTS = "the options of a command line, all with defaults"

REASONS = {
    "carstage/annotation/object_rows.py object_rows": _ROW,
    "carstage/annotation/pixel_kernel.py classify": _LOOP,
    "carstage/cli/app.py run": _OPTIONS,
    "carstage/cli/catalog.py list_": _OPTIONS,
    "carstage/cli/catalog.py query": _OPTIONS,
    "carstage/cli/comparison.py run": _OPTIONS,
    "carstage/cli/estimate.py estimate": _OPTIONS,
    "carstage/cli/export.py export": _OPTIONS,
    "carstage/cli/record.py record": _OPTIONS,
    "carstage/cli/runs.py resume": _OPTIONS,
    "carstage/codecs/png/deflate_kernel.py _literals": _KERNEL,
    "carstage/collector/internals/scene.py __init__": _OWNER,
    "carstage/collector/internals/writing.py __init__": _OWNER,
    "carstage/collector/processing.py __init__": _OWNER,
    "carstage/occupancy/ray_kernel.py shown_places": _KERNEL,
    "carstage/runs/attempt_commit.py __init__": _OWNER,
    "carstage/runs/following.py record_beside": _CALL,
    "carstage/runs/running.py run": _CALL,
    "carstage/runs/session.py __init__": _OWNER,
    "carstage/server/embedded.py __init__": _DEFAULTS,
    "carstage/validation/checks/completeness.py check_missing_rows": _OWNER,
    "carstage_sim/cli.py _parser": _OPTIONS,
    "carstage_sim/maps/opendrive.py sample": _ROW,
    "carstage_sim/maps/writer/junctions.py path": _PARTS,
    "carstage_sim/render/beam_simd.py boxes_in_slabs": _KERNEL,
    "carstage_sim/render/beam_simd.py rays_hit": _KERNEL,
    "carstage_sim/render/beam_simd.py triangles_in_beam": _KERNEL,
    "carstage_sim/render/bvh.py _split_place": _KERNEL,
    "carstage_sim/render/cast.py _walk": _LOOP,
    "carstage_sim/render/cast.py cast_rays": _KERNEL,
    "carstage_sim/render/cast.py trace_actors": _LOOP,
    "carstage_sim/render/detail.py _six_noises": _KERNEL,
    "carstage_sim/render/detail.py pattern": _KERNEL,
    "carstage_sim/render/edges.py _even_part": _KERNEL,
    "carstage_sim/render/edges.py _gather_part": _KERNEL,
    "carstage_sim/render/edges.py _mark": _KERNEL,
    "carstage_sim/render/edges.py _mark_part": _KERNEL,
    "carstage_sim/render/exposure_blur.py _blur_part": _KERNEL,
    "carstage_sim/render/exposure_blur.py _blurred": _KERNEL,
    "carstage_sim/render/exposure_blur.py _light_in_front": _KERNEL,
    "carstage_sim/render/exposure_blur.py _ways_part": _KERNEL,
    "carstage_sim/render/glare.py _glare_part": _KERNEL,
    "carstage_sim/render/laser_kernels.py _gather_part": _KERNEL,
    "carstage_sim/render/lending.py lends": _KERNEL,
    "carstage_sim/render/lending.py _lend_part": _KERNEL,
    "carstage_sim/render/lending.py _mix": _KERNEL,
    "carstage_sim/render/lending.py _mix_part": _KERNEL,
    "carstage_sim/render/lending.py lent": _KERNEL,
    "carstage_sim/render/lending.py mixed": _KERNEL,
    "carstage_sim/render/motion.py _earlier": _KERNEL,
    "carstage_sim/render/motion.py _flow_part": _KERNEL,
    "carstage_sim/render/noise_lanes.py noises": _KERNEL,
    "carstage_sim/render/normals.py _normals_part": _KERNEL,
    "carstage_sim/render/packet_shading.py shade_packets": _KERNEL,
    "carstage_sim/render/packets.py cast_packets": _KERNEL,
    "carstage_sim/render/pixel_kernels.py _hit_ids": _KERNEL,
    "carstage_sim/render/pixel_kernels.py _hit_tags": _KERNEL,
    "carstage_sim/render/shading.py unmirrored": _KERNEL,
    "carstage_sim/render/shaft_simd.py boxes_in_shaft": _KERNEL,
    "carstage_sim/render/shaft_simd.py parallel_rays_hit": _KERNEL,
    "carstage_sim/render/shared_kernels.py _cast_packets_part": _KERNEL,
    "carstage_sim/render/shared_kernels.py _cast_part": _KERNEL,
    "carstage_sim/render/shared_kernels.py _shade_part": _KERNEL,
    "carstage_sim/render/simd.py box_hits": _KERNEL,
    "carstage_sim/render/simd.py triangle_hits": _KERNEL,
    "carstage_sim/render/surface.py facing_normals": _KERNEL,
    "carstage_sim/sensors/voxel_kernels.py collect": _KERNEL,
    "carstage_sim/sensors/voxel_kernels.py gather": _KERNEL,
    "carstage_sim/sensors/voxel_kernels.py measure": _KERNEL,
    "carstage_sim/simulation.py __init__": _DEFAULTS,
    "carstage_sim/wire/framing.py _scan": _LOOP,
    "carstage_sim/world/contacts/boxes.py _touching": _KERNEL,
    "carstage_sim/world/contacts/obstacles.py _touching": _KERNEL,
    "carstage_sim/world/contacts/separating_axes.py least_way_out": _KERNEL,
    "carstage_sim/world/signals/trigger_boxes.py _find_owners": _KERNEL,
}


def large_functions() -> Iterator[str]:
    for path in sorted(SRC.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                continue
            given = node.args
            names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
            parameters = len(names) - (names[:1] in (["self"], ["cls"]))
            lines = (node.end_lineno or node.lineno) - node.lineno + 1
            if lines > MOST_LINES or parameters > MOST_PARAMETERS:
                yield f"{path.relative_to(SRC)} {node.name}"


def test_large_functions_have_a_reason_and_no_reason_is_left_over() -> None:
    assert sorted(set(large_functions())) == sorted(REASONS)
