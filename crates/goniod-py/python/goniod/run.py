"""A run directory: what was measured, with units and uncertainties."""

from __future__ import annotations

import csv
import json
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from goniod._fit import fit
from goniod._goniod import Brdf, Model, load, model_of_job

if TYPE_CHECKING:
    import xarray

CHANNELS = ("red", "green", "blue")
"""The channels, in the order in which arrays have them."""

COVERAGE = 2.0
"""The coverage factor k of the uncertainties that a run directory states."""

_TEXTS = ("sweep", "flags")
_TRUTHS = ("accepted", "shadowed")
# Share of a reflectance that one reading differs from the next of the same pose by, as the reconstruction has it.
_REPRODUCIBLE = 0.01


class Run:
    """A run directory, as ``gonioctl run`` and the daemon leave it.

    >>> run = goniod.Run(run_directory)
    >>> run.specimen
    'gold paint, simulated'
    >>> run.readings["f_r"].shape == run.readings["theta_r_deg"].shape
    True
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        """Open the run directory at ``path``; ``FileNotFoundError`` where that is none.

        >>> goniod.Run("/nowhere")
        Traceback (most recent call last):
            ...
        FileNotFoundError: /nowhere has no run.json and readings.csv; `gonioctl reconstruct` makes them of a journal
        """
        self.path = Path(path)
        if not all((self.path / name).is_file() for name in ("run.json", "readings.csv")):
            raise FileNotFoundError(
                f"{self.path} has no run.json and readings.csv; `gonioctl reconstruct` makes them of a journal"
            )
        self.info: dict[str, Any] = json.loads((self.path / "run.json").read_text("utf-8"))

    def __repr__(self) -> str:
        return f"<goniod run {self.id} of {self.specimen}>"

    @property
    def id(self) -> str:
        """The id of the run, never reused.

        >>> len(goniod.Run(run_directory).id)
        26
        """
        return str(self.info["id"])

    @property
    def job(self) -> str:
        """The text of the job file.

        >>> "[[plane]]" in goniod.Run(run_directory).job
        True
        """
        return str(self.info["job"]["text"])

    @cached_property
    def report(self) -> dict[str, Any]:
        """What report.json says: verdict, checks and errors; empty where there is none.

        >>> goniod.Run(run_directory).report["verdict"]
        'good'
        """
        path = self.path / "report.json"
        return json.loads(path.read_text("utf-8")) if path.is_file() else {}

    @property
    def specimen(self) -> str:
        """What lay on the stage, in the words of the job.

        >>> goniod.Run(run_directory).specimen
        'gold paint, simulated'
        """
        return str(self.report.get("specimen", ""))

    @cached_property
    def readings(self) -> dict[str, NDArray[Any]]:
        """The columns of readings.csv, a row a reading; what a reading does not have is NaN.

        >>> run = goniod.Run(run_directory)
        >>> {"arc", "dark", "plane 0", "plane 1", "plane 2"} <= set(run.readings["sweep"].tolist())
        True
        """
        with open(self.path / "readings.csv", newline="", encoding="utf-8") as file:
            rows = list(csv.reader(file))
        columns = zip(*rows[1:]) if len(rows) > 1 else ((),) * len(rows[0])
        return {name: _column(name, texts) for name, texts in zip(rows[0], columns)}

    def observations(self) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """What the model is made of: the rows of each plane and of the arc, as ``goniod.fit`` takes them.

        Readings that do not count, that are in shadow or that have no reflectance are left out. Several of one pose are one
        row: their mean by inverse variance.

        >>> planes, arc = goniod.Run(run_directory).observations()
        >>> [len(plane) for plane in planes], len(arc)
        ([14, 14, 14], 6)
        """
        names = {str(name) for name in self.readings["sweep"] if str(name).startswith("plane ")}
        planes = [self._observed(name) for name in sorted(names, key=lambda name: int(name.removeprefix("plane ")))]
        return planes, self._observed("arc")

    def _observed(self, sweep: str) -> NDArray[np.float64]:
        columns = self.readings
        rgb = _rgb(columns, "f")
        keep = (columns["sweep"] == sweep) & columns["accepted"] & ~columns["shadowed"] & np.isfinite(rgb).all(1)
        outwards = columns["phi_p_deg"] > 90.0
        rows = np.column_stack(
            [np.radians(columns["theta_r_deg"]), np.where(outwards, -columns["d_p"], columns["d_p"]), rgb]
        )[keep]
        goals = np.column_stack([columns["light_commanded_deg"], columns["sensor_commanded_deg"]])[keep]
        relative = np.linalg.norm(np.nan_to_num(_rgb(columns, "u")[keep]), axis=1) / COVERAGE
        relative /= np.maximum(np.abs(rows[:, 2:].sum(1)), np.finfo(float).tiny)
        weights = 1.0 / (relative**2 + _REPRODUCIBLE**2)
        poses: dict[tuple[float, float], list[int]] = {}
        for at, (light, sensor) in enumerate(goals):
            poses.setdefault((light, sensor), []).append(at)
        visits = [np.average(rows[at], axis=0, weights=weights[at]) for at in poses.values()]
        return np.array(visits).reshape(-1, 5)

    def model(self, kind: str | None = None) -> Model:
        """Make the model of the readings anew: the one that the job asks for, or ``kind``, as ``goniod.fit`` names them.

        >>> run = goniod.Run(run_directory)
        >>> goniod.compare(run.model(), run.brdf(), pairs=10_000)["median_rel"] < 0.01
        True
        """
        planes, arc = self.observations()
        kind = model_of_job(self.job) if kind is None else kind
        return fit(planes, arc, model=kind, job=self.job, name=self.specimen)

    def brdf(self) -> Brdf:
        """Read the reconstruction that the run directory holds, brdf.binary: a MERL table.

        >>> goniod.Run(run_directory).brdf().eval([0, 0, 1], [0, 0, 1]).shape
        (3,)
        """
        return load(self.path / "brdf.binary")

    def to_xarray(self) -> xarray.Dataset:
        """Give the readings as an xarray dataset with units, over the dimensions "reading" and "channel".

        "reflectance" is in 1/sr, and "reflectance_uncertainty" its expanded uncertainty, k = 2; angles are in degrees and
        coordinates of the readings.

        >>> data = goniod.Run(run_directory).to_xarray()
        >>> data.reflectance.attrs["units"], data.theta_r.attrs["units"]
        ('1/sr', 'degree')
        >>> data.reflectance.sel(channel="green").where(data.sweep == "arc", drop=True).size
        6
        """
        from goniod._dataset import dataset

        return dataset(self)

    def to_nexus(self, path: str | PathLike[str], *, user: str | None = None) -> None:
        """Write the readings as a NeXus file (HDF5), with units and uncertainties.

        The group "data" (NXdata) has "reflectance" and "reflectance_errors", the standard uncertainty, k = 1, as NeXus has
        errors. ``user`` is who answers for the file; without it the one who writes it.

        >>> import h5py, pathlib, tempfile
        >>> path = pathlib.Path(tempfile.mkdtemp()) / "run.nxs"
        >>> goniod.Run(run_directory).to_nexus(path)
        >>> with h5py.File(path) as file:
        ...     file["entry/data/reflectance"].attrs["units"]
        '1/sr'
        """
        from goniod._nexus import write

        write(self, Path(path), user)


def _rgb(columns: dict[str, NDArray[Any]], name: str) -> NDArray[np.float64]:
    """Three columns of a name as one array, shape (readings, 3)."""
    return np.column_stack([columns[f"{name}_{channel}"] for channel in "rgb"])


def _column(name: str, texts: tuple[str, ...]) -> NDArray[Any]:
    """A column of readings.csv by what its name says that it holds."""
    if name in _TEXTS:
        return np.array(texts, dtype=str)
    if name in _TRUTHS:
        return np.array([text == "true" for text in texts], dtype=bool)
    return np.array([float(text) if text else np.nan for text in texts], dtype=float)
