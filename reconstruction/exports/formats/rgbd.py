"""RGB-D sequence in the layout of the TUM and Redwood benchmarks.

Folders ``rgb`` and ``depth`` with PNG files of the same name per frame; ``rgb.txt``, ``depth.txt``,
``associations.txt`` and ``groundtruth.txt`` with times as in the TUM RGB-D benchmark;
``camera_intrinsic.json`` for Open3D. Depth is along the optical axis in millimetres, 16 bits, 0 if
unknown (as Redwood; TUM's unit is 0.2 mm). Cf. J. Sturm et al., "A benchmark for the evaluation of
RGB-D SLAM systems", IROS 2012; S. Choi et al., CVPR 2015.
"""

from collections.abc import Iterable
from pathlib import Path

from ...base.files import mark
from ...base.text import json_line
from ..export import KIND, Export
from ..pictures import colour_png, depth_png, require_depths
from ..poses import COLUMNS, quaternion_of
from ..shot import Shot


def write_rgbd(shots: Iterable[Shot], folder: Path) -> None:
    """Write a sequence into an empty folder; raises InputError without any depth map."""
    for name in ("rgb", "depth"):
        (folder / name).mkdir(parents=True)
    lists: dict[str, list[str]] = {"rgb.txt": ["# timestamp filename"]}
    lists["depth.txt"] = ["# timestamp filename"]
    lists["associations.txt"] = ["# timestamp rgb timestamp depth"]
    lists["groundtruth.txt"] = [f"# {' '.join(COLUMNS)} of the optical frame"]
    number, depth_maps = 0, 0
    for number, shot in enumerate(shots, 1):
        name, stamp = f"{number - 1:06d}.png", f"{shot.stamp_s:.6f}"
        if number == 1:
            (folder / "camera_intrinsic.json").write_bytes(intrinsics_json(shot))
        (folder / "rgb" / name).write_bytes(colour_png(shot.image))
        (folder / "depth" / name).write_bytes(depth_png(shot.depth_m, shot.shape))
        depth_maps += shot.depth_m is not None
        lists["rgb.txt"].append(f"{stamp} rgb/{name}")
        lists["depth.txt"].append(f"{stamp} depth/{name}")
        lists["associations.txt"].append(f"{stamp} rgb/{name} {stamp} depth/{name}")
        if shot.pose is not None:
            numbers = (*shot.pose[:3, 3], *quaternion_of(shot.pose[:3, :3]))
            lists["groundtruth.txt"].append(f"{stamp} {' '.join(f'{x:.9g}' for x in numbers)}")
    require_depths(depth_maps, number)
    for name, lines in lists.items():
        if len(lines) > 1:
            text = "\n".join([f"# {mark(KIND)}", *lines, ""])
            (folder / name).write_text(text, encoding="ascii")


def intrinsics_json(shot: Shot) -> bytes:
    """Open3D's PinholeCameraIntrinsic, whose matrix is stored by column."""
    height, width = shot.shape
    columns = shot.intrinsics.matrix.T.ravel().tolist()
    fields = {"width": width, "height": height, "intrinsic_matrix": columns, "made": mark(KIND)}
    return json_line(fields).encode() + b"\n"


EXPORT = Export("RGB-D sequence, TUM and Redwood: PNG, 16-bit depth in mm, intrinsics", write_rgbd)
