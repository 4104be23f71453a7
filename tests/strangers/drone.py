"""A drone's first hour: a simulated one flies, a receiver makes depth of its stream, keeps it and
sends it again, and a client of ROS 2 reads what was recorded.

Run in an empty folder, with `spisim[ros]` and `mcap-ros2-support` installed. Prints what it found,
and ends with an error where a step did not do what the documentation says.
"""

# needs: spisim[ros], mcap-ros2-support

import json
import math
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader

SECONDS = 2
MEGABYTE = 1e6


def main():
    """Serve, live, log, replay, MCAP, ROS."""
    served, sent = fly_and_receive(f"127.0.0.1:{free_port()}")
    print(f"flown: {served['frames']} frames, of which {sent['reconstructed']} were reconstructed")
    logged = [json.loads(line) for line in Path("log.jsonl").read_text().splitlines()]
    logged = [line for line in logged if "range_m" in line]
    assert len(logged) == sent["reconstructed"]

    again = replay(f"127.0.0.1:{free_port()}")
    print(f"sent again from flight.h5: {again['received']} frames")

    for name in ("live.mcap", "again.mcap"):
        ranges, depths, clouds = read_by_ros(Path(name))
        print(f"{name}: {len(ranges)} ranges of spot 0, {len(depths)} depth maps")
        assert len(depths) == len(clouds) > 0
        assert Path(name).stat().st_size < SECONDS * MEGABYTE
        for depth_m, (z_m, _) in zip(depths, clouds, strict=True):
            assert np.array_equal(depth_m, z_m, equal_nan=True)
    compare_with_truth(read_by_ros(Path("live.mcap"))[0], logged)


def fly_and_receive(address):
    """A flight along a path through the warehouse, as if it were a rig, and its receiver."""
    drone = start(
        *("spisim", "serve", "warehouse", "--path", "warehouse-flight", "--light", "surrogate"),
        *("--duration", SECONDS, "--to", f"tcp-listen://{address}", "--record", "truth.h5"),
        "--json",
    )
    sinks = ("latest", "flight.h5", "flight.stream", "log.jsonl", "live.mcap")
    receiver = start(
        *("reconstruction", "live", f"tcp://{address}", "--quiet", "--json"),
        *(word for sink in sinks for word in ("--to", sink)),
    )
    reported = finished(drone), finished(receiver)
    assert all(Path(sink).exists() for sink in sinks)
    return reported


def replay(address):
    """The capture that was kept, sent to another receiver."""
    receiver = start(
        *("reconstruction", "live", f"tcp-listen://{address}", "--to", "again.mcap"),
        *("--quiet", "--json"),
    )
    sender = start("reconstruction", "replay", "flight.h5", "--to", f"tcp://{address}", "--json")
    sent, received = finished(sender), finished(receiver)
    assert sent["frames"] == received["received"] + received["lost"]
    return received


def read_by_ros(path):
    """Ranges of spot 0, depth maps, and of clouds z and intensity, by two readers that agree."""
    with AnyReader([path]) as reader:
        count = {each.topic: each.msgcount for each in reader.connections}
    messages = {}
    for each in read_ros2_messages(str(path)):
        messages.setdefault(each.channel.topic, []).append(each.ros_msg)
    assert {topic: len(each) for topic, each in messages.items()} == count
    ranges = [each.range for each in messages["/camera/spot_0/range"]]
    depths = [
        np.frombuffer(bytes(each.data), "<f4").reshape(each.height, each.width)
        for each in messages["/camera/depth/image_rect"]
    ]
    clouds = []
    for each in messages["/camera/points"]:
        fields = np.dtype([(field.name, "<f4") for field in each.fields])
        points = np.frombuffer(bytes(each.data), fields).reshape(each.height, each.width)
        clouds.append((points["z"], points["intensity"]))
    return ranges, depths, clouds


def compare_with_truth(ranges, logged):
    """Messages tell what the log has, and both are near what was there."""
    reported = [line["range_m"][0] for line in logged]
    assert len(ranges) == len(reported)
    for message, line in zip(ranges, reported, strict=True):
        ranged = line is not None and math.isfinite(line)
        assert math.isclose(message, line, rel_tol=1e-6) if ranged else not message > 0
    print(f"of {len(ranges)} messages {np.isfinite(ranges).sum()} hold a range")
    evaluation = finished(start("spisim", "evaluate", "truth.h5", "--json"))
    spots = next(iter(evaluation["spots"].values()))
    off = [abs(spot["error_m"]) / spot["sigma_m"] for spot in spots if spot["error_m"] is not None]
    print(f"errors of the first frame's ranges, in sigmas: {np.round(off, 1)}")
    assert off
    assert max(off) < 6


def start(module, *words):
    """A command of one of the two packages."""
    command = [sys.executable, "-m", module, *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def finished(process):
    """What it printed as JSON."""
    reported, _ = process.communicate(timeout=300)
    assert process.returncode == 0, f"{' '.join(process.args[2:5])} ended with {process.returncode}"
    return json.loads(reported)


def free_port():
    """A port that nobody listens on."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return free.getsockname()[1]


if __name__ == "__main__":
    main()
