"""Measured reflectance in Python: BRDFs, models of readings, run directories and the daemon of a gonio-reflectometer.

Directions are unit vectors in the specimen frame, shape (…, 3), with z along the normal, or zenith angle and azimuth in
rad, shape (…, 2). Reflectance is linear RGB in 1/sr. What works on arrays lets go of Python's lock and uses all cores.

>>> import goniod, numpy as np
>>> gold = goniod.material("gold-paint")
>>> planes = [gold.read_plane(theta, np.linspace(-0.05, 0.6, 40)) for theta in (0.4, 0.8, 1.2)]
>>> arc = np.vstack([gold.read_plane(theta, [0.0]) for theta in (0.1, 0.5, 0.9, 1.3)])
>>> model = goniod.fit(planes, arc)
>>> goniod.compare(gold, model, pairs=10_000)["male"] < 0.01
True
"""

from goniod._fit import fit
from goniod._goniod import Brdf, Factor, Model, Sampler, formats, load, material, materials
from goniod._metrics import compare, spheres
from goniod.client import Client, DaemonError, Event, JobError
from goniod.run import Run

__all__ = [
    "Brdf",
    "Client",
    "DaemonError",
    "Event",
    "Factor",
    "JobError",
    "Model",
    "Run",
    "Sampler",
    "compare",
    "fit",
    "formats",
    "load",
    "material",
    "materials",
    "spheres",
]
