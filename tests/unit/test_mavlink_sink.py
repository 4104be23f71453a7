"""Ranges and obstacles for an autopilot: what messages say, and that it gets them."""

import socket
import sys
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, reconstruct, write_capture
from reconstruction.capture import Optics
from reconstruction.cli import main
from reconstruction.depth import DISTANCES_M
from reconstruction.ranging import Ranges
from spisim_live import Loop, Reception
from spisim_live.links import Outlet
from spisim_live.mavlink.obstacles import sector_fields, spot_fields
from spisim_live.sinks import Detached, sink_to
from spisim_live.sinks.mavlink import MavlinkSink
from streams import Clock, Script, film, messages

UNKNOWN_CM = 2**16 - 1


@pytest.fixture
def result(capture):
    return reconstruct(capture, image="zero-filled", depth="nearest")


def with_ranges(result, **fields):
    """The result with other ranges of its four spots."""
    old = result.ranges
    usual = {"range_m": old.range_m, "sigma_m": old.sigma_m, "status": old.status}
    ranges = Ranges(
        **usual | fields,
        signal_electrons=old.signal_electrons,
        background_electrons=old.background_electrons,
    )
    return replace(result, rangings={"cw": ranges})


def test_a_spot_is_a_distance_sensor(result, capture):
    ranged = with_ranges(
        result,
        range_m=np.array([4.204, 10.0, 50.0, 700.0]),
        sigma_m=np.array([0.0, 0.1, 0.15, 3.0]),
        status=("ok", "ok", "weather prior", "ok"),
    )
    fields = spot_fields(ranged, capture.setup, 1234)
    assert [each["id"] for each in fields] == [0, 1, 2, 3]
    assert [each["current_distance"] for each in fields] == [420, 1000, 5000, UNKNOWN_CM]
    assert [each["covariance"] for each in fields] == [1, 100, 225, 255]
    assert [each["signal_quality"] for each in fields] == [100, 95, 99, 98]
    for each in fields:
        assert (each["time_boot_ms"], each["type"], each["orientation"]) == (1234, 0, 100)
        assert (each["min_distance"], each["max_distance"]) == (20, 4000)


@pytest.mark.parametrize(
    ("sigma_m", "quality"), [(0.05, 95), (0.1, 90), (0.25, 76), (0.5, 51), (1.0, 2), (9.0, 2)]
)
def test_quality_falls_with_sigma_over_range(result, capture, sigma_m, quality):
    ranged = with_ranges(
        result, range_m=np.full(4, 5.0), sigma_m=np.full(4, sigma_m), status=("ok",) * 4
    )
    reported = {each["signal_quality"] for each in spot_fields(ranged, capture.setup, 0)}
    # of 98 steps from 100 at no sigma to 2 at a fifth of the range
    assert reported == {quality}


@pytest.mark.parametrize(
    "status", ["fog", "weak", "no signal", "saturated", "ambiguous", "too close"]
)
def test_a_spot_without_a_range_is_invalid(result, capture, status):
    """With a distance below the least, which is none for readers that know no quality."""
    nothing = np.full(4, np.nan)
    fogged = with_ranges(result, range_m=nothing, sigma_m=nothing, status=(status,) * 4)
    for each in spot_fields(fogged, capture.setup, 0):
        assert (each["signal_quality"], each["covariance"]) == (1, 255)
        assert each["current_distance"] < each["min_distance"]


def test_quaternions_turn_forward_onto_the_spot(result, capture):
    for each, direction in zip(
        spot_fields(result, capture.setup, 0), capture.spots.directions, strict=True
    ):
        w, *v = each["quaternion"]
        forward = np.array([1.0, 0, 0])
        turned = forward + 2 * np.cross(v, np.cross(v, forward) + w * forward)
        right, down, ahead = direction
        assert turned == pytest.approx([ahead, right, down])


def mapped(result, capture, depth_m, tan_half=1.0, corridors=None):
    """Distances by sector of a depth map, with optics of that half field."""
    wide = replace(capture, optics=Optics(tan_half, tan_half))
    result = replace(
        result, depths={"nearest": np.asarray(depth_m, np.float32)}, corridors=corridors or {}
    )
    return sector_fields(result, wide.setup, 99)


def test_sectors_are_clockwise_about_straight_ahead(result, capture):
    depth_m = np.full((16, 16), 3.0)
    depth_m[:, 15] = 2.0  # on the right
    fields = mapped(result, capture, depth_m)
    distances = np.array(fields["distances"])
    assert (fields["increment_f"], fields["angle_offset"], fields["frame"]) == (5.0, 0.0, 12)
    assert fields["time_usec"] == 99
    assert distances.size == 72
    azimuths = np.degrees(np.arctan((2 * np.arange(16) - 15) / 16))
    seen = set((np.round(azimuths / 5).astype(int) % 72).tolist())
    assert set(np.flatnonzero(distances != UNKNOWN_CM).tolist()) == seen
    assert distances[9] == round(200 * np.hypot(15 / 16, 1))  # of the last column, at 43 degrees
    assert distances[0] == UNKNOWN_CM or distances[0] >= 300
    assert distances[63] == round(300 * np.hypot(15 / 16, 1))  # of the first, at -43 degrees


def test_a_sector_has_its_nearest_and_the_corridors_height_alone(result, capture):
    depth_m = np.full((16, 16), 5.0)
    depth_m[0] = 1.0  # 0.94 m above
    depth_m[8, 8] = 2.0  # 0.125 m below
    narrow = mapped(result, capture, depth_m)["distances"]
    ahead = np.round(np.degrees(np.arctan(1 / 16)) / 5).astype(int)
    assert narrow[ahead] == round(200 * np.hypot(1 / 16, 1))
    assert min(narrow) == narrow[ahead]


def test_what_is_not_known_is_unknown_and_what_is_far_is_none(result, capture):
    unknown = mapped(result, capture, np.full((16, 16), np.nan))
    assert set(unknown["distances"]) == {UNKNOWN_CM}
    far = mapped(result, capture, np.full((16, 16), 60.0), tan_half=0.001)
    assert set(far["distances"]) == {4001, UNKNOWN_CM}
    assert far["max_distance"] == 4000


def test_what_no_reading_excludes_is_in_the_way(result, capture):
    """A map says 4 m; a corridor blocked from 3 m on is nearer, with a map and without."""

    def blocked(direction):
        if abs(direction[0]) > 0.1:
            raise InputError("out of view")
        return np.where(DISTANCES_M < 3, 0.9, 0.1)

    corridors = {"nearest": blocked}
    far = np.full((16, 16), 4.0)
    assert mapped(result, capture, far)["distances"][1] >= 400
    seen = np.array(mapped(result, capture, far, corridors=corridors)["distances"])
    assert 250 < seen[0] < 310
    assert (seen[[71, 1]] == seen[0]).all()
    assert seen[3] >= 400
    alone = replace(result, depths={}, corridors=corridors)
    assert sector_fields(alone, capture.setup, 0)["distances"][0] == seen[0]


def test_without_ranges_or_a_map_nothing_is_said(result, capture):
    assert spot_fields(replace(result, rangings={}), capture.setup, 0) == []
    assert sector_fields(replace(result, depths={}, corridors={}), capture.setup, 0) is None
    assert sector_fields(result, replace(capture, optics=None).setup, 0) is None


@pytest.fixture
def common():
    return pytest.importorskip("pymavlink.dialects.v20.common")


class Kept(Outlet):
    """Keeps what is sent; cannot send while ``broken``."""

    def __init__(self):
        super().__init__("kept")
        self.contents, self.broken = [], False

    def send(self, content):
        if self.broken:
            raise OSError(101, "Network is unreachable")
        self.contents.append(content)


def fed(sink, content):
    """A sink after a stream of these messages."""
    clock = Clock()
    reception = Reception(Script(*content, clock=clock), clock=clock, waiting=1000)
    loop = Loop(reception, results=[sink.result], states=[sink.state], clock=clock)
    reception.run()
    loop.run()


def test_every_result_sends_its_messages_and_every_state_a_heartbeat(common, capture):
    clock, outlet = Clock(), Kept()
    sink = MavlinkSink(outlet, clock)
    clock.wait(2.5)
    fed(sink, messages(film(capture, 3)))
    codec = common.MAVLink(None)
    parsed = [each for content in outlet.contents for each in codec.parse_buffer(content)]
    kinds = [each.get_type() for each in parsed]
    assert kinds == [*(["DISTANCE_SENSOR"] * 4 + ["OBSTACLE_DISTANCE"]) * 3, "HEARTBEAT"]
    assert [each.get_seq() for each in parsed] == list(range(16))
    assert {each.get_srcComponent() for each in parsed} == {196}
    assert parsed[0].time_boot_ms == 2500
    assert parsed[4].time_usec == 2_500_000
    assert parsed[15].autopilot == common.MAV_AUTOPILOT_INVALID


def test_an_autopilot_receives_what_was_measured(common, capture, tmp_path, capsys):
    """Datagrams of the command, parsed by pymavlink."""
    capture = film(capture, 1)
    write_capture(capture, tmp_path / "flight.h5")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as pilot:
        pilot.bind(("127.0.0.1", 0))
        pilot.settimeout(30)
        to = f"mavlink:udpout:127.0.0.1:{pilot.getsockname()[1]}"
        options = ["--to", to, "--image", "zero-filled", "--quiet"]
        assert main(["live", str(tmp_path / "flight.h5"), *options]) == 0
        codec, heard = common.MAVLink(None), []
        while len(heard) < 5:
            heard += codec.parse_buffer(pilot.recv(2048)) or []
    assert capsys.readouterr().err == ""
    result = reconstruct(capture, image="zero-filled", depth="anchored")
    *spots, sectors = heard
    assert [each.current_distance for each in spots] == [420, 470, 430, 480]
    for each, direction in zip(spots, capture.spots.directions, strict=True):
        half = 2 * np.arccos(each.quaternion[0])
        assert half == pytest.approx(np.arccos(direction[2]), abs=1e-6)
    expected = sector_fields(result, capture.setup, 0)
    assert list(sectors.distances) == pytest.approx(expected["distances"], abs=1)
    assert (sectors.frame, sectors.increment_f) == (12, 5.0)
    assert sectors.min_distance <= min(sectors.distances) < 500


def test_a_broken_link_costs_its_messages_alone(common, capture):
    outlet = Kept()
    sink = Detached(MavlinkSink(outlet, Clock()), "mavlink:udpout:drone:1")
    sink.start()
    outlet.broken = True
    fed(sink, messages(film(capture, 3)))
    sink.close()
    assert sink.lost > 0
    assert not sink.failed  # nobody need listen
    assert "mavlink:udpout:drone:1: Network is unreachable" in sink.why


def test_wrong_names_of_sinks_say_what_is_allowed():
    for name, reason in [
        ("mavlink:", "unknown kind of MAVLink connection '': allowed: udpout, tcp, tcpin, /dev/"),
        ("mavlink:udpout:14550", "after udpout: comes HOST:PORT, as in udpout:192.168.0.10:14550"),
        ("mavlink:udpot:drone:14550", "did you mean 'udpout'"),
    ]:
        with pytest.raises(InputError) as refusal:
            sink_to(name)
        assert reason in str(refusal.value)
        assert str(refusal.value).startswith(name)


def test_without_pymavlink_the_sink_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymavlink.dialects.v20", None)
    missing = pytest.raises(InputError, match="MAVLink needs pymavlink: pip install")
    with missing, sink_to("mavlink:udpout:127.0.0.1:14550").ready():
        pass
