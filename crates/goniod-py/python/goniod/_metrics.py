"""How far an estimate of a BRDF is from the truth."""

from __future__ import annotations

import json
from math import radians
from typing import Any

from goniod._goniod import Brdf, compare_json, spheres_json


def compare(
    truth: Brdf, estimate: Brdf, *, pairs: int = 1_000_000, theta_max: float = radians(80.0), seed: int = 1
) -> dict[str, Any]:
    """Compare two BRDFs by every metric, as ``gonioctl eval`` does.

    Pairs of directions are drawn evenly in angle up to the zenith angle ``theta_max`` in rad. "male" is the mean
    |ln(1 + f cos θ_i) − ln(1 + f̂ cos θ_i)|; "median_rel", "p95_rel" and "rel_rms" are of relative errors with a floor of
    1e-3 1/sr; "log_rel_rmse", "eq4" and "eq4_black" as the documentation defines them. "channels" has each by itself.

    >>> import goniod
    >>> found = goniod.compare(goniod.material("lambert:0.5"), goniod.material("lambert:0.4"), pairs=10_000)
    >>> round(found["median_rel"], 3)
    0.2
    """
    found: dict[str, Any] = json.loads(compare_json(truth, estimate, pairs, theta_max, seed))
    return found


def spheres(truth: Brdf, estimate: Brdf) -> dict[str, float]:
    """Compare pictures of a lit sphere of both: "psnr_db" in dB, and "delta_e", the mean CIE 1976 colour difference.

    >>> import goniod
    >>> grey = goniod.material("lambert:0.5")
    >>> goniod.spheres(grey, grey)
    {'psnr_db': 120.0, 'delta_e': 0.0}
    """
    found: dict[str, float] = json.loads(spheres_json(truth, estimate))
    return found
