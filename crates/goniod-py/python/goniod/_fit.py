"""Models of readings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from goniod._goniod import Model, fit_rows


def fit(
    planes: Sequence[ArrayLike],
    arc: ArrayLike | None = None,
    *,
    model: str = "planes",
    job: str | None = None,
    name: str = "a model of readings",
) -> Model:
    """Make a model of the readings of planes and of a mirror arc.

    Each sweep has a row a reading: zenith angle θ_r of the sensor in rad, signed deviation from the mirror direction
    (positive towards the normal), and red, green and blue in 1/sr; ``Brdf.read_plane`` makes such rows. ``model`` is
    "planes", "reciprocal", "bivariate", "separable" or "auto". With the text of a job file in ``job`` the model is good for
    the scene that the job names. ``name`` is what the model is called.

    Raises ``ValueError`` where the readings make no model; it says why.

    >>> import goniod
    >>> grey = goniod.material("lambert:0.5")
    >>> model = goniod.fit([grey.read_plane(0.5, [-0.2, 0.0, 0.3])])
    >>> model.eval([0, 0, 1], [0, 0, 1]).round(2).tolist()
    [0.16, 0.16, 0.16]
    >>> goniod.fit([])
    Traceback (most recent call last):
        ...
    ValueError: factor G has no finite value (0 dropped), at least one is needed
    """
    return fit_rows([_rows(plane) for plane in planes], _rows([] if arc is None else arc), model, job, name)


def _rows(sweep: ArrayLike) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    rows = np.asarray(sweep, float)
    if rows.size == 0:
        return np.empty((0, 5))
    if rows.ndim != 2:
        raise ValueError(f"a sweep has the shape {rows.shape}; allowed is (N, 5): θ_r, deviation, red, green and blue")
    return rows
