"""Writers of captures in other languages, as the page on the format prints them."""

import shutil
import subprocess

import numpy as np
import pytest

from pages import ROOT, blocks
from reconstruction import read_capture, reconstruct
from waiting import SAFETY_S

PAGE = ROOT / "docs" / "reference" / "capture-format.md"
PRINTED = {block.title: block.text for block in blocks(PAGE)}
INCLUDES = ["-I/usr/include/hdf5/serial", "-L/usr/lib/x86_64-linux-gnu/hdf5/serial"]
#: A quarter of a period of 15 MHz there and back.
RANGE_M = 299_792_458 / 15e6 / 8


def tried(*command, cwd):
    return subprocess.run(
        command, cwd=cwd, capture_output=True, text=True, check=False, timeout=SAFETY_S
    )


def check(file):
    capture = read_capture(file)
    assert capture.plan.shape == (32, 32)
    assert capture.buckets.counts.shape == (2, 1024)
    assert capture.buckets.counts[1, 1] == 1025 * 37 % 101 - 50
    result = reconstruct(capture)
    assert result.image.shape == (32, 32)
    np.testing.assert_allclose(result.ranges.range_m, RANGE_M, rtol=1e-3)


@pytest.mark.slow
def test_the_writer_in_cpp_writes_what_is_read(tmp_path):
    if shutil.which("g++") is None:
        pytest.skip("there is no g++")
    (tmp_path / "writer.cpp").write_text(PRINTED["writer.cpp"])
    (tmp_path / "probe.cpp").write_text("#include <hdf5.h>")
    probe = tried("g++", *INCLUDES, "-E", "probe.cpp", cwd=tmp_path)
    if probe.returncode:
        pytest.skip("there is no libhdf5-dev")
    strict = ["-std=c++17", "-Wall", "-Wextra", "-Werror"]
    built = tried("g++", *strict, *INCLUDES, "writer.cpp", "-o", "writer", "-lhdf5", cwd=tmp_path)
    assert built.returncode == 0, built.stderr
    done = tried("./writer", "rig.h5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    check(tmp_path / "rig.h5")


OCTAVE = """
k = (0:2047)'; counts = mod(k * 37, 101) - 50; counts([1 1025]) = 40000;
taps = repmat([1000; 1500; 1000; 500], [1 4 2]);
a = sqrt(1 - 2 * 0.08 ^ 2); d = 0.08 * [-1 1 -1 1; -1 -1 1 1; 0 0 0 0]; d(3, :) = a;
write_capture('rig.h5', reshape(counts, 1024, 2), (0:1023)', taps, d);
"""


@pytest.mark.slow
def test_the_writer_in_matlab_writes_what_is_read(tmp_path):
    if shutil.which("octave-cli") is None or shutil.which("mkoctfile") is None:
        pytest.skip("there is no Octave, or no mkoctfile")
    (tmp_path / "write_capture.m").write_text(PRINTED["write_capture.m"])
    functions = ROOT / "tests" / "data" / "octave_hdf5.cc"
    made = tried("mkoctfile", *INCLUDES, "-lhdf5", "-o", "octave_hdf5.oct", functions, cwd=tmp_path)
    if made.returncode:
        pytest.skip("there is no libhdf5-dev, or no liboctave-dev")
    names = "h5create", "h5write", "h5writeatt"
    load = "".join(f"autoload('{name}', [pwd '/octave_hdf5.oct']);" for name in names)
    done = tried("octave-cli", "--no-init-file", "--eval", load + OCTAVE, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    check(tmp_path / "rig.h5")
