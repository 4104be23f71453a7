"""Phase functions are normalised, have the mean cosine they say, and mean the same to Mitsuba.

Tables too coarse for their forward lobe, and tables that are no phase function, are refused.
"""

from pathlib import Path

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from spisim.atmosphere import (
    Blend,
    HenyeyGreenstein,
    Isotropic,
    Phase,
    Tabulated,
    henyey_greenstein,
    tabulate,
)
from spisim.atmosphere.table import NODES, _columns
from spisim.scene import load_scene

COARSE = Tabulated((1.0, 2.0, 5.0, 3.0, 20.0))
PHASES = [
    Isotropic(),
    HenyeyGreenstein(0.8),
    HenyeyGreenstein(-0.3),
    COARSE,
    Blend(((0.9589, HenyeyGreenstein(0.8376)), (0.0411, HenyeyGreenstein(-0.496)))),
    Blend(((0.2, Isotropic()), (0.5, COARSE), (0.3, HenyeyGreenstein(0.5)))),
]


def sphere_integral(phase: Phase, moment: int) -> float:
    """∫ p cos^moment dΩ."""
    nodes, weights = np.polynomial.legendre.leggauss(100)
    centres = np.array([-0.75, -0.25, 0.25, 0.75])  # between the nodes of COARSE
    cos = (centres[:, None] + 0.25 * nodes).ravel()
    density = phase.density(cos) * np.tile(weights, 4) / 4
    return float(2 * np.pi * density @ cos**moment)


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: type(phase).__name__)
def test_normalised_with_the_mean_cosine_it_says(phase: Phase) -> None:
    assert sphere_integral(phase, 0) == pytest.approx(1, abs=1e-9)
    assert sphere_integral(phase, 1) == pytest.approx(phase.g, abs=1e-9)


def test_henyey_greenstein_by_hand() -> None:
    forward, back = HenyeyGreenstein(0.5).density([1, -1]) * 4 * np.pi
    assert forward == pytest.approx(0.75 / 0.125)  # (1 - g²) / (1 - g)³
    assert back == pytest.approx(0.75 / 3.375)
    assert henyey_greenstein(0.5) == HenyeyGreenstein(0.5)
    assert henyey_greenstein(0) == Isotropic()
    np.testing.assert_allclose(Isotropic().density([-1, 0.3]), 1 / (4 * np.pi))


@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: type(phase).__name__)
def test_mitsuba_agrees(phase: Phase) -> None:
    from spisim.transport.backend import activate
    from spisim.transport.media import phase_plugin

    activate()
    import mitsuba as mi

    cos = np.linspace(-1, 1, 41)
    sin = np.sqrt(1 - cos**2)
    interaction = mi.MediumInteraction3f()
    interaction.wi = mi.Vector3f(0, 0, -1)  # light travels along +z
    interaction.sh_frame = mi.Frame3f(interaction.wi)
    outgoing = mi.Vector3f(np.array([sin, 0 * sin, cos], dtype=np.float32))
    plugin = phase_plugin(phase)
    value, _ = plugin.eval_pdf(mi.PhaseFunctionContext(), interaction, outgoing)
    # The cosine of a float32 vector is off by 1e-7, times the slope of the steepest table.
    np.testing.assert_allclose(value.x.numpy() * np.ones(41), phase.density(cos), rtol=1e-4)


def test_scale_of_a_table_is_free_and_the_caller_s_array_is_left_alone() -> None:
    values = np.array([1.0, 2.0, 5.0, 3.0, 20.0])
    table = Tabulated(values * 7)
    np.testing.assert_allclose(table.density([-0.2, 0.9]), COARSE.density([-0.2, 0.9]))
    taken = Tabulated(values)
    values[0] = 99
    assert taken.values[0] == 1
    with pytest.raises(ValueError, match="read-only"):
        taken.values[0] = 3


def narrow(cos: np.ndarray) -> np.ndarray:
    return HenyeyGreenstein(0.98).density(cos)


def test_a_grid_too_coarse_is_told_with_what_it_would_give() -> None:
    values = narrow(np.linspace(-1, 1, 101))
    result = Tabulated(values).g
    assert abs(result - 0.98) > 0.002
    with pytest.raises(InputError) as caught:
        Tabulated(values, declared_g=0.98, name="advection")
    for part in ("'advection'", "101 nodes", f"g = {result:.4f}", "0.98", "too coarse"):
        assert part in str(caught.value)
    fine = Tabulated(narrow(np.linspace(-1, 1, 20_001)), declared_g=0.98)
    assert fine.g == pytest.approx(0.98, abs=0.002)


@pytest.mark.parametrize("values", [(1.0,), (), (1.0, -0.1), (1.0, np.nan), (0.0, 0.0), ((1, 2),)])
def test_values_that_are_no_phase_function(values: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match=r"phase function 'mine'"):
        Tabulated(values, name="mine")


@pytest.mark.parametrize("g", [1, -1, 1.2, np.nan])
def test_impossible_asymmetry(g: float) -> None:
    with pytest.raises(InputError, match="g should lie between -1 and 1"):
        henyey_greenstein(g)


def test_weights_rounded_to_three_digits_are_scaled() -> None:
    parts = Blend(((0.333, Isotropic()), (0.667, HenyeyGreenstein(0.9)))).parts
    assert sum(weight for weight, _ in parts) == pytest.approx(1, abs=1e-12)
    assert sphere_integral(Blend(((0.3335, Isotropic()), (0.667, COARSE))), 0) == pytest.approx(1)


@pytest.mark.parametrize("weights", [(), (0.5,), (1.2, -0.2), (0.0, 1.0), (0.7, 0.7), (np.nan, 1)])
def test_weights_that_are_no_mixture(weights: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="weights of a blend"):
        Blend(tuple((weight, Isotropic()) for weight in weights))


# Tables from elsewhere

ANGLES = np.concatenate([np.linspace(0, 10, 2001), np.linspace(10, 180, 1001)[1:]])
BY_ANGLE = np.column_stack([ANGLES, narrow(np.cos(np.radians(ANGLES)))])


@pytest.mark.parametrize(
    "table",
    [
        BY_ANGLE,
        BY_ANGLE[::-1],
        np.column_stack([np.cos(np.radians(ANGLES)), BY_ANGLE[:, 1]]),
        BY_ANGLE * [1, 55],
    ],
    ids=["angle", "falling angle", "cosine", "other scale"],
)
def test_table_is_resampled_finely(table: np.ndarray) -> None:
    phase = tabulate(table, declared_g=0.98)
    assert phase.values.size == NODES > 20_000
    cos = np.cos(np.radians([0, 0.7, 3, 33, 120, 180]))
    np.testing.assert_allclose(phase.density(cos), narrow(cos), rtol=3e-3)


def test_table_in_absolute_units_has_to_integrate_to_1() -> None:
    assert tabulate(BY_ANGLE, per_steradian=True).g == pytest.approx(0.98, abs=1e-3)
    with pytest.raises(InputError, match=r"'mie'.*its integral is 1\.02"):
        tabulate(BY_ANGLE * [1, 1.02], per_steradian=True, name="mie")
    assert tabulate(BY_ANGLE * [1, 1.02]).g == pytest.approx(0.98, abs=1e-3)


def test_table_that_cannot_be_resampled_or_is_not_what_it_says() -> None:
    needle = np.column_stack([[0, 0.01, 0.02, 180], [1e6, 1e6, 1e-3, 1e-3]])
    with pytest.raises(InputError, match="too coarse"):
        tabulate(needle)
    with pytest.raises(InputError, match=rf"{len(BY_ANGLE)} rows.*instead of 0\.9000"):
        tabulate(BY_ANGLE, declared_g=0.9)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ([1, 2, 3], "two columns"),
        ([[0, 1, 2], [180, 1, 2]], "two columns"),
        ([[0, 1]], "two columns"),
        ([[0, 1], [90, 1]], "span.*0 to 90"),
        ([[0, 1], [3.14159, 1]], "span.*0 to 3.14159"),
        ([[0, 1], [50, 1], [40, 1], [180, 1]], "rise or fall"),
        ([[0, 1], [50, np.nan], [180, 1]], "finite"),
        ([[0, 1], [50, -1], [180, 1]], "0 or more"),
        ([[0, 0], [180, 0]], "not all 0"),
    ],
)
def test_table_that_is_none(table: list[list[float]], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        tabulate(table, name="mie.csv")
    assert "'mie.csv'" in str(caught.value)


# In scene files

SCENE = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [5, 0, 1], material: concrete}
fog: {extinction_per_m: 0.1, albedo: 0.99, FIELDS}
"""


def phase_of(folder: Path, fields: str) -> Phase:
    path = folder / "scene.yaml"
    path.write_text(SCENE.replace("FIELDS", fields))
    return load_scene(path).atmosphere.phase


def write_tables(folder: Path) -> None:
    rows = "\n".join(f"{angle},{value:.9g}" for angle, value in BY_ANGLE)
    (folder / "plain.csv").write_text(rows + "\n")
    (folder / "header.csv").write_text("angle_deg,value\n" + rows + "\n\n")
    np.save(folder / "table.npy", BY_ANGLE)
    (folder / "words.csv").write_text("angle_deg,value\n0,one\n180,two\n")
    (folder / "ragged.csv").write_text("0,1\n90\n180,1\n")
    (folder / "empty.csv").write_text("")
    np.save(folder / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    (folder / "broken.npy").write_bytes(b"\x93NUMPY")


def test_scene_file_gives_any_phase_function(tmp_path: Path) -> None:
    write_tables(tmp_path)
    assert phase_of(tmp_path, "g: 0.7") == HenyeyGreenstein(0.7)
    assert phase_of(tmp_path, "phase: {g: 0.7}") == HenyeyGreenstein(0.7)
    assert phase_of(tmp_path, "phase: {g: 0}") == Isotropic()
    for name in ("plain.csv", "header.csv", "table.npy"):
        phase = phase_of(tmp_path, f"phase: {{table: {name}, unit: 1/sr, g: 0.98}}")
        assert isinstance(phase, Tabulated)
        assert phase.g == pytest.approx(0.98, abs=1e-3)
    blend = phase_of(
        tmp_path, "phase: {blend: [{weight: 0.9, table: plain.csv}, {weight: 0.1, g: -0.5}]}"
    )
    assert blend.g == pytest.approx(0.9 * 0.98 - 0.05, abs=1e-3)


@pytest.mark.parametrize(
    ("fields", "parts"),
    [
        ("phase: {table: plian.csv}", ["no table 'plian.csv'", "did you mean 'plain.csv'"]),
        ("phase: {table: words.csv}", ["'words.csv'", "line 2: should hold numbers"]),
        ("phase: {table: ragged.csv}", ["'ragged.csv'", "differ in length"]),
        ("phase: {table: empty.csv}", ["'empty.csv'", "two columns"]),
        ("phase: {table: objects.npy}", ["'objects.npy'", "cannot be read"]),
        ("phase: {table: broken.npy}", ["'broken.npy'", "cannot be read"]),
        ("phase: {table: plain.csv, g: 0.9}", ["'plain.csv'", "too coarse"]),
        ("phase: {table: plain.csv, unit: sr}", ["fog.phase.unit", "1/sr"]),
        ("phase: {tabel: plain.csv}", ["fog.phase", "did you mean 'table'"]),
        ("phase: {}", ["fog.phase", "one of g, table"]),
        ("phase: {unit: 1/sr}", ["fog.phase", "one of g, table"]),
        ("phase: {g: 0.3, blend: [{weight: 1, g: 0}]}", ["fog.phase", "one of g, table"]),
        ("phase: {g: 1}", ["fog.phase.g", "less than 1"]),
        ("phase: {blend: []}", ["fog.phase.blend", "at least 1"]),
        ("phase: {blend: [{weight: 0.4, g: 0}]}", ["fog", "weights of a blend", "0.4"]),
        ("phase: {blend: [{weight: -1, g: 0}]}", ["fog.phase.blend[0].weight", "-1"]),
        ("phase: {blend: [{g: 0}]}", ["fog.phase.blend[0].weight", "missing"]),
        ("g: 0.5, phase: {g: 0.5}", ["fog", "g or phase, not both"]),
    ],
)
def test_mistake_in_a_phase_function(tmp_path: Path, fields: str, parts: list[str]) -> None:
    write_tables(tmp_path)
    with pytest.raises(InputError) as caught:
        phase_of(tmp_path, fields)
    for part in ("scene.yaml", "fog", *parts):
        assert part in str(caught.value)


def test_visibility_has_its_own_phase_function(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(
        SCENE.replace(
            "extinction_per_m: 0.1, albedo: 0.99, FIELDS", "visibility_m: 50, phase: {g: 0}"
        )
    )
    with pytest.raises(InputError, match="phase does not go with visibility_m"):
        load_scene(path)


def test_a_cosine_that_rounding_makes_too_large_is_straight_on() -> None:
    columns = _columns(np.array([[0.0, 3.0], [90.0, 1.0], [180.0, 2.0]]), "table")
    np.testing.assert_allclose(columns.at(np.array([1 + 1e-12, -1 - 1e-12])), [3.0, 2.0])
