"""The depth method of flights on recordings, its comparison, page, film and viewer."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from flights import flight
from reconstruction import InputError, Reconstructor, read_capture, reconstruct, write_capture
from reconstruction.capture import Truth
from reconstruction.checks import checked_depths
from reconstruction.depth import DepthEstimate
from reconstruction.depth.memory import Remembered
from reconstruction.depth.methods.flight import ranges_of, stated
from reconstruction.depth.methods.learned import FrameMap
from reconstruction.evaluation import evaluate_flight, is_flight
from reconstruction.outputs import read_result
from reconstruction.outputs.pictures import dotted
from reconstruction.outputs.result_file import result_bytes
from reconstruction.ranging import Alternative
from spisim_app.cli import app
from spisim_app.report.flight import EvaluatedFrame, Scales

FRAMES = 6


@pytest.fixture
def flown(capture):
    """A flight over a scene that stays the same, with the truth of three frames."""
    recorded = flight(capture, FRAMES)
    truths = [replace(capture.truth.at(0), corridor_m=4.5)] * 3
    return replace(recorded, truth=replace(Truth.of(truths), frame=np.array([0, 2, 5])))


def results(recording, order=None, **choice):
    """Results of the frames, in order."""
    reconstructor = Reconstructor(recording.setup, **choice)
    frames = range(recording.frames) if order is None else order
    return [reconstructor(recording.frame(frame)) for frame in frames]


def test_a_flight_is_mapped_with_memory_by_default(flown):
    first, *_, last = results(flown)
    assert list(first.depths) == list(last.depths) == ["flight"]
    assert last.points_m["flight"].shape[1] == 3
    assert "begun" not in last.notes["depth flight"]  # the map of so small an image is anchored
    alone = results(flown, depth="learned")[-1]
    assert np.abs(last.depth_m - alone.depth_m).max() > 1e-3
    still = results(replace(flown, poses=None))[-1]
    assert "flight" not in still.depths
    assert not still.points_m


def ranges_stated(capture, alternatives, frame=None):
    """What the memory gets of two spots, one without a target."""
    ranges = SimpleNamespace(
        range_m=np.array([3.0, np.nan]),
        sigma_m=np.array([0.01, np.nan]),
        status=("ok", "fog"),
        alternatives=alternatives,
    )
    frames = SimpleNamespace(spots=capture.spots)
    view = SimpleNamespace(directions=np.eye(3)[[2, 2]], ranges=ranges, frame=frames)
    return ranges_of(view, FrameMap(DepthEstimate(np.ones((2, 2))), frame))


def test_the_memory_gets_what_a_ranging_method_holds_possible(capture):
    some = [Alternative(3.0, 0.01, 0.9), Alternative(13.0, 0.02, 0.1)]
    several = (some, [Alternative(4.0, 0.1, 1.0)])
    result = ranges_stated(capture, several).possible
    np.testing.assert_array_equal(result.range_m, [[3.0, np.nan], [13.0, np.nan]])
    np.testing.assert_allclose(np.exp(result.log_weight[:, 0]), [0.9, 0.1])
    # Weights of simultaneous echoes are no probabilities.
    histograms = SimpleNamespace(spots=None)
    assert ranges_stated(histograms, several).possible is None


@pytest.mark.parametrize("best_m", [3.0, 13.0])
def test_of_plain_ranges_the_strength_of_echoes_says_what_is_possible(capture, best_m):
    """Reflectances are those of the fitted ranges, which may lie elsewhere."""
    at_3_m = np.log(0.3 * (3 / 13) ** 2 * np.exp(-2 * 0.03 * 10))
    frame = SimpleNamespace(
        log_reflectance=np.full(2, at_3_m if best_m == 3 else np.log(0.3)),
        max_range_m=10.0,
        lost=np.array([False, True]),
        extinction_per_m=0.03,
        best=SimpleNamespace(log_depth=np.log(np.full(2, best_m))),
    )
    stated = ranges_stated(capture, ((), ()), frame)
    np.testing.assert_array_equal(stated.lost, [False, True])
    result = stated.possible
    np.testing.assert_array_equal(result.range_m[:, 0], [3.0, 13.0, 23.0])
    np.testing.assert_array_equal(result.beyond[:, 0], [False, True, True])
    expected = np.log(0.1) - 0.5 * ((np.log(0.3) + 1.2) / 0.9) ** 2
    assert result.log_weight[1, 0] == pytest.approx(expected)
    assert ranges_stated(capture, ((), ())).possible is None


def test_a_frame_of_a_flight_is_that_of_those_before_it(flown):
    expected = results(flown, depth=["flight", "learned"])[-1].depth_m
    np.testing.assert_array_equal(reconstruct(flown, FRAMES - 1).depth_m, expected)


def test_a_frame_without_a_pose_has_its_own_map(capture):
    recorded = flight(capture, FRAMES, missing=[2])
    several = results(recorded, depth=["flight", "learned"])
    np.testing.assert_allclose(several[2].depths["flight"], several[2].depths["learned"])
    assert several[2].notes["depth flight"].startswith("of the frame alone, as it has no pose")
    assert "flight" not in several[2].points_m
    assert "no pose" not in several[3].notes["depth flight"]
    assert len(several[3].points_m["flight"]) >= len(several[1].points_m["flight"])


def test_a_jump_of_the_pose_is_reported_and_nothing_of_before_is_left(capture):
    at = np.zeros((FRAMES, 3))
    at[3:] = (0, 0, 300)
    several = results(flight(capture, FRAMES, at))
    assert several[3].notes["depth flight"].startswith("begun anew: the position jumps by 300 m")
    assert "begun" not in several[4].notes["depth flight"]
    assert (np.abs(several[3].points_m["flight"][:, 2]) < 20).all()


def test_frames_out_of_order_begin_anew(flown):
    several = results(flown, [0, 1, 4, 2, 3])
    notes = [each.notes["depth flight"] for each in several]
    assert [note.startswith("begun anew: time") for note in notes] == [0, 0, 0, 1, 0]
    assert "is not after 0.042735 s" in notes[3]
    again = results(flown, [2, 3])
    np.testing.assert_array_equal(several[-1].depth_m, again[-1].depth_m)


@pytest.mark.parametrize(
    ("late_s", "anew", "note"),
    [
        (0.0, None, "given"),
        (0.104, None, "from corrected poses, as those stated seem 0.10 s late; given"),
        (
            -0.05,
            "a",
            "begun anew: a; from corrected poses, as those stated seem 0.05 s early; given",
        ),
    ],
)
def test_what_the_memory_did_to_poses_is_reported(late_s, anew, note):
    estimate = DepthEstimate(np.ones((2, 2)), note="given")
    remembered = Remembered(estimate, np.zeros((0, 3)), np.zeros(0), anew, late_s)
    assert stated(remembered, FrameMap(estimate), np.ones((2, 2, 3))).note == note


def test_points_are_kept_in_the_result_file(flown, tmp_path):
    result = results(flown)[-1]
    (tmp_path / "result.h5").write_bytes(result_bytes(result))
    again = read_result(tmp_path / "result.h5")
    np.testing.assert_array_equal(again.points_m["flight"], result.points_m["flight"])


@pytest.mark.parametrize(
    ("points_m", "message"),
    [
        (np.zeros(3), "float64 of shape .3,.; expected real numbers of shape .3, 3."),
        (np.zeros((4, 2)), "of shape .4, 2.; expected real numbers of shape .4, 3."),
        (np.full((1, 3), np.nan), "as points_m, returned values that are not finite"),
    ],
)
def test_points_of_another_shape_are_refused(points_m, message):
    estimate = DepthEstimate(np.ones((2, 2)), points_m=points_m)
    with pytest.raises(InputError, match=message):
        checked_depths("depth method 'mine'", estimate, (2, 2))


def test_a_flight_is_compared_frame_by_frame(flown):
    judged = []
    result = evaluate_flight(flown, judged=lambda *each: judged.append(each))
    assert result["frames"] == FRAMES
    assert result["depth_methods"] == ["flight", "anchored"]
    rows = result["over_time"]
    assert [row["frame"] for row in rows] == [0, 2, 5]
    assert [row["time_s"] for row in rows] == pytest.approx([1 / 117, 3 / 117, 6 / 117])
    assert [each.frame for each, _ in judged] == [0, 2, 5]
    for row, (each, metrics) in zip(rows, judged, strict=True):
        assert row["corridor_m"] == 4.5
        for name, figures in row["depths"].items():
            assert figures["abs_rel"] == metrics["depths"][name]["abs_rel"]
            assert figures["obstacle_m"] == each.obstacles_m[name]
    errors = np.array([[each["abs_rel"] for each in row["depths"].values()] for row in rows])
    logs = np.log(errors[:, 0] / errors[:, 1])
    ratio = result["ratio"]["anchored"]
    assert ratio["abs_rel"] == pytest.approx(np.exp(logs.mean()))
    half = 4.302653 * logs.std(ddof=1) / np.sqrt(3)  # Student's t of two degrees of freedom
    assert ratio["high"] == pytest.approx(np.exp(logs.mean() + half))
    assert ratio["low"] == pytest.approx(np.exp(logs.mean() - half))
    assert result["mean"]["flight"]["abs_rel"] == pytest.approx(errors[:, 0].mean())
    json.dumps(result, allow_nan=False)


def test_frames_without_a_map_have_missed_what_is_ahead(flown):
    class FirstOnly:
        """A wall in the first frame, and no map of the others."""

        name, needs = "first", ()

        def compile(self, context):
            true_m = flown.truth.at(0).depth_m
            left = [DepthEstimate(np.full(true_m.shape, np.nanmin(true_m)))]
            return lambda view: left.pop() if left else None

    result = evaluate_flight(flown, depth=["nearest", FirstOnly()])
    of_frames = [row["depths"].get("first") for row in result["over_time"]]
    assert of_frames[1:] == [None, None]
    mean, first = result["mean"]["first"], of_frames[0]
    assert mean["abs_rel"] == first["abs_rel"]
    assert mean["obstacle_missed"] == pytest.approx((first["obstacle_missed"] + 2) / 3)
    assert mean["obstacle_false"] == pytest.approx(first["obstacle_false"] / 3)


def test_notes_of_a_flight_name_their_frames(capture, flown):
    recorded = flight(capture, FRAMES, missing=[1, 2, 4])
    notes = evaluate_flight(replace(flown, poses=recorded.poses))["notes"]
    assert any(note.startswith("3 frames from 1 to 4: depth 'flight' is of the") for note in notes)
    recorded = flight(capture, FRAMES, np.where(np.arange(FRAMES) < 3, 0, 9)[:, None] * np.ones(3))
    notes = evaluate_flight(replace(flown, poses=recorded.poses))["notes"]
    assert any(note.startswith("frame 3: depth 'flight' is begun anew: the pos") for note in notes)


def test_methods_of_a_flight_can_be_named(flown):
    result = evaluate_flight(flown, depth=["nearest", "anchored", "flight"])
    assert result["depth_methods"] == ["nearest", "anchored", "flight"]
    assert set(result["ratio"]) == {"anchored", "flight"}


def test_a_recording_without_poses_or_truth_is_no_flight(flown):
    assert is_flight(flown)
    for other in (replace(flown, poses=None), replace(flown, truth=None)):
        assert not is_flight(other)
        with pytest.raises(InputError, match="not a flight: it lacks poses, or the truth"):
            evaluate_flight(other)


def evaluated(*words):
    return CliRunner().invoke(app, ["evaluate", *map(str, words)], env={"COLUMNS": "200"})


def test_the_command_prints_frames_over_time_and_writes_page_and_film(capture, flown, tmp_path):
    slow = flight(capture, FRAMES, time_s=0.1 * (1 + np.arange(FRAMES)))
    write_capture(replace(flown, poses=slow.poses), tmp_path / "flight.h5")
    page, film = tmp_path / "page.html", tmp_path / "film.gif"
    run = evaluated(tmp_path / "flight.h5", "--page", page, "--film", film)
    assert run.exit_code == 0, run.output
    for words in ("error, flight", "error, anchored", "0.30 s", "4.50 m", "95 % interval"):
        assert words in run.output
    text = page.read_text(encoding="utf-8")
    assert text.count('<section class="sample"') == 3
    for words in (
        "frame 5",
        "Depth, flight memory",
        "Depth, anchored",
        "True depth",
        "95 % interval",
    ):
        assert words in text
    with Image.open(film) as pictures:
        assert pictures.n_frames == 3
    again = evaluated(tmp_path / "flight.h5", "--page", page, "--film", film, "--json")
    assert again.exit_code == 0, again.output  # its own files are replaced
    assert json.loads(again.stdout)["over_time"][2]["frame"] == 5


def test_one_frame_of_a_flight_is_compared_if_named(flown, tmp_path):
    write_capture(flown, tmp_path / "flight.h5")
    run = evaluated(tmp_path / "flight.h5", "--frame", 2, "--json")
    assert run.exit_code == 0, run.output
    metrics = json.loads(run.stdout)
    assert metrics["frame"] == 2
    assert next(iter(metrics["depths"])) == "flight"


def test_files_are_refused_before_any_work(capture, flown, tmp_path):
    write_capture(flown, tmp_path / "flight.h5")
    write_capture(capture, tmp_path / "capture.h5")
    (tmp_path / "mine.gif").write_text("mine")
    for words, message in (
        (("capture.h5", "--film", "film.gif"), "for all frames of a flight with truth"),
        (("flight.h5", "--frame", "0", "--page", "a.html"), "for all frames of a flight"),
        (("flight.h5", "--film", "mine.gif"), "exists and is not an earlier flight"),
        (("flight.h5", "--film", "film.mp4"), "film.mp4"),
    ):
        paths = [tmp_path / word if "." in word and "-" not in word else word for word in words]
        run = evaluated(*paths)
        assert run.exit_code == 2, run.output
        assert message in run.output
    assert (tmp_path / "mine.gif").read_text() == "mine"


def test_points_are_drawn_where_they_are_seen(flown):
    result = results(flown)[-1]
    frame = EvaluatedFrame.of_recording(flown, result, {"depths": {}, "images": {}})
    _, memory, _ = Scales.of([frame]).panels(frame)
    points_m = result.points_m["flight"]
    tangents = points_m[:, 1::-1] / points_m[:, 2:] / 0.1
    inside = (np.abs(tangents) < 1).all(axis=1)
    np.testing.assert_allclose(memory.pixels, ((tangents + 1) * 8 - 0.5)[inside])
    assert memory.rgba.shape == (256, 256, 4)


def test_dots_are_white_on_black_and_cut_at_the_edge():
    picture = np.full((64, 64, 3), 9, np.uint8)
    result = dotted(picture, np.array([[10, 20], [0, 0]], float))
    assert result.shape == (256, 256, 3)
    assert (result[41:43, 81:83] == 255).all()
    assert (result[40:44, 80] == 0).all()
    assert (result == 255).all(axis=-1).sum() == 8
    assert (dotted(picture, np.zeros((0, 2))) == 9).all()


def test_a_viewer_shows_points_in_the_world(capture, tmp_path):
    from spisim_app.report.viewer.space import POINTS, Space
    from spisim_app.report.viewer.views import views_of_captures

    rerun = pytest.importorskip("rerun")
    at = np.linspace([0, 0, 0], [0, 0, 0.2], 3)
    write_capture(flight(replace(capture, provenance=replace(capture.provenance, scene="")), 3, at),
                  tmp_path / "flight.h5")  # fmt: skip
    assert read_capture(tmp_path / "flight.h5").frames == 3
    logged = {}

    class Stream:
        def log(self, name, what, static=False):
            if name == POINTS:
                logged[name] = what

    space = Space(rerun, Stream())
    for view in views_of_captures([tmp_path / "flight.h5"]):
        space.draw(view)
        points = np.array(logged[POINTS].positions.as_arrow_array().to_pylist())
        expected = view.result.points_m["flight"] + view.shot.pose[:3, 3]
        np.testing.assert_allclose(points, expected, atol=1e-5)
    assert len(points)


def test_saturated_frames_and_surrogate_light_are_noted(flown):
    saturated = np.zeros_like(flown.buckets.saturated)
    saturated[[2, 3]] = True
    dark = replace(flown, buckets=replace(flown.buckets, saturated=saturated))
    software = replace(flown.provenance, software="spisim 0, surrogate light")
    assert software.is_surrogate
    result = evaluate_flight(replace(dark, provenance=software))
    assert [row["frame"] for row in result["over_time"]] == [0, 5]
    assert result["notes"][0].startswith("the light of this simulation is a fast surrogate")
    assert "frames 2 to 3: no image, because every pattern" in " ".join(result["notes"])
    nothing = replace(flown.buckets, saturated=np.ones_like(saturated))
    with pytest.raises(InputError, match="no frame with a truth could be reconstructed: frames 0"):
        evaluate_flight(replace(flown, buckets=nothing))
