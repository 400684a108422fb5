"""The passes of a camera as pipelines: WGSL from this package around the translated kernels."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from carstage_sim.render.cast import trace
from carstage_sim.render.edges import _apart, _is_even, _leaf_at, _unlike, alike
from carstage_sim.render.film import weight_in_mean
from carstage_sim.render.gpu.arenas import Arenas, Source
from carstage_sim.render.gpu.caster import GpuCaster
from carstage_sim.render.gpu.device import wgsl
from carstage_sim.render.gpu.translate import Translator
from carstage_sim.render.gpu.values import (
    Array,
    Bound,
    Either,
    External,
    Record,
    TranslationError,
    Value,
    convert,
)
from carstage_sim.render.lending import lends
from carstage_sim.render.materials import MaterialTable
from carstage_sim.render.quality import SAMPLING, Quality
from carstage_sim.render.scene import Frame
from carstage_sim.render.shading import colour_of_ray, light_reaching
from carstage_sim.render.sky import Lighting
from carstage_sim.render.surface import facing_normals

_ARENAS = 2
"""Bind group of the frame's arrays; 0 is the scene, 1 the camera, 3 what a pass alone needs."""
_HIT = ("f32", "i32", "i32", "f32", "f32")
TRACING = ("shoot", "reach", "shade")
"""Passes that trace rays."""
LOOPING = (*TRACING, "lend", "products")
"""Passes whose lanes take one ray after the other."""
WRITES_HITS = "shoot"
"""The pass that writes what rays met."""
_LAST = {
    "shoot": "ur", "reach": "urw", "shade": "urrwwwr", "products": "wr", "find_edges": "uwrw",
    "lend": "urrww", "blend_edges": "urrrwrr",
}  # fmt: skip
"""Kinds of the buffers that a pass alone needs."""
_PARTS = {
    "shoot": ("batch", "rays", "aim"),
    "reach": ("batch", "rays", "aim", "met"),
    "shade": ("batch", "rays", "aim", "met", "film"),
    "products": ("rays",),
    "find_edges": ("batch", "edge"),
    "lend": ("batch", "edge"),
    "blend_edges": ("batch", "edge", "film"),
}
"""Sources of this package that a pass needs beside its own."""
_READ_BY_PRODUCTS = (
    ("static", "tag"), ("actors", "tag"), ("static", "object_id"), ("actor_id", ""),
)  # fmt: skip


def frame_source(frame: Frame, materials: MaterialTable, light: Lighting) -> Source:
    """All that kernels read of a frame, by the names of their parameters."""
    return {
        "scene": frame.scene,
        "static": frame.static,
        "actors": frame.actors,
        "appearance": frame.appearance,
        "colour": frame.colour,
        "light_state": frame.light_state,
        "actor_id": frame.actor_id,
        "materials": materials,
        "light": light,
        "lamps": frame.lamps,
    }


def _trace_for(translator: Translator) -> External:
    """How a translated kernel calls the ray caster."""

    def call(arguments: Sequence[Bound]) -> Value:
        texts = [value.code for value in arguments[2:] if isinstance(value, Value)]
        kinds = [value.type for value in arguments[2:] if isinstance(value, Value)]
        if len(texts) != 6 or not isinstance(kinds[0], tuple) or not isinstance(kinds[1], tuple):
            raise TranslationError("trace is called with other arguments than its own")
        vectors = [
            f"vector_of({convert(Value(text, kind), ('f32', 'f32', 'f32'))})"
            for text, kind in zip(texts[:2], kinds[:2], strict=True)
        ]
        translator.structure(_HIT)
        translator.structure(("f32", "f32", "f32"))
        return Value(f"traced({', '.join([*vectors, *texts[2:]])})", _HIT)

    return call


_TRACED = """
fn vector_of(t: Tuple_fff) -> vec3f { return vec3f(t.m0, t.m1, t.m2); }
fn traced(o: vec3f, d: vec3f, low: f32, high: f32, skip: i32, any_hit: bool) -> Tuple_fiiff {
  let hit = trace(o, d, low, high, skip, any_hit);
  return Tuple_fiiff(hit.t, hit.row, hit.triangle, hit.u, hit.v);
}
"""


class CameraProgram:
    """Pipelines of all passes, made when they are first needed.

    Args:
        caster: the card and the scene on it.
        source: a frame's arrays, for their types.
        epic: as the shading kernel's parameter.

    Attributes:
        shot: layouts of bind group 1, by whether a pass writes the hits.
        last: layouts of bind group 3, by pass.
        arenas: the arrays of bind group 2.
        lends: whether extra rays take colours of pixels beside them.
    """

    def __init__(self, caster: GpuCaster, source: Source, *, epic: bool) -> None:
        self._caster = caster
        self._gpu = caster.gpu
        self._epic = epic
        quality = Quality.EPIC if epic else Quality.LOW
        self.lends = SAMPLING[quality].blend
        self._blends = "true" if self.lends else "false"
        self.arenas = Arenas(self._gpu, source)
        # What a pass could write makes the card wait for it, whether it does or not.
        self.shot = {True: self._gpu.layout("urw"), False: self._gpu.layout("urr")}
        self.arena_layout = self._gpu.layout("rrrru")
        self.last = {entry: self._gpu.layout(kinds) for entry, kinds in _LAST.items()}
        self._sources = {
            "shoot": wgsl("shoot"),
            "reach": self._reach_source(),
            "shade": self._shade_source(),
            "products": self._products_source(),
            "find_edges": self._edges_source(),
            "lend": self._lend_source(),
            "blend_edges": self._blend_source(),
        }
        self._pipelines: dict[tuple[str, int], Any] = {}

    def pipeline(self, entry: str) -> Any:
        """The pipeline of an entry point."""
        depth = self._caster.geometry.stack if entry in TRACING else 0
        key = (entry, depth)
        if key not in self._pipelines:
            writes = entry == WRITES_HITS
            layouts = [self._caster.scene_layout, self.shot[writes], self.arena_layout]
            code = self._caster.source() if entry in TRACING else self._gpu.constants
            code += wgsl("shot").replace("HITS", "read_write" if writes else "read")
            if entry != "shoot":
                code += self.arenas.source(_ARENAS)
            code += wgsl(*_PARTS[entry])
            finds = entry == "find_edges"
            code = code.replace("LISTED", "atomic<u32>" if finds else "u32")
            code = code.replace("LIST", "read_write" if finds else "read")
            code = code.replace("COLOURS>", "read_write>" if entry == "shade" else "read>")
            code += self._sources[entry]
            layouts.append(self.last[entry])
            self._pipelines[key] = self._gpu.pipeline(code, entry, layouts)
        return self._pipelines[key]

    def _ray_arguments(self) -> dict[str, Bound]:
        """What the kernels of one ray are given, by the names of their parameters."""
        rays: dict[str, Value | Array] = {
            "origin": Array("ray_origin", "f32", 1),
            "directions": Array("ray_direction", "f32", 2),
            "t": Array("hit_t", "f32", 1),
            "row": Array("hit_row", "i32", 1),
            "triangle": Array("hit_triangle", "i32", 1),
            "weights": Array("hit_weight", "f32", 2),
            "skip": Value("shot.aims[the_camera].skip", "i32"),
            "pixel_angle": Value("shot.angle", "f32"),
        }
        return {
            "frame": Record("frame", self._frame_member),
            "rays": Record("rays", rays.__getitem__),
            "scratch": Record("scratch", _no_member),
            "epic": Value("true" if self._epic else "false", "bool"),
            "i": Value("i", "i32"),
        }

    def _tracing_translator(self) -> Translator:
        """A translator of kernels that trace rays."""
        externals: dict[Any, External] = {}
        translator = Translator(externals)
        externals[trace] = _trace_for(translator)
        translator.structure(_HIT)
        translator.structure(("f32", "f32", "f32"))
        return translator

    def _reach_source(self) -> str:
        """The pass that finds the light, around the translated kernel."""
        translator = self._tracing_translator()
        name, _ = translator.function(light_reaching, list(self._ray_arguments().values()))
        text = wgsl("reach").replace("REACHING(", f"{name}(")
        return _TRACED + translator.source() + "\n" + text

    def _shade_source(self) -> str:
        """The pass that colours, around the translated kernel."""
        translator = self._tracing_translator()
        given = self._ray_arguments()
        given["lamps_on"], given["reaching"] = Value("lamps_on", "bool"), Value("reaching", "f32")
        order = ("frame", "rays", "scratch", "epic", "lamps_on", "i", "reaching")
        name, _ = translator.function(colour_of_ray, [given[parameter] for parameter in order])
        text = wgsl("shade").replace("SHADE(", f"{name}(")
        return _TRACED + translator.source() + "\n" + text

    def _lend_source(self) -> str:
        """The pass that lends colours, around the translated rule for one ray."""
        translator = Translator({})
        whole = Value("i", "i32")
        given: list[Bound] = [
            Array("row_at", "i32", 1),
            Array("triangle_at", "i32", 1),
            whole,
            whole,
            Array("colour_at", "f32", 2),
            Array("pixel_of", "i32", 1),
            Array("step_of", "i32", 2, ("1i", "2i")),
            Array("row_met", "i32", 1),
            Array("triangle_met", "i32", 1),
            whole,
            Array("", "f32", 2, write="set_sampled"),
        ]
        name, _ = translator.function(lends, given)
        return translator.source() + "\n" + wgsl("lend").replace("LENDS(", f"{name}(")

    def _blend_source(self) -> str:
        """The pass that mixes colours, around the translated weights."""
        translator = Translator({})
        away = Value("i", "i32")
        weight, _ = translator.function(weight_in_mean, [away, away])
        return translator.source() + "\n" + wgsl("blend").replace("WEIGHT(", f"{weight}(")

    def _edges_source(self) -> str:
        """The pass that finds edges, around the translated comparisons of two pixels."""
        translator = Translator({})
        place = Value("i", "i32")
        row, triangle = Array("hit_row", "i32", 1), Array("hit_triangle", "i32", 1)
        records: list[Bound] = [self.arenas.record("static"), self.arenas.record("actors")]
        hits: list[Bound] = [row, triangle, place, place]
        unlike, _ = translator.function(_unlike, [*records, *hits])
        detail = self.arenas.member("materials", "detail")
        leaf, _ = translator.function(_leaf_at, [*records, detail, row, triangle, place])
        leaves = Array("leaf_at", "i32", 1)
        even, _ = translator.function(_is_even, [row, triangle, leaves, place, place])
        codes = Array("code_at", "i32", 3)
        apart, _ = translator.function(_apart, [codes, place, place, place, place])
        like, _ = translator.function(alike, [*records, detail, row, triangle, place, place])
        text = wgsl("edges").replace("BLENDS", self._blends).replace("IS_EVEN(", f"{even}(")
        text = text.replace("LEAF(", f"{leaf}(").replace("ALIKE(", f"{like}(")
        text = text.replace("APART(", f"{apart}(").replace("UNLIKE(", f"{unlike}(")
        return translator.source() + "\n" + text

    def _products_source(self) -> str:
        """The pass that writes all other pictures, around the translated normals."""
        for record, name in _READ_BY_PRODUCTS:
            self.arenas.member(record, name)
        translator = Translator({})
        surfaces = Either("", self.arenas.record("static"), self.arenas.record("actors"))
        whole, real = Value("i", "i32"), Value("x", "f32")
        never = Value("false", "bool")
        given: list[Bound] = [
            self.arenas.record("scene"),
            surfaces,
            whole,
            whole,
            real,
            real,
            never,
        ]
        name, _ = translator.function(facing_normals, [*given, real, real, real])
        return translator.source() + "\n" + wgsl("products").replace("FACING(", f"{name}(")

    def _frame_member(self, name: str) -> Value | Array | Record:
        """A field of ``ShadedFrame``: a record of arrays, or an array by itself."""
        return self.arenas.member(name) if name in _ARRAYS else self.arenas.record(name)


_ARRAYS = ("colour", "light_state")


def _no_member(name: str) -> Array:
    raise TranslationError(f"working memory has no {name} on a card")
