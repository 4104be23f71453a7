"""Small files that stand for huge scenes: refused before time and memory are gone."""

import re
from pathlib import Path

import pytest

import hostile
from foreign import READERS, TRIANGLE, collada, glb, triangle_header
from reconstruction.base.errors import InputError
from spisim_formats.library.files import Folders


def refused(file: Path, message: str) -> None:
    def attack(_: int) -> None:
        with pytest.raises(InputError, match=message) as reported:
            READERS[file.suffix](file, Folders.around(file))
        assert "\n" not in str(reported.value)

    hostile.survive(attack, [0], readable=[file.parent])


@pytest.mark.parametrize("leaf", ['<instance_geometry url="#g"/>', ""], ids=["mesh", "nothing"])
def test_collada_nodes_that_double(tmp_path: Path, leaf: str) -> None:
    """2^30 nodes, whether or not they show anything."""
    twice = '<instance_node url="#n{0}"/><instance_node url="#n{0}"/>'
    nodes = f'<node id="n0">{leaf}</node>' + "".join(
        f'<node id="n{k + 1}">{twice.format(k)}</node>' for k in range(30)
    )
    library = f"<library_nodes>{nodes}</library_nodes><library_visual_scenes>"
    text = collada().replace("<library_visual_scenes>", library)
    text = re.sub('(<node id="a" name="first">).*?</node>', rf"\1{twice.format(30)}</node>", text,
                  flags=re.DOTALL)  # fmt: skip
    (tmp_path / "a.dae").write_text(text)
    refused(tmp_path / "a.dae", "more than (200,000 nodes|100,000 parts)")


def test_sdf_frames_in_a_long_chain(tmp_path: Path) -> None:
    frames = "".join(
        f"<frame name='f{k}'><pose relative_to='f{k - 1}'>0 0 1 0 0 0</pose></frame>"
        for k in range(1, 3000)
    )
    text = f"<sdf version='1.9'><world name='w'><frame name='f0'/>{frames}<model name='m'>"
    text += "<pose relative_to='f2999'>0 0 0 0 0 0</pose></model></world></sdf>"
    (tmp_path / "a.sdf").write_text(text)
    refused(tmp_path / "a.sdf", "relative to one another more than 200 deep")


def test_gltf_meshes_in_many_nodes(tmp_path: Path) -> None:
    nodes = [{"mesh": 0}] * 100_001
    header = triangle_header(nodes=nodes, scenes=[{"nodes": list(range(len(nodes)))}])
    (tmp_path / "a.glb").write_bytes(glb(header, TRIANGLE))
    refused(tmp_path / "a.glb", "more than 100,000 parts")
