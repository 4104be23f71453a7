"""Pictures in Radiance's files, as lamps of all around have them."""

from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.base.config.linear import read_hdr_red
from spisim.scene import load_scene
from spisim.transport.backend import activate

HEAD = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n"


@pytest.fixture(autouse=True)
def scalar():
    before = activate()
    mi.set_variant("scalar_rgb")
    yield
    mi.set_variant(before)


@pytest.mark.parametrize("width", [5, 40])
def test_as_mitsuba_writes_it(tmp_path: Path, width: int) -> None:
    """Packed rows, and rows that are too short to be; a byte of red is the most that is lost."""
    red = np.random.default_rng(1).random((7, width)).astype(np.float32) * 30
    red[2:4, 3:] = 0.25
    mi.Bitmap(np.stack([red, red, red], axis=-1)).write(str(tmp_path / "a.hdr"))
    np.testing.assert_allclose(read_hdr_red(tmp_path / "a.hdr"), red, rtol=1 / 128)


PACKED = bytes([2, 2, 0, 8])
ROW = PACKED + bytes([136, 100]) + bytes([136, 0]) * 2 + bytes([136, 130])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "cannot be read"),
        (b"#?RADIANCE\n\n+Y 2 +X 8\n", "top row first"),
        (HEAD.replace(b"rgbe", b"xyze"), "XYZ"),
        (HEAD.replace(b"-Y 2", b"-Y 9999999"), "pixels; at most"),
        (HEAD + bytes(10), "truncated"),
        (HEAD + ROW, "truncated"),
        (HEAD + ROW + ROW[:-1], "truncated"),
        (HEAD + PACKED + bytes([0] * 40), "damaged"),
        (HEAD + PACKED + bytes([255, 1]) * 20, "damaged"),
    ],
)
def test_damaged(tmp_path: Path, data: bytes, message: str) -> None:
    (tmp_path / "a.hdr").write_bytes(data)
    with pytest.raises(InputError, match=rf"a\.hdr: .*{message}"):
        read_hdr_red(tmp_path / "a.hdr")


def test_in_a_scene_file(tmp_path: Path) -> None:
    """As seen from within: what is right in the picture is clockwise from above."""
    first = ROW.replace(bytes([136, 100]), bytes([1, 200, 135, 100]))
    (tmp_path / "hall.hdr").write_bytes(HEAD + first + ROW)
    (tmp_path / "s.yaml").write_text(
        "name: s\n"
        "drone: {position_m: [0, 0, 1], look_at_m: [1, 0, 1]}\n"
        "objects: [{name: wall, shape: box, size_m: [1, 1, 1], translate_m: [4, 0, 1],"
        " material: concrete}]\n"
        "lamps: [{name: e, type: environment, radiance_w_per_m2_sr: 1, picture: hall.hdr}]\n"
    )
    (lamp,) = load_scene(tmp_path / "s.yaml").lamps
    assert np.unravel_index(lamp.picture.argmax(), lamp.picture.shape) == (0, 7)
    assert lamp.picture[0, 7] == pytest.approx(200 / 256 * 4)
