"""A run directory as a NeXus file."""

from __future__ import annotations

import getpass
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from goniod.run import CHANNELS, COVERAGE, _rgb

if TYPE_CHECKING:
    from goniod.run import Run

# Axes of the readings in NXdata: name, column of readings.csv, and unit.
AXES = [
    ("theta_r", "theta_r_deg", "degree"),
    ("d_p", "d_p", ""),
    ("phi_p", "phi_p_deg", "degree"),
    ("light_angle", "light_measured_deg", "degree"),
    ("sensor_angle", "sensor_measured_deg", "degree"),
    ("time", "time_s", "s"),
]


def write(run: Run, path: Path, user: str | None) -> None:
    """Write the file, which appears under its name only when it is whole."""
    partial = path.with_name(f"{path.name}.partial")
    try:
        with h5py.File(partial, "w") as file:
            file.attrs["default"] = "entry"
            _entry(run, _group(file, "entry", "NXentry"), user or getpass.getuser())
        os.replace(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def _group(parent: Any, name: str, kind: str) -> Any:
    group = parent.create_group(name)
    group.attrs["NX_class"] = kind
    return group


def _put(group: Any, name: str, value: Any, unit: str | None = None, **attributes: str) -> None:
    """Put a field into a group; arrays of text become UTF-8, and "" is the unit of a bare number."""
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        value = value.astype(h5py.string_dtype("utf-8"))
    group[name] = value
    if unit is not None:
        group[name].attrs["units"] = unit
    for key, text in attributes.items():
        group[name].attrs[key] = text


def _entry(run: Run, entry: Any, user: str) -> None:
    info, columns = run.info, run.readings
    entry.attrs["default"] = "data"
    _put(entry, "title", run.specimen)
    _put(entry, "entry_identifier", run.id)
    _put(entry, "start_time", info["started"])
    if info["ended"]:
        _put(entry, "end_time", info["ended"])
    _put(entry, "program_name", "goniod", version=info["version"])
    sample = _group(entry, "sample", "NXsample")
    _put(sample, "name", run.specimen)
    person = _group(entry, "user", "NXuser")
    _put(person, "name", user)
    for name in ("job", "rig"):
        note = _group(entry, name, "NXnote")
        _put(note, "type", "application/toml")
        _put(note, "description", f"the {name} file of the run")
        _put(note, "data", info[name]["text"])
    _instrument(run, _group(entry, "instrument", "NXinstrument"))
    monitor = _group(entry, "monitor", "NXmonitor")
    _put(monitor, "mode", "timer")
    _put(monitor, "data", columns["counts_monitor"], "count", long_name="counts of the lamp monitor")
    _data(run, _group(entry, "data", "NXdata"))


def _instrument(run: Run, instrument: Any) -> None:
    columns = run.readings
    _put(instrument, "name", "gonio-reflectometer of goniod")
    source = _group(instrument, "source", "NXsource")
    _put(source, "name", "lamp on the light arm")
    _put(source, "probe", "visible light")
    detector = _group(instrument, "detector", "NXdetector")
    _put(detector, "description", "photometer on the sensor arm: red, green and blue")
    _put(detector, "data", _rgb(columns, "counts"), "count", long_name="counts, the dark level included")
    _put(detector, "count_time", columns["integration_us"] * 1e-6, "s")
    _put(detector, "gain_setting", columns["gain"], "", long_name="gain step")
    for name, arm in [("light_arm", "light"), ("sensor_arm", "sensor")]:
        positioner = _group(instrument, name, "NXpositioner")
        _put(positioner, "name", f"{arm} arm")
        _put(positioner, "description", "angle from the normal, positive towards +x")
        _put(positioner, "value", columns[f"{arm}_measured_deg"], "degree")
        _put(positioner, "target_value", columns[f"{arm}_commanded_deg"], "degree")


def _data(run: Run, data: Any) -> None:
    columns = run.readings
    data.attrs["signal"] = "reflectance"
    data.attrs["axes"] = ["reading", "channel"]
    _put(data, "title", f"reflectance of {run.specimen}")
    _put(data, "reflectance", _rgb(columns, "f"), "1/sr", long_name="reflectance f_r (1/sr)")
    # NeXus has standard deviations in _errors; readings.csv has expanded uncertainties.
    _put(data, "reflectance_errors", _rgb(columns, "u") / COVERAGE, "1/sr", long_name="standard uncertainty (1/sr)")
    _put(data, "reading", columns["index"].astype(np.int64), "")
    _put(data, "channel", np.array(CHANNELS))
    for name, column, unit in AXES:
        _put(data, name, columns[column], unit)
    _put(data, "sweep", columns["sweep"])
    _put(data, "flags", columns["flags"])
    for name in ("accepted", "shadowed"):
        _put(data, name, columns[name].astype(np.int8))
    for name in ["reading", "sweep", "flags", "accepted", "shadowed", *(name for name, _, _ in AXES)]:
        data.attrs[f"{name}_indices"] = 0
    data.attrs["channel_indices"] = 1
