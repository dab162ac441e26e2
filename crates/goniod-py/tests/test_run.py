"""A run directory as arrays, as xarray and as NeXus."""

import subprocess
import sys

import goniod
import h5py
import numpy as np
import pint
import pytest
import xarray
from conftest import pairs
from nexusformat.nexus import nxload


def test_the_model_is_the_one_that_the_program_made(run_directory):
    """brdf.binary holds the model's values at its nodes, so there both must agree to the last digits."""
    run = goniod.Run(run_directory)
    table = np.fromfile(run_directory / "brdf.binary", "<f8", offset=12).reshape(3, 90, 90, 180)
    i, j, k = np.meshgrid(np.arange(0, 80, 7), np.arange(0, 80, 7), np.arange(0, 180, 11), indexing="ij")
    theta_h, theta_d, phi_d = (i / 90) ** 2 * np.pi / 2, np.radians(j), np.radians(k)
    x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
    turned = [
        np.stack([a * np.cos(theta_h) + z * np.sin(theta_h), b, z * np.cos(theta_h) - a * np.sin(theta_h)], -1)
        for a, b in ((x, y), (-x, -y))
    ]
    above = np.minimum(turned[0][..., 2], turned[1][..., 2]) > 1e-9
    stored = (table[:, i, j, k] * (np.array([1.00, 1.15, 1.66]) / 1500)[:, None, None, None])[:, above].T
    found = run.model().eval(turned[0][above], turned[1][above])
    # The readings go through the decimal degrees of readings.csv.
    assert np.abs(found / stored - 1.0).max() < 1e-5


def test_the_model_of_a_flight_is_nearly_the_one_that_the_program_made(flown_directory):
    """Passes there and back are weighed by the uncertainty as a whole, the program has counting noise alone."""
    run = goniod.Run(flown_directory)
    assert goniod.compare(run.brdf(), run.model(), pairs=20_000)["male"] < 5e-4


def test_xarray_has_units_that_others_know(run_directory, tmp_path):
    data = goniod.Run(run_directory).to_xarray()
    assert list(data.channel.values) == ["red", "green", "blue"]
    units = pint.UnitRegistry()
    expected = {"reflectance": "1/steradian", "theta_r": "degree", "integration_time": "second", "light_angle": "degree"}
    for name, unit in expected.items():
        assert units.Unit(data[name].attrs["units"]) == units.Unit(unit)
    for name in {*data.data_vars, *data.coords} - {"channel", "reading"}:
        if data[name].dtype.kind == "f":
            units.Unit(data[name].attrs["units"])
    assert data.reflectance_uncertainty.attrs["coverage_factor"] == 2.0
    good = data.reflectance.notnull() & data.accepted
    assert bool((data.reflectance_uncertainty.where(good) > 0.0).where(good, True).all())
    # Another program's reader gets back what was written.
    data.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with xarray.open_dataset(tmp_path / "run.nc", engine="h5netcdf") as again:
        xarray.testing.assert_equal(again.load().reflectance, data.reflectance)
        assert again.reflectance.attrs["units"] == "1/sr"


def test_nexus_is_opened_by_others_with_units_and_errors(run_directory, tmp_path):
    run, path = goniod.Run(run_directory), tmp_path / "run.nxs"
    run.to_nexus(path, user="Ada")
    with h5py.File(path) as file:
        entry = file[file.attrs["default"]]
        classes = {name: group.attrs.get("NX_class") for name, group in entry.items() if isinstance(group, h5py.Group)}
        assert classes == {
            "data": "NXdata", "instrument": "NXinstrument", "job": "NXnote", "monitor": "NXmonitor", "rig": "NXnote",
            "sample": "NXsample", "user": "NXuser",
        }  # fmt: skip
        assert entry["instrument/detector"].attrs["NX_class"] == "NXdetector"
        assert entry["instrument/source"].attrs["NX_class"] == "NXsource"
        assert entry["user/name"].asstr()[()] == "Ada"
        assert entry["data/theta_r"].attrs["units"] == "degree"
    root = nxload(path)
    data = root.entry.data
    assert data.nxsignal.nxname == "reflectance" and data.nxsignal.units == "1/sr"
    assert [axis.nxname for axis in data.nxaxes] == ["reading", "channel"]
    errors = data.nxerrors.nxdata
    # One standard deviation, of the expanded uncertainty with k = 2.
    assert np.allclose(2.0 * errors, run.to_xarray().reflectance_uncertainty, equal_nan=True)
    # Its own validator finds nothing that is wrong with the groups and fields that NeXus defines.
    said = subprocess.run(
        [sys.executable, "-m", "nexusformat.scripts.nxvalidate", "-e", str(path)], capture_output=True, text=True
    )
    complaints = [line for line in (said.stdout + said.stderr).splitlines() if "ERROR" in line or "Traceback" in line]
    assert not complaints, said.stdout


def test_a_failed_write_leaves_the_old_file(run_directory, tmp_path):
    path = tmp_path / "run.nxs"
    path.write_text("old")
    run = goniod.Run(run_directory)
    run.info = {**run.info, "started": object()}
    with pytest.raises(TypeError):
        run.to_nexus(path)
    assert path.read_text() == "old" and [file.name for file in tmp_path.iterdir()] == ["run.nxs"]


def test_a_scene_of_the_job_bounds_the_model(run_directory):
    run = goniod.Run(run_directory)
    planes, arc = run.observations()
    job = run.job + "\n[scene]\ntheta_i_deg = [0.0, 40.0]\ntheta_o_deg = [0.0, 40.0]\n"
    bounded = goniod.fit(planes, arc, job=job)
    assert not bounded.valid(np.radians([70.0, 0.0]), [0.0, 0.0, 1.0])
    assert bounded.valid(np.radians([30.0, 0.0]), [0.0, 0.0, 1.0])
    incident, exitant = pairs(100)
    assert (bounded.eval(incident, exitant) == run.model().eval(incident, exitant)).all()
