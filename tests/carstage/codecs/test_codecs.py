"""The built-in codecs against the contract of all codecs, and their pixels against Pillow."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from PIL import Image

from carstage.codecs import SEMANTIC_POINT, Codec, codec_for, codec_names
from carstage.codecs.png import PngPacker, unpack_png
from carstage.errors import BadInputError
from carstage.sensor_kinds.columns import SweepPoint
from carstage.testing.codec import CodecTests, RawRecord

KINDS = ("rgb", "depth", "semantic", "instance")


def camera_record(height: int, width: int, seed: int) -> RawRecord:
    bgra = np.random.default_rng(seed).integers(0, 256, (height, width, 4), dtype=np.uint8)
    return {"width": width, "height": height, "fov_deg": 90.0}, memoryview(bgra.tobytes())


class CameraCodecTests(CodecTests):
    kind: str
    name: str | None = None

    def codec(self) -> Codec:
        return codec_for(self.kind, self.name)[1]

    def records(self) -> list[RawRecord]:
        return [camera_record(5, 7, 0), camera_record(5, 7, 1), camera_record(1, 1, 2),
                camera_record(3, 16, 3)]  # fmt: skip

    def bad_records(self) -> list[RawRecord]:
        meta, payload = camera_record(4, 4, 0)
        return [
            (meta, payload[:-4]),
            ({**meta, "width": 5}, payload),
            ({**meta, "height": 0}, payload),
        ]


class TestRgbPng(CameraCodecTests):
    kind = "rgb"

    def test_the_order_becomes_red_green_blue(self) -> None:
        bgra = memoryview(bytes([30, 20, 10, 255]))
        (content,) = self.codec().encode({"width": 1, "height": 1}, bgra)
        with Image.open(io.BytesIO(content)) as picture:
            assert picture.mode == "RGB"
            assert picture.getpixel((0, 0)) == (10, 20, 30)


class TestNormalsPng(CameraCodecTests):
    kind = "normals"


class FlowCodecTests(CodecTests):
    name: str

    def codec(self) -> Codec:
        return codec_for("flow", self.name)[1]

    def record(self, height: int, width: int, seed: int) -> RawRecord:
        shares = np.random.default_rng(seed).normal(size=(height, width, 2)).astype("<f4")
        return {"width": width, "height": height, "fov_deg": 90.0}, memoryview(shares.tobytes())

    def records(self) -> list[RawRecord]:
        return [self.record(5, 7, 0), self.record(5, 7, 1), self.record(1, 1, 2)]

    def bad_records(self) -> list[RawRecord]:
        meta, payload = self.record(4, 4, 0)
        return [
            (meta, payload[:-8]),
            ({**meta, "width": 5}, payload),
            ({**meta, "height": 0}, payload),
        ]

    def test_shares_of_half_the_image_become_pixels_right_and_down(self) -> None:
        shares = np.array([[[0.5, -0.25]] * 4] * 2, "<f4")
        flow = self.codec().raw_array({"width": 4, "height": 2}, memoryview(shares.tobytes()))
        assert flow.shape == (2, 4, 2)
        assert flow[0, 0].tolist() == [1.0, 0.25]


class TestFlowNpz(FlowCodecTests):
    name = "npz"


class TestFlowKitti(FlowCodecTests):
    name = "kitti"
    tolerance = 1 / 128

    def test_another_reader_sees_kittis_code(self) -> None:
        cv2 = pytest.importorskip("cv2")
        # 4x2 px: shares of half the image are 2 px to the right and 1 px upwards.
        shares = np.zeros((2, 4, 2), "<f4")
        shares[0, 0] = (0.5, -0.25)
        shares[1, 3] = (-1.0, 3.0)
        (content,) = self.codec().encode({"width": 4, "height": 2}, memoryview(shares.tobytes()))
        bgr = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
        assert bgr.dtype == np.uint16
        assert bgr[0, 0].tolist() == [1, 32768 + 16, 32768 + 64]
        assert bgr[1, 3].tolist() == [1, 32768 - 3 * 64, 32768 - 2 * 64]
        assert bgr[0, 1].tolist() == [1, 32768, 32768]

    def test_a_motion_too_large_for_the_code_is_no_value(self) -> None:
        shares = np.array([[[1.0, 0.0], [1.1, 0.0], [np.nan, 0.0], [-1.0, 0.0]]], "<f4")
        meta = {"width": 1024, "height": 1}
        wide = np.repeat(shares, 256, axis=1)
        flow = self.codec().decode(self.codec().encode(meta, memoryview(wide.tobytes())))
        assert np.isnan(flow[0, :768]).all()  # 512 px is one step too much
        assert (flow[0, 768:] == (-512.0, 0.0)).all()


class SemanticLidarCodecTests(CodecTests):
    name: str
    empty_is_damage = False

    def codec(self) -> Codec:
        return codec_for("semantic_lidar", self.name)[1]

    def records(self) -> list[RawRecord]:
        rng = np.random.default_rng(1)
        made = []
        for count in (3, 40):
            points = np.zeros(count, SEMANTIC_POINT)
            for field in ("x", "y", "z", "cos_incidence"):
                points[field] = rng.normal(size=count)
            points["object_idx"] = rng.integers(0, 2**32, count)
            points["object_tag"] = rng.integers(0, 29, count)
            made.append(({"counts": [count]}, memoryview(points.tobytes())))
        return made

    def bad_records(self) -> list[RawRecord]:
        meta, payload = self.records()[0]
        bad = np.frombuffer(payload, SEMANTIC_POINT).copy()
        bad["x"] = np.nan
        return [(meta, payload[:-4]), ({"counts": [4]}, payload), (meta, memoryview(bad.tobytes()))]

    def test_ids_stay_whole_numbers(self) -> None:
        _, payload = self.records()[1]
        points = self.codec().decode(self.codec().encode({}, payload))
        assert points["object_idx"].dtype == np.uint32
        assert (
            points["object_idx"].tobytes()
            == np.frombuffer(payload, SEMANTIC_POINT)["object_idx"].tobytes()
        )


class TestSemanticLidarBin(SemanticLidarCodecTests):
    name = "bin"


class TestSemanticLidarNpz(SemanticLidarCodecTests):
    name = "npz"
    empty_is_damage = True


class TestSweepBin(CodecTests):
    empty_is_damage = False

    def codec(self) -> Codec:
        return codec_for("sweeping_lidar", "bin")[1]

    def records(self) -> list[RawRecord]:
        random = np.random.default_rng(3)
        records = np.zeros(31, SEMANTIC_POINT)
        for name in ("x", "y", "z", "cos_incidence"):
            records[name] = random.normal(0, 30, 31)
        records["object_idx"], records["object_tag"] = random.integers(1, 100_000, (2, 31))
        records[-1:].view("<f4")[:] = [9.0, 0.5, -0.1, 0.01, -0.02, 0.3]
        return [
            ({"counts": [20, 10, 1]}, memoryview(records.tobytes())),
            ({"counts": [9, 0, 1]}, memoryview(records[-10:].tobytes())),
        ]

    def bad_records(self) -> list[RawRecord]:
        (meta, payload), (_, few) = self.records()
        nan = np.full(1, np.nan, "<f4").tobytes()
        return [
            (meta, payload[:-1]),
            (meta, few),
            ({"counts": [20, 11, 0]}, payload),
            (meta, memoryview(payload.tobytes()[:-4] + nan)),
            ({}, memoryview(b"")),
        ]

    def test_motion_is_undone_and_all_else_is_as_measured(self) -> None:
        meta, payload = self.records()[0]
        points = self.codec().raw_array(meta, payload)
        records = np.frombuffer(payload, SEMANTIC_POINT)[:-1]
        np.testing.assert_array_equal(points[:, SweepPoint.X_MEASURED], records["x"])
        np.testing.assert_array_equal(points[:, SweepPoint.INTENSITY], records["cos_incidence"])
        np.testing.assert_array_equal(points[:, SweepPoint.RING], records["object_tag"])
        np.testing.assert_allclose(points[:, SweepPoint.TIME], -1e-6 * records["object_idx"])
        still = np.frombuffer(payload, "<f4").reshape(-1, 6).copy()
        still[-1] = 0.0
        rested = self.codec().raw_array(meta, memoryview(still.tobytes()))
        np.testing.assert_array_equal(rested[:, :3], rested[:, SweepPoint.X_MEASURED :])


class TestSweepNpz(TestSweepBin):
    empty_is_damage = True

    def codec(self) -> Codec:
        return codec_for("sweeping_lidar", "npz")[1]


class TestRgbFpng(CameraCodecTests):
    kind = "rgb"
    name = "fpng"


class TestRgbJpeg(CameraCodecTests):
    kind = "rgb"
    name = "jpeg"
    tolerance = 4.0

    def records(self) -> list[RawRecord]:
        ramp = np.zeros((16, 32, 4), np.uint8)
        ramp[..., :3] = np.linspace(0, 200, 32).astype(np.uint8)[None, :, None]
        meta = {"width": 32, "height": 16}
        return [(meta, memoryview(ramp.tobytes())), (meta, memoryview(ramp[:, ::-1].tobytes()))]


class TestDepthPng(CameraCodecTests):
    kind = "depth"

    @pytest.mark.parametrize(
        ("bgra", "metres"),
        [
            ((0, 0, 0, 255), 0.0),
            ((255, 255, 255, 255), 1000.0),
            ((1, 0, 0, 7), 3.906250233),
            ((2, 143, 92, 255), 9.999991059),
        ],
    )
    def test_known_codes_decode_to_known_metres(self, bgra: tuple[int, ...], metres: float) -> None:
        codec = self.codec()
        contents = codec.encode({"width": 1, "height": 1}, memoryview(bytes(bgra)))
        assert codec.decode(contents)[0, 0] == pytest.approx(metres, rel=1e-7)


class DepthInMetresTests(CameraCodecTests):
    """Depths up to 500 m: centimetres in 16 bits end at 655 m."""

    kind = "depth"

    def records(self) -> list[RawRecord]:
        return [near(camera_record(5, 7, 0)), near(camera_record(3, 16, 1))]


def near(record: RawRecord) -> RawRecord:
    meta, payload = record
    bgra = np.frombuffer(payload, np.uint8).reshape(-1, 4).copy()
    bgra[:, 0] >>= 1
    return meta, memoryview(bgra.tobytes())


class TestDepthPng16(DepthInMetresTests):
    name = "png16"
    tolerance = 0.005

    def test_what_is_farther_than_the_scale_reads_as_its_end(self) -> None:
        contents = self.codec().encode({"width": 1, "height": 1}, memoryview(b"\xff\xff\xff\xff"))
        assert self.codec().decode(contents)[0, 0] == pytest.approx(655.35)


class TestDepthNpz(DepthInMetresTests):
    name = "npz"


class TestDepthNpz16(DepthInMetresTests):
    name = "npz16"
    tolerance = 0.2


class TestDepthExr(DepthInMetresTests):
    name = "exr"


class TestSemanticPng(CameraCodecTests):
    kind = "semantic"


class TestInstancePng(CameraCodecTests):
    kind = "instance"

    def test_the_documented_pixel_has_its_id_and_tag(self) -> None:
        codec = self.codec()  # (R, G, B) = (14, 49, 159): CARLA pull request 8334
        contents = codec.encode({"width": 1, "height": 1}, memoryview(bytes([159, 49, 14, 255])))
        assert codec.decode(contents)[0, 0].tolist() == [40753, 14]


class TestLidarBin(CodecTests):
    empty_is_damage = False

    def codec(self) -> Codec:
        return codec_for("lidar")[1]

    def records(self) -> list[RawRecord]:
        points = np.random.default_rng(0).normal(0, 30, (40, 4)).astype("<f4")
        return [
            ({"counts": [30, 10]}, memoryview(points.tobytes())),
            ({"counts": [20]}, memoryview(points[:20].tobytes())),
        ]

    def bad_records(self) -> list[RawRecord]:
        points = np.zeros((2, 4), "<f4")
        nan = np.full((2, 4), np.nan, "<f4")
        return [
            ({"counts": [2]}, memoryview(points.tobytes()[:-1])),
            ({"counts": [1]}, memoryview(points.tobytes())),
            ({"counts": [2]}, memoryview(nan.tobytes())),
            ({"counts": [2]}, memoryview(np.array([[1, 2, 3, np.inf], [-np.inf] * 4], "<f4"))),
        ]

    def test_numbers_are_finite_however_large(self) -> None:
        points = np.full((5, 4), 3e38, "<f4")
        (content,) = codec_for("lidar")[1].encode({}, memoryview(points.tobytes()))
        np.testing.assert_array_equal(codec_for("lidar")[1].decode((bytes(content),)), points)


class TestLidarNpz(TestLidarBin):
    empty_is_damage = True

    def codec(self) -> Codec:
        return codec_for("lidar", "npz")[1]


class TestLidarPly(TestLidarNpz):
    def codec(self) -> Codec:
        return codec_for("lidar", "ply")[1]


class TestLidarPcd(TestLidarNpz):
    def codec(self) -> Codec:
        return codec_for("lidar", "pcd")[1]


class TestLidarLaz(TestLidarNpz):
    tolerance = 0.001

    def codec(self) -> Codec:
        return codec_for("lidar", "laz")[1]

    def records(self) -> list[RawRecord]:
        points = np.random.default_rng(0).uniform(0, 1, (40, 4)).astype("<f4")
        points[:, :3] *= 80.0
        return [
            ({"counts": [30, 10]}, memoryview(points.tobytes())),
            ({"counts": [20]}, memoryview(points[:20].tobytes())),
        ]


def pixel_arrays() -> st.SearchStrategy[np.ndarray[Any, Any]]:
    sides = {"min_side": 1, "max_side": 20}
    grey = arrays.array_shapes(min_dims=2, max_dims=2, **sides)
    rgb = grey.map(lambda shape: (*shape, 3))
    return st.one_of(
        arrays.arrays(np.uint8, grey), arrays.arrays(np.uint8, rgb), arrays.arrays(np.uint16, grey)
    )


@given(image=pixel_arrays())
def test_packed_pixels_come_back_and_pillow_reads_them(image: np.ndarray[Any, Any]) -> None:
    content = PngPacker().pack(image)
    np.testing.assert_array_equal(unpack_png(content), image)
    with Image.open(io.BytesIO(content)) as picture:
        picture.verify()


@given(images=st.lists(pixel_arrays(), min_size=2, max_size=4))
def test_a_used_packer_packs_as_a_new_one(images: list[np.ndarray[Any, Any]]) -> None:
    packer = PngPacker()
    assert [packer.pack(image) for image in images] == [PngPacker().pack(i) for i in images]


@given(
    image=arrays.arrays(np.uint8, st.tuples(st.integers(1, 20), st.integers(1, 20), st.just(4))),
    aligned=st.booleans(),
)
def test_the_order_of_the_raw_record_packs_as_the_order_of_the_file(
    image: np.ndarray[Any, Any], aligned: bool
) -> None:
    if not aligned:
        content = memoryview(b"-" + image.tobytes())[1:]
        image = np.frombuffer(content, np.uint8).reshape(image.shape)
    packer = PngPacker()
    assert packer.pack_bgra(image) == packer.pack(np.ascontiguousarray(image[..., 2::-1]))


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((2, 2, 4), np.uint8),
        np.zeros((2, 2), np.float32),
        np.zeros((0, 2), np.uint8),
        np.zeros((2, 2, 4), np.uint16),
    ],
)
def test_what_is_no_png_of_ours_is_refused(image: np.ndarray[Any, Any]) -> None:
    with pytest.raises(ValueError, match="no PNG"):
        PngPacker().pack(image)


@pytest.mark.parametrize("shape", [(0, 2, 4), (2, 0, 4)])
def test_an_empty_picture_is_refused(shape: tuple[int, int, int]) -> None:
    with pytest.raises(ValueError, match="no PNG"):
        PngPacker().pack_bgra(np.zeros(shape, np.uint8))


def test_a_flipped_byte_in_the_pixels_is_damage_or_another_picture() -> None:
    image = np.random.default_rng(1).integers(0, 256, (16, 16, 3), dtype=np.uint8)
    content = bytearray(PngPacker().pack(image))
    content[len(content) // 2] ^= 0xFF
    try:
        pixels = unpack_png(bytes(content))
    except ValueError:
        return
    assert not np.array_equal(pixels, image)


@pytest.mark.parametrize("kind", KINDS)
def test_png_is_the_default_of_every_camera(kind: str) -> None:
    assert codec_names(kind)[0] == "png"
    assert codec_for(kind)[0] == "png"


def test_an_unknown_codec_is_bad_input_that_names_the_known_ones() -> None:
    with pytest.raises(BadInputError, match="jpeg"):
        codec_for("rgb", "gif")
    with pytest.raises(BadInputError, match="none"):
        codec_for("smell")
