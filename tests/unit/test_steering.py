"""Mirrors that steer the spots: modes, errors, what is refused, light, ranges and eye safety."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from pydantic import ValidationError

from fogs import light as light_in_fog
from hdf5files import changed as changed_file
from instruments import changed
from reconstruction import Reconstructor, read_capture, read_result, write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture.schema import between, joined
from reconstruction.depth import pixel_of
from reconstruction.exports.shot import Shot
from reconstruction.outputs.result_file import result_bytes
from reconstruction.ranging import RANGING_METHODS, Alternative, Ranges, measure_ranges
from reconstruction.ranging.fog.offsets import path_check
from reconstruction.ranging.ranges import redirected
from spisim import simulate
from spisim.atmosphere import CLEAR
from spisim.budget.eye_safety import laser_safety
from spisim.instrument import load_instrument
from spisim.instrument.aims.least_sure import least_sure
from spisim.instrument.steering import directions
from spisim.scene import Ambient, Scene
from spisim.simulation.light import LightSequence, solve, solve_spots, steered_light
from spisim_app.report.pictures import spot_marks
from spisim_app.report.space import Space
from spisim_live.ros.messages import frame_messages, static_messages
from spisim_live.setups import StreamSetup, frame_payload, setup_payload
from worlds import ORIGIN, plane

HOME_DEG = np.array([[-5, 5], [5, 5], [-5, -5], [5, -5]], float)
FREE = {"half_range_deg": [4, 3]}
SEED, WALL_M = 7, 4.0
WALL = Scene("wall", (plane(WALL_M),), CLEAR, Ambient(sky_klx=1.0), drone_pose=ORIGIN)


def steered(name="paper-steered", **steering):
    return changed(name, lasers__steering=FREE | steering)


def offsets(frames, mirrors="common", **steering):
    mirror = steered(mirrors=mirrors, **steering).lasers.steering
    count = 4 if mirrors == "each" else 1
    return np.array([mirror.offsets(frame, count) for frame in range(frames)])


# Modes


def test_a_raster_goes_row_by_row_to_and_fro_through_the_middle_of_each_cell():
    went = offsets(13, mode="raster", shape=[3, 4])[:, 0]
    x, y = np.array([-3, -1, 1, 3.0]), [2, 0, -2]
    expected = [(a, y[0]) for a in x] + [(a, y[1]) for a in x[::-1]] + [(a, y[2]) for a in x]
    np.testing.assert_allclose(went, [*expected, expected[0]], atol=1e-12)


def test_a_list_repeats_and_mirrors_at_rest_do_not_move():
    given = [[[1, 2]], [[-1, 0.5]], [[0, 0]]]
    np.testing.assert_array_equal(offsets(6, mode="list", offsets_deg=given), given * 2)
    assert not offsets(3, mode="fixed").any()
    assert not offsets(1, mode="adaptive").any()


@pytest.mark.parametrize(
    ("cycles", "period"),
    [
        ([0.25, 0.125], 8),  # repeats
        ([1 / 3 + 1e-4, 0.1], 3334),  # three frames
        ([0.2113, 0.3171], 3334),  # three cycles across are nearly two upwards
    ],
)
def test_a_lissajous_is_seen_whole_after_its_slowest_beat(cycles, period):
    mirror = steered(mode="lissajous", cycles_per_frame=cycles).lasers.steering
    assert mirror.period == period


def test_lissajous_is_a_sine_each_way():
    went = offsets(9, mode="lissajous", cycles_per_frame=[0.125, 0.25])[:, 0]
    turns = np.arange(9) / 8
    expected = np.stack([4 * np.sin(2 * np.pi * turns), 3 * np.sin(4 * np.pi * turns)], axis=1)
    np.testing.assert_allclose(went, expected, atol=1e-12)


def test_random_fills_the_range_evenly_and_by_its_seed():
    went = offsets(256, "each", mode="random", seed=3)
    assert (np.abs(went) <= FREE["half_range_deg"]).all()
    for mirror in range(4):
        counts = np.histogram2d(*went[:, mirror].T, bins=4, range=[[-4, 4], [-3, 3]])[0]
        assert np.abs(counts - 16).max() <= 6  # independent ones: by 4 rms, 12 at most
        assert counts.std() < 3
    assert len(np.unique(went[0], axis=0)) == 4
    assert np.array_equal(went, offsets(256, "each", mode="random", seed=3))
    assert not np.array_equal(went, offsets(256, "each", mode="random", seed=4))


def test_one_mirror_turns_all_spots_by_the_same_angles():
    mirror = steered(mode="random").lasers.steering
    true = mirror.pointing(HOME_DEG, 5, SEED).true[0]
    angles = np.degrees([np.arctan2(true[:, 0], true[:, 2]), np.arcsin(-true[:, 1])]).T
    np.testing.assert_allclose(np.ptp(angles - HOME_DEG, axis=0), 0, atol=1e-12)


def test_spots_go_where_the_map_is_least_sure_and_keep_apart():
    peak = np.array([1.0, 2.0])

    def doubt(angles_deg):
        return np.exp(-np.sum((angles_deg - peak) ** 2, axis=-1))

    went = HOME_DEG + least_sure(doubt, HOME_DEG[:, None], (8.0, 8.0), 1.5)
    apart = np.linalg.norm(went[:, None] - went, axis=-1)
    assert apart[np.triu_indices(4, 1)].min() >= 1.5
    assert np.abs(went[0] - peak).max() <= 0.25  # half a step of the candidates
    away = np.linalg.norm(went - peak, axis=1)
    assert (away[1:] < 3.0).all()
    (together,) = least_sure(lambda angles: doubt(angles - HOME_DEG), HOME_DEG[None], (4, 4), 9.0)
    assert np.abs(together - peak).max() <= 0.125


# Errors of the mirrors


def test_jitter_and_reading_errors_scatter_as_stated():
    mirror = steered(
        mode="fixed", mirrors="each", jitter_mrad=2.0, reading_sigma_mrad=0.5,
        reading_bias_mrad=[3.0, -1.0],
    ).lasers.steering  # fmt: skip
    every = [mirror.pointing(HOME_DEG, frame, SEED) for frame in range(300)]
    true, read = (np.concatenate(each) for each in zip(*every, strict=True))
    np.testing.assert_allclose(np.linalg.norm([true, read], axis=-1), 1)

    def angles(unit):
        azimuth, elevation = np.arctan2(unit[..., 0], unit[..., 2]), np.arcsin(-unit[..., 1])
        return 1e3 * np.stack([azimuth, elevation], axis=-1)  # mrad

    for error, sigma, bias in (
        (angles(true) - 1e3 * np.radians(HOME_DEG), 2.0, [0, 0]),
        (angles(read) - angles(true), 0.5, [3.0, -1.0]),
    ):
        count = error[..., 0].size
        z = (error.mean(axis=(0, 1)) - bias) / (sigma / np.sqrt(count))
        assert np.abs(z).max() < 4
        spread = error.std(axis=(0, 1)) / sigma - 1
        assert np.abs(spread).max() < 4 / np.sqrt(2 * count)
    again = mirror.pointing(HOME_DEG, 17, SEED)
    assert np.array_equal(again.read[0], read[17])
    assert not np.array_equal(mirror.pointing(HOME_DEG, 17, SEED + 1).read[0], read[17])


# Refused


@pytest.mark.parametrize(
    ("steering", "said"),
    [
        ({"mode": "random", "half_range_deg": [0, 3]}, "half_range_deg"),
        ({"mode": "random", "half_range_deg": [4]}, "half_range_deg"),
        ({"mode": "random", "half_range_deg": [4, 70]}, "half_range_deg"),
        ({"mode": "spiral"}, "spiral"),
        ({"mode": "random", "shape": [2, 2]}, "shape"),
        ({"mode": "raster"}, "shape"),
        ({"mode": "raster", "shape": [0, 2]}, "shape"),
        ({"mode": "list", "offsets_deg": []}, "offsets_deg"),
        (
            {"mode": "list", "offsets_deg": [[[1, 1]], [[1, 1], [2, 2]]]},
            "frame 1 has 2 pairs of angles for 1 mirror",
        ),
        ({"mode": "list", "mirrors": "each", "offsets_deg": [[[1, 1]]]}, "1 pairs .* 4 mirror"),
        ({"mode": "list", "offsets_deg": [[[1, -3.1]]]}, r"frame 0 has \[\[1.0, -3.1\]\], beyond"),
        (
            {"mode": "list", "mirrors": "each", "half_range_deg": [5, 5],
             "offsets_deg": [[[5, 0], [-4.5, 0], [0, 0], [0, 0]]]},
            "spots 0 and 1 meet: they come within 0.5°",
        ),
        ({"mode": "random", "mirrors": "each", "half_range_deg": [4.5, 4.5]}, "0 and 1 meet"),
        ({"mode": "adaptive", "mirrors": "each", "half_range_deg": [8, 8], "apart_deg": 1.0},
         "0 and 1 meet"),
        ({"mode": "adaptive", "method": "most-sure"}, "most-sure"),
        ({"mode": "fixed", "jitter_mrad": -1}, "jitter_mrad"),
        ({"mode": "fixed", "settling_time_s": 2e-3}, "0.002 .* longer than a frame"),
    ],
)  # fmt: skip
def test_steering_that_cannot_be_is_refused_by_name(steering, said):
    with pytest.raises((ValidationError, InputError), match=f"(?s){said}"):
        steered(**steering)


def test_spots_that_do_not_come_nearer_may_see_each_other_as_they_do_at_rest():
    wide = {"tof__detector__field_of_view_deg": 16.0}  # neighbours are 10° apart
    for steering in (
        {"mode": "random"}, {"mode": "fixed", "mirrors": "each"},
        {"mode": "list", "mirrors": "each", "offsets_deg": [[[-1, 1], [1, 1], [-1, -1], [1, -1]]]},
    ):  # fmt: skip
        changed("paper-steered", lasers__steering=FREE | steering, **wide)
    nearer = {"mode": "list", "mirrors": "each", "offsets_deg": [[[1, 0]] * 3 + [[0.5, 0]]]}
    with pytest.raises(ValidationError, match=r"mirrors let spots 0 and 3 meet: .* 13\.8°"):
        changed("paper-steered", lasers__steering=FREE | nearer, **wide)


def test_beams_stay_in_front_and_in_a_shared_field():
    shared = {
        "tof__detector__positions_m": [[0.01, 0, 0]], "tof__detector__field_of_view_deg": 20.0,
        "tof__periods": 20000,
    }  # fmt: skip
    scan = FREE | {"mode": "random"}
    inside = scan | {"half_range_deg": [1.5, 1.5]}
    whole = changed("paper-steered", lasers__steering=inside, **shared)
    aimed = whole.aimed(directions(HOME_DEG + 1.0))
    assert np.array_equal(aimed.ranging.detector_axes, np.tile([0.0, 0, 1], (4, 1)))
    with pytest.raises(ValidationError, match="off the axis of the shared detector"):
        changed("paper-steered", lasers__steering=scan | {"half_range_deg": [3, 3]}, **shared)
    sideways = HOME_DEG + np.array([80.0, 0.0])
    with pytest.raises(ValidationError, match=r"half_range_deg .* turns a spot by 90"):
        changed("paper-steered", lasers__directions_deg=sideways.tolist(), lasers__steering=scan
                | {"half_range_deg": [5, 5]})  # fmt: skip


# Captures


@cache
def recorded(name="fog-steered", frames=3):
    return simulate(WALL, load_instrument(name), light="surrogate", seed=SEED, frames=frames)


def test_truth_is_along_the_true_directions_and_what_is_read_has_errors():
    capture = recorded().capture
    assert not capture.truth.still
    mirror = load_instrument("fog-steered").lasers.steering
    for frame in range(3):
        pointing = mirror.pointing(HOME_DEG, frame, SEED)
        assert np.array_equal(capture.spots.pointing[frame], pointing.read[0])
        along = WALL_M / pointing.true[0, :, 2]
        np.testing.assert_allclose(capture.truth.at(frame).spot_range_m, along, rtol=1e-6)
    np.testing.assert_allclose(capture.spots.directions, directions(HOME_DEG))


def test_light_of_the_image_is_that_of_fixed_spots():
    steering = load_instrument("fog-steered")
    fixed = steering.aimed(steering.lasers.directions)
    one, other = (
        simulate(WALL, each, light="surrogate", seed=SEED, frames=2).capture
        for each in (steering, fixed)
    )
    assert np.array_equal(one.buckets.counts, other.buckets.counts)
    assert one.spots.pointing is not None
    assert other.spots.pointing is None


def test_spots_solved_alone_are_those_solved_with_the_image():
    instrument = load_instrument("fog")
    whole = solve(WALL, instrument, spp=1, seed=SEED)
    aside = solve_spots(WALL, instrument, directions(HOME_DEG + 2), whole, spp=1, seed=SEED)
    back = solve_spots(WALL, instrument, instrument.lasers.directions, aside, spp=1, seed=SEED)
    # Angles turn into directions and back: equal but for rounding, as rays are of single precision.
    np.testing.assert_allclose(back.spot_histogram.sum(axis=1), whole.spot_histogram.sum(axis=1),
                               rtol=1e-4)  # fmt: skip
    assert not np.allclose(aside.spot_histogram.sum(axis=1), whole.spot_histogram.sum(axis=1),
                           rtol=1e-3)  # fmt: skip
    assert back.image is whole.image
    assert np.array_equal(back.spot_daylight_w, whole.spot_daylight_w)


def test_a_moving_scene_is_solved_in_the_middle_of_parts_of_a_frame():
    instrument = load_instrument("fog-steered")

    class Moving(Scene):
        moves = True

        def at(self, time_s):
            return time_s

    light = solve(WALL, instrument, spp=1, seed=SEED)
    base = LightSequence(np.linspace(0, 2, 5) * instrument.frame_time_s, (light,) * 5)
    times, seen = [], []

    def spots(instant, instrument, at, other, *, seed):
        times.append(instant / instrument.frame_time_s)
        seen.append(at)
        return replace(other, spot_histogram=np.full((4, 1), float(len(times))),
                       path_length_m=np.ones(1))  # fmt: skip

    moving = object.__new__(Moving)
    result = steered_light(moving, instrument, base, spots, frames=2, seed=SEED)
    np.testing.assert_allclose(times, [0.25, 0.75, 1.25, 1.75])
    assert np.array_equal(seen[0], seen[1])
    assert not np.array_equal(seen[1], seen[2])
    values = np.array([each.spot_histogram for each in result.light.transports])
    for part, means in (((0.0, 1.0), [1.5, 3.5]), ((0.5, 1.0), [2.0, 4.0])):
        np.testing.assert_allclose(result.light.during(2, *part).means(values)[:, 0, 0], means)


def test_files_and_streams_hold_the_directions_of_each_frame(tmp_path):
    capture, path = recorded().capture, tmp_path / "steered.h5"
    write_capture(capture, path)
    copy = read_capture(path)
    assert np.array_equal(copy.spots.pointing, capture.spots.pointing)
    stream = StreamSetup(setup_payload(copy.setup))
    frame = stream.frames(frame_payload(copy.frame(2)), 2)
    assert np.array_equal(frame.spots.pointing, capture.spots.pointing[2:])
    whole = joined([capture.frame(number).spots for number in range(3)])
    assert np.array_equal(whole.pointing, capture.spots.pointing)
    turned = replace(capture.spots, pointing=capture.spots.pointing[::-1])
    assert replace(capture, spots=turned).frame(0).digest(capture.setup) != capture.frame(0).digest(
        capture.setup
    )


def test_files_of_fixed_spots_have_no_directions_of_frames(tmp_path):
    capture, path = recorded().capture, tmp_path / "fixed.h5"
    write_capture(replace(capture, spots=replace(capture.spots, pointing=None)), path)
    with changed_file(path) as file:
        assert "pointing" not in file["spots"]
        file.attrs["version"] = np.bytes_("3.3")
    assert read_capture(path).spots.pointing is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda at: 1.01 * at, "spots/pointing must be unit vectors"),
        (lambda at: at * [1, 1, -1], "point forward"),
        (lambda at: np.where(at > 0.9, np.nan, at), "spots/pointing holds values"),
        (lambda at: at[:2], r"spots/pointing has shape \(2, 4, 3\)"),
        (lambda at: at[:, :3], r"spots/pointing has shape \(3, 3, 3\)"),
    ],
)
def test_directions_of_frames_that_cannot_be_are_refused(change, said, tmp_path):
    spots = recorded().capture.spots
    with pytest.raises(InputError, match=said):
        replace(recorded().capture, spots=replace(spots, pointing=change(spots.pointing)))


# Reconstruction


def test_ranges_and_maps_follow_the_directions_of_the_frame():
    capture = recorded().capture
    reconstruct = Reconstructor(
        capture.setup, ranging=["fog", "cw"], depth=["nearest", "anchored", "inverse-distance"]
    )
    rotated = replace(capture.spots, pointing=capture.spots.pointing[[1, 1, 1]])
    for number in range(3):
        result = reconstruct(capture.frame(number))
        at = capture.spots.pointing[number]
        assert np.array_equal(result.spot_directions, at)
        true_m = capture.truth.at(number).spot_range_m
        for ranges in result.rangings.values():
            z = (ranges.range_m - true_m) / np.hypot(ranges.sigma_m, 1e-3)
            assert np.abs(z).max() < 4
        rows, columns = np.round(pixel_of(at, capture.optics, capture.plan.shape)).astype(int).T
        nearest = result.depths["nearest"][rows, columns]
        stretch = result.range_over_depth[rows, columns]
        np.testing.assert_allclose(nearest * stretch, result.ranges.range_m, rtol=1e-6)
        aimed = result.aimed(capture.setup)
        assert np.array_equal(aimed.spots.directions, at)
        marks = np.array(spot_marks(aimed))[:, [2, 1]]  # in per cent from the top, and the left
        middle = 100 * (pixel_of(at, capture.optics, (1, 1)) + 0.5)
        np.testing.assert_allclose(marks, middle)
        shown = np.array([spot["at"] for spot in Space.of(capture, result).spots])
        np.testing.assert_allclose(shown, at * result.ranges.range_m[:, None], atol=1e-4)
    elsewhere = reconstruct(replace(capture, spots=rotated).frame(0))
    assert not np.array_equal(elsewhere.depths["nearest"], reconstruct(capture.frame(0)).depths[
        "nearest"])  # fmt: skip


def test_frames_of_steered_spots_move_in_recordings_of_robots():
    capture = recorded().capture
    result = Reconstructor(capture.setup, depth=())(capture.frame(1))
    shot = Shot.of(result, capture.setup, 0)
    fixed = replace(capture.setup, spots=replace(capture.setup.spots, pointing=None))

    def children(messages, topic):
        tf = [each for each in messages if each.topic == topic]
        return {each["child_frame_id"]: each for one in tf for each in one.fields["transforms"]}

    moving = children(frame_messages(shot), "/tf")
    assert set(moving) == {f"spot_{k}" for k in range(4)}
    assert not moving.keys() & children(static_messages(shot), "/tf_static").keys()
    still = children(static_messages(Shot.of(result, fixed, 0)), "/tf_static")
    assert moving.keys() <= still.keys()
    assert moving["spot_0"]["transform"] != still["spot_0"]["transform"]


def test_detectors_of_their_own_follow_and_shared_ones_stay():
    spots = recorded().capture.spots
    assert np.array_equal(spots.aimed.detector_axes, spots.pointing[0])
    staring = replace(spots, detector_axes=np.tile([0.0, 0, 1], (4, 1)))
    assert np.array_equal(staring.aimed.detector_axes, staring.detector_axes)
    assert np.array_equal(staring.aimed.directions, spots.pointing[0])


def test_results_hold_the_directions_of_their_ranges(tmp_path):
    capture, path = recorded().capture, tmp_path / "result.h5"
    result = Reconstructor(capture.setup, depth=())(capture.frame(1))
    path.write_bytes(result_bytes(result))
    assert np.array_equal(read_result(path).spot_directions, capture.spots.pointing[1])
    with changed_file(path) as file:
        del file["spot_directions"]
    assert read_result(path).spot_directions is None


def test_frames_of_fixed_spots_are_another_recording():
    capture = recorded().capture
    fixed = replace(capture, spots=replace(capture.spots, pointing=None))
    with pytest.raises(InputError, match=r"4 spots.*compiled for .* 4 steered spots"):
        Reconstructor(capture.setup, depth=())(fixed.frame(0))
    with pytest.raises(InputError, match="fixed spots"):
        path_check(capture.setup.spots)


def test_directions_unlike_those_learned_from_give_the_anchored_map():
    capture = recorded().capture
    line = np.tile(directions([[-8, 1], [-3, 1], [3, 1], [8, 1]]), (3, 1, 1))
    given = replace(capture, spots=replace(capture.spots, pointing=line))
    result = Reconstructor(given.setup, depth=["learned", "anchored"])(given.frame(0))
    assert "spots off a line" in result.notes["depth learned"]
    np.testing.assert_array_equal(result.depths["learned"], result.depths["anchored"])


@pytest.mark.parametrize(("name", "method"), [("fog", "cw"), ("fog-spad", "dtof")])
def test_ranges_in_fog_of_home_templates_are_those_of_templates_for_each_direction(name, method):
    instrument = load_instrument(name)
    fog = RANGING_METHODS["fog"]
    solve_home, apart = None, []
    corners = HOME_DEG + np.array([[[-4.4, 4.4]], [[4.4, -4.4]], [[-4.4, -4.4]], [[0, 4.4]]])
    for number, at_deg in enumerate(corners):
        at, true_m = directions(at_deg), np.array([4.5, 6.0, 5.2, 7.0])
        light = light_in_fog(
            instrument.aimed(at), true_m, extinction_per_m=0.06,
            steady_per_s=2e4 if method == "dtof" else 1e8,
        )  # fmt: skip
        spots = instrument.tof.record(light, instrument.spot_optics, np.random.default_rng(number))
        spots = replace(spots, pointing=at[None])
        solve_home = solve_home or fog.compile(between(spots, 0, 0))
        own = replace(spots.aimed, pointing=None)
        apart.append(solve_home(spots.aimed).range_m - fog.compile(between(own, 0, 0))(own).range_m)
        np.testing.assert_array_equal(measure_ranges(spots).range_m, measure_ranges(own).range_m)
    apart = np.array(apart)[np.isfinite(apart)]
    assert apart.size >= 12
    assert np.abs(apart).max() < 1e-3
    assert np.sqrt((apart**2).mean()) < 4e-4


def test_ranges_of_other_directions_have_the_same_paths():
    """The range follows from the path to a detector beside the pinhole, that of alternatives, too.

    Detectors 1 cm aside make the range differ by up to 0.8 mm within the mirrors' range.
    """
    spots = recorded().capture.spots
    given = np.array([0.5, 2.0, 5.0, np.nan])
    alternatives = ((Alternative(3.0, 0.1, 0.7), Alternative(4.0, 0.1, 0.3)), (), (), ())
    ranges = Ranges(given, given / 100, given, given, ("ok",) * 4, alternatives)
    moved = redirected(ranges, spots, spots.aimed)

    def path_m(range_m, at, spot=slice(None)):
        ends = np.asarray(range_m)[..., None] * at.directions[spot]
        return range_m + np.linalg.norm(ends - at.detector_positions_m[spot], axis=-1)

    np.testing.assert_allclose(path_m(moved.range_m, spots.aimed), path_m(given, spots), rtol=1e-12)
    for before, after in zip(alternatives[0], moved.alternatives[0], strict=True):
        same = path_m(after.range_m, spots.aimed, 0)
        assert same == pytest.approx(path_m(before.range_m, spots, 0), rel=1e-12)
        assert after[1:] == before[1:]
    assert 1e-4 < np.nanmax(np.abs(moved.range_m - given)) < 1e-3
    assert moved.alternatives[1:] == ((), (), ())


# Eye safety


def test_beams_count_as_standing_unless_a_safeguard_is_stated():
    fixed = laser_safety(load_instrument("paper"))
    for mode in (
        {"mode": "random"}, {"mode": "raster", "shape": [4, 4]}, {"mode": "fixed"},
        {"mode": "adaptive", "scan_safeguard": True},
        {"mode": "list", "offsets_deg": [[[1, 1]]], "scan_safeguard": True},
    ):  # fmt: skip
        safety = laser_safety(steered(**mode))
        assert (safety.beams, safety.mean_margin) == (fixed.beams, fixed.mean_margin)
        assert safety.pulse_margin == fixed.pulse_margin


def test_a_safeguarded_raster_is_in_the_pupil_for_its_cells_within():
    """At 1550 nm the pupil of 3.5 mm at 10 cm is 1.003° in radius: 5 of the cells 1° apart."""
    instrument = steered(
        mode="raster", half_range_deg=[4.5, 4.5], shape=[9, 9], scan_safeguard=True
    )
    safety, standing = laser_safety(instrument), laser_safety(load_instrument("paper"))
    frames, period = 1024, 81
    full = frames // period
    assert safety.beams == 1
    fraction = safety.mean_margin / standing.mean_margin
    assert 5 * full / frames <= fraction <= 5 * (full + 1) / frames
    assert safety.pulse_margin == safety.mean_margin  # no shorter time has more of its limit
    assert safety.laser_class == "1"


def test_a_safeguarded_random_scan_is_in_the_pupil_for_its_share_of_the_range():
    """Each aperture gets one of four beams, the worst up to a fifth more visits than the mean."""
    instrument = steered(mode="random", half_range_deg=[4.5, 4.5], scan_safeguard=True)
    standing = laser_safety(load_instrument("paper"))
    fraction = laser_safety(instrument).mean_margin / standing.mean_margin
    radius_deg = np.degrees(np.arctan(1.75e-3 / 0.1))
    assert 1 < fraction / (np.pi * radius_deg**2 / 81) < 1.2


def test_mirrors_of_their_own_may_bring_standing_beams_together():
    parted = {"mode": "random", "mirrors": "each", "half_range_deg": [4.3, 4.3]}
    instrument = steered(**parted)  # the nearest are 1.4° apart, 2.4 mm at 10 cm
    assert laser_safety(instrument).beams == 4
    rigid = steered(mode="random", half_range_deg=[4.3, 4.3])
    assert laser_safety(rigid).beams == 1


# Adaptive mirrors


def test_adaptive_spots_follow_the_maps_of_earlier_frames():
    instrument = changed(
        "fog-steered",
        lasers__steering={"mode": "adaptive", "mirrors": "each", "half_range_deg": [8, 8]},
    )
    near = plane(2.5, half_size_m=0.25)
    box = Scene("box", (plane(WALL_M + 2), near), CLEAR, Ambient(sky_klx=1.0), drone_pose=ORIGIN)
    capture = simulate(box, instrument, light="surrogate", seed=SEED, frames=2).capture
    np.testing.assert_allclose(capture.spots.pointing[0], directions(HOME_DEG), atol=1e-12)
    went = capture.spots.pointing[1]
    assert np.abs(went - capture.spots.pointing[0]).max() > 0.01
    apart = np.degrees(np.arccos(np.clip(went @ went.T, -1, 1)))[np.triu_indices(4, 1)]
    assert apart.min() > 1.4  # azimuths are shorter above the horizon
    along = capture.truth.at(1).spot_range_m
    assert np.isfinite(along).all()
