"""Sets of single photons: made-up recordings of known surfaces and flights; what is missing."""

from pathlib import Path

import measured_flights
import measured_spad
import measured_surfaces
import numpy as np
import pytest
from scipy.io import savemat

from reconstruction.base.errors import InputError
from spisim.instrument import load_instrument

SENSOR = load_instrument("vl53l5cx")
PLATEAU = 100.0


def save_surfaces(folder: Path, pixels: int, photons: int) -> None:
    """Pixels with so many photons of a plateau after two delays, and a few anywhere."""
    rng = np.random.default_rng(3)
    truth = 4330.0 + np.zeros(pixels), rng.uniform(6000, 6300, pixels)
    times = np.empty((1, pixels), dtype=object)
    for pixel, delays in enumerate(zip(*truth, strict=True)):
        pulses = [each + rng.uniform(-PLATEAU / 2, PLATEAU / 2, photons) for each in delays]
        every = np.concatenate([*pulses, rng.uniform(3000, 7000, 2)])
        times[0, pixel] = every.astype(np.uint16)[:, None]
    savemat(folder / measured_surfaces.PHOTONS, {"photon_times": times})
    named = {"T_first": truth[0][None], "T_second": truth[1][None] - 100.0}
    savemat(folder / measured_surfaces.TRUTH, named)


def save_flight(folder: Path, late_s: float, far_m: float = 2.5) -> None:
    """A drone that flies at 0.5 m/s from 2.5 m to a wall at x = 0, seen so much later."""
    folder.mkdir()
    times_ms = 30_000 + 66 * np.arange(40)
    vicon = ["name,timeStamp,posx,posy,posz,qw,qx,qy,qz"]
    for time in range(29_000, 33_000, 5):
        x = -far_m + 0.5e-3 * (time - 30_000)
        vicon.append(f"Drone,{time},{x},0,0.5,1,0,0,0")
        vicon.append(f"Surface,{time},0,0,0.5,1,0,0,0")
    rows = []
    for time in times_ms:
        rows.append(f"{time},0,0")
        range_mm = 1e3 * far_m - 0.5 * (time - 1e3 * late_s - 30_000)
        rows += [f"{round(range_mm)},1,5"] * 64
    (folder / measured_flights.VICON).write_text("\n".join(vicon), encoding="utf-8")
    (folder / measured_flights.SENSOR).write_text("\n".join(rows), encoding="utf-8")


def test_surfaces_are_found_as_well_as_their_bound(tmp_path: Path) -> None:
    save_surfaces(tmp_path, 120, 20)
    errors = measured_surfaces.surface_errors(measured_surfaces.read_surfaces(tmp_path))
    assert errors.error.shape == (60, 2)
    assert np.isfinite(errors.error).all()
    # The bound is that of a Gaussian as wide; a plateau's edges tell more than that.
    assert np.sqrt(np.mean(errors.bound**2)) == pytest.approx(
        PLATEAU / np.sqrt(12) / np.sqrt(20), rel=0.15
    )
    assert (np.std(errors.error, axis=0) < 1.0 * np.mean(errors.bound, axis=0)).all()
    assert abs(np.mean(errors.error)) < 3.0


def test_a_sensor_one_frame_late_is_as_simulated(tmp_path: Path) -> None:
    save_flight(tmp_path / "A0", SENSOR.tof.frame_time_s)
    compared = measured_spad.compare_flights(tmp_path, True)
    flight = measured_flights.read_flight(tmp_path / "A0", SENSOR.tof.frame_time_s)
    assert np.nanmedian(flight.middle_m - flight.measured_m) == pytest.approx(0, abs=2e-3)
    assert np.nanmedian(flight.middle_m - flight.range_m) == pytest.approx(0.033, abs=3e-3)
    alike = next(check for check in compared.checks if check.name == "status alike")
    assert alike.value == 1
    simulated = measured_flights.simulated(SENSOR, flight.measured_m, 0)
    assert np.nanmedian(simulated - flight.measured_m[:, None]) == pytest.approx(0, abs=0.01)


def test_folders_that_lack_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"two_layer\.mat: no such file"):
        measured_surfaces.read_surfaces(tmp_path)
    with pytest.raises(InputError, match="holds no flight"):
        measured_spad.compare_flights(tmp_path, True)
    (tmp_path / "A0").mkdir()
    with pytest.raises(InputError, match=r"state_ToF\.csv: no such file"):
        measured_spad.compare_flights(tmp_path, True)


def test_a_flight_with_half_a_frame_is_refused(tmp_path: Path) -> None:
    save_flight(tmp_path / "A0", 0.0)
    path = tmp_path / "A0" / measured_flights.SENSOR
    path.write_text("\n".join(path.read_text().splitlines()[:-10]), encoding="utf-8")
    with pytest.raises(InputError, match="a time and 64 zones for each frame"):
        measured_flights.read_flight(tmp_path / "A0", 0.0)
