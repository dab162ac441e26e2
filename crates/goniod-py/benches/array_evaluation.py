"""What evaluating an array of pairs costs on one core: ns a pair, beside the scalar evaluation and Mitsuba's `measured`.

All in one run and on the same pairs, the least of several rounds each, one after the other in every round, so that
other load disturbs all alike. With --check it fails where arrays take more than half of the time that the scalar evaluation takes.
"""

import os

# Before the libraries start their threads.
os.environ["RAYON_NUM_THREADS"] = "1"

import sys
import tempfile
import time
from pathlib import Path

import goniod
import goniod.mitsuba
import mitsuba
import numpy as np

# As many pairs as stay in a core's cache, as they do for a caller who works through a picture tile by tile. Dr.Jit gets
# them ten times over, so that starting its kernel does not count.
PAIRS, ROUNDS, REPEATED = 20_000, 300, 10


def main() -> None:
    import drjit

    mitsuba.set_variant(goniod.mitsuba.VARIANT)
    drjit.set_thread_count(0)
    model, (incident, exitant) = gold(), pairs()
    context, si = mitsuba.BSDFContext(), drjit.zeros(mitsuba.SurfaceInteraction3f, REPEATED * PAIRS)
    si.wi = mitsuba.Vector3f(*np.tile(exitant.T, REPEATED))
    wo = mitsuba.Vector3f(*np.tile(incident.T, REPEATED))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "gold.bsdf"
        model.save(path, "rgl-rgb")
        measured = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    rgb = np.empty((PAIRS, 3))
    plugin = goniod.mitsuba.bsdf(model)
    drjit.eval(si, wo)

    def rendered(bsdf: object) -> None:
        drjit.eval(bsdf.eval(context, si, wo))
        drjit.sync_thread()

    ways = {
        "arrays, eight pairs at a time": lambda: model.eval(incident, exitant, out=rgb),
        "scalar, one pair after the other": lambda: model.eval_one_by_one(incident, exitant),
        "Mitsuba's measured, RGL file": lambda: rendered(measured),
        "goniod's plugin in Mitsuba": lambda: rendered(plugin),
    }
    least = dict.fromkeys(ways, float("inf"))
    for _ in range(ROUNDS):
        for name, evaluate in ways.items():
            start = time.perf_counter()
            evaluate()
            least[name] = min(least[name], time.perf_counter() - start)
    for name in list(ways)[2:]:
        least[name] /= REPEATED
    for name, seconds in least.items():
        print(f"{name:34} {seconds / PAIRS * 1e9:7.1f} ns a pair")
    arrays, scalar, *_ = least.values()
    print(f"arrays take {arrays / scalar:.2f} of the time of the scalar evaluation; allowed is 0.50")
    if "--check" in sys.argv and arrays > 0.5 * scalar:
        sys.exit(1)


def gold() -> goniod.Model:
    """Three planes and an arc of gold paint."""
    truth = goniod.material("gold-paint")
    deviations = np.concatenate([-np.geomspace(0.3, 0.003, 12), [0.0], np.geomspace(0.003, 1.7, 24)])
    planes = [truth.read_plane(np.radians(theta), deviations) for theta in (20.0, 45.0, 70.0)]
    arc = np.vstack([truth.read_plane(np.radians(theta), [0.0]) for theta in (3.0, 20.0, 40.0, 55.0, 70.0, 80.0)])
    return goniod.fit(planes, arc)


def pairs() -> tuple[np.ndarray, np.ndarray]:
    """Pairs of directions, even in angle below 80°."""
    random = np.random.default_rng(1)
    theta, phi = np.radians(80.0) * random.random((2, PAIRS)), 2.0 * np.pi * random.random((2, PAIRS))
    vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return np.ascontiguousarray(vectors[0]), np.ascontiguousarray(vectors[1])


if __name__ == "__main__":
    main()
