"""A run directory as an xarray dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from goniod.run import CHANNELS, COVERAGE, _rgb

if TYPE_CHECKING:
    from goniod.run import Run

# Name, column of readings.csv, unit, and what it is.
COORDINATES = [
    ("theta_r", "theta_r_deg", "degree", "zenith angle of the sensor"),
    ("d_p", "d_p", "1", "length of the projected deviation vector"),
    ("phi_p", "phi_p_deg", "degree", "azimuth of the projected deviation vector"),
    ("light_angle", "light_measured_deg", "degree", "angle of the light arm from the normal, measured"),
    ("sensor_angle", "sensor_measured_deg", "degree", "angle of the sensor arm from the normal, measured"),
    ("light_angle_commanded", "light_commanded_deg", "degree", "angle of the light arm from the normal, commanded"),
    ("sensor_angle_commanded", "sensor_commanded_deg", "degree", "angle of the sensor arm from the normal, commanded"),
    ("time", "time_s", "s", "rig time since the start of the run, at the middle of the integration"),
]
VARIABLES = [
    ("monitor_counts", "counts_monitor", "count", "counts of the lamp monitor"),
    ("gain", "gain", "1", "gain step of the photometer"),
]
OF_CHANNELS = [
    ("reflectance", "f", "1/sr", "reflectance f_r"),
    ("reflectance_uncertainty", "u", "1/sr", "expanded uncertainty of the reflectance, k = 2"),
    ("raw_reflectance", "raw", "1/sr", "reflectance in the sensor's own colours"),
    ("counts", "counts", "count", "counts of the photometer, the dark level included"),
]


def dataset(run: Run) -> xarray.Dataset:
    """Make the dataset of a run."""
    columns = run.readings

    def along(column: str, unit: str, about: str) -> tuple[str, Any, dict[str, str]]:
        return "reading", columns[column], {"units": unit, "long_name": about}

    def of_channels(column: str, unit: str, about: str) -> tuple[tuple[str, str], Any, dict[str, str]]:
        return ("reading", "channel"), _rgb(columns, column), {"units": unit, "long_name": about}

    coordinates: dict[str, Any] = {"channel": list(CHANNELS), "reading": columns["index"].astype(np.int64)}
    coordinates["sweep"] = ("reading", columns["sweep"], {"long_name": "what the reading belongs to"})
    coordinates |= {name: along(*rest) for name, *rest in COORDINATES}
    variables: dict[str, Any] = {name: of_channels(*rest) for name, *rest in OF_CHANNELS}
    variables |= {name: along(*rest) for name, *rest in VARIABLES}
    seconds = columns["integration_us"] * 1e-6
    variables["integration_time"] = ("reading", seconds, {"units": "s", "long_name": "integration time"})
    for name, about in [("accepted", "whether the reading counts"), ("shadowed", "whether the arms shadow each other")]:
        variables[name] = ("reading", columns[name], {"long_name": about})
    variables["flags"] = ("reading", columns["flags"], {"long_name": "flags, separated by |"})
    found = xarray.Dataset(variables, coordinates)
    found["reflectance"].attrs["ancillary_variables"] = "reflectance_uncertainty"
    found["reflectance_uncertainty"].attrs["coverage_factor"] = COVERAGE
    found.attrs = {
        "title": run.specimen,
        "run": run.id,
        "started": run.info["started"],
        "ended": run.info["ended"] or "",
        "state": run.info["state"],
        "verdict": str(run.info["verdict"]),
        "source": f"goniod {run.info['version']}",
        "job": run.job,
        "rig": run.info["rig"]["text"],
    }
    return found
