#!/usr/bin/env python3
"""Renders one specimen four times with Mitsuba, for docs/formats.png: the BRDF itself, its MERL table, its tensor file of RGL
and its fit, each as the file that `gonioctl convert` makes of it.

  picture.py GONIOCTL [SPECIMEN [FILE]]

Run it with the Python of .ci/python, which has goniod and Mitsuba. Mitsuba reads the tensor file by its own plugin
`measured`, and the fit as the parameters of its plugin `principled`; the BRDF and the table, for which it has none, are
evaluated by goniod for every ray.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import drjit as dr
import goniod
import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
import mitsuba as mi
import numpy as np

GONIOCTL = Path(sys.argv[1]).resolve()
SPECIMEN = sys.argv[2] if len(sys.argv) > 2 else "gold-paint"
FILE = sys.argv[3] if len(sys.argv) > 3 else "docs/formats.png"
SIZE, SAMPLES = 360, 64

mi.set_variant("llvm_ad_rgb")
# Every ray's directions are numbers that numpy can have, rather than part of a kernel yet to be compiled.
for flag in (dr.JitFlag.SymbolicLoops, dr.JitFlag.SymbolicCalls, dr.JitFlag.SymbolicConditionals):
    dr.set_flag(flag, False)


class Evaluated(mi.BSDF):
    """A BRDF of goniod, asked ray by ray; only lights are sampled."""

    brdfs: dict = {}

    def __init__(self, props):
        super().__init__(props)
        self.brdf = self.brdfs[props["brdf"]]
        self.m_flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide
        self.m_components = [self.m_flags]

    def eval(self, context, si, wo, active=True):
        lights, viewers = (np.array(mi.Vector3f(v), dtype=float).T for v in (wo, si.wi))
        above = (lights[:, 2] > 0) & (viewers[:, 2] > 0) & np.broadcast_to(np.array(mi.Bool(active)), len(lights))
        value = np.zeros((len(lights), 3))
        if above.any():
            unit = lambda v: v / np.linalg.norm(v, axis=1, keepdims=True)
            lit, seen = unit(lights[above]), unit(viewers[above])
            value[above] = np.maximum(self.brdf.eval(lit, seen), 0) * lit[:, 2:]
        return mi.Color3f(np.ascontiguousarray(value.T.astype(np.float32)))

    def pdf(self, context, si, wo, active=True):
        return dr.zeros(mi.Float, dr.width(wo))

    def eval_pdf(self, context, si, wo, active=True):
        return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)


mi.register_bsdf("evaluated", Evaluated)


def picture(material):
    """A ball under a window, a lamp and an even sky that lights sample alone, so that all four have the same noise."""
    transform = mi.ScalarTransform4f
    towards = lambda origin: transform().look_at(origin=origin, target=[0, 0, 0], up=[0, 1, 0])
    light = lambda origin, size, radiance: {
        "type": "rectangle",
        "to_world": towards(origin) @ transform().scale(size),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": radiance}},
    }
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 4, "bsdf_samples": 0, "hide_emitters": True},
        "sky": {"type": "constant", "radiance": 0.25},
        "window": light([-4, 4, 4], 1.2, 14.0),
        "lamp": light([5, 1, 2], 0.5, 22.0),
        "behind": light([2, 3, -5], 1.5, 9.0),
        "camera": {
            "type": "perspective",
            "fov": 24,
            "to_world": transform().look_at(origin=[0, 0, 5.4], target=[0, 0, 0], up=[0, 1, 0]),
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "gaussian"}},
            "sampler": {"type": "multijitter", "sample_count": SAMPLES},
        },
        "ball": {"type": "sphere", "material": material},
    })
    image = np.array(mi.render(scene, seed=1))[..., :3]
    assert np.isfinite(image).all()
    return image


with tempfile.TemporaryDirectory() as here:
    here = Path(here)
    for name, format in [("table.binary", "merl"), ("tensor.bsdf", "rgl-rgb"), ("fit.gltf", "gltf")]:
        subprocess.run([GONIOCTL, "convert", SPECIMEN, name, "--format", format], cwd=here, check=True)
    fit = json.loads((here / "fit.gltf").read_text())["materials"][0]
    metal = fit["pbrMetallicRoughness"]
    ior = fit["extensions"]["KHR_materials_ior"]["ior"]
    Evaluated.brdfs = {"truth": goniod.material(SPECIMEN), "merl": goniod.load(str(here / "table.binary"))}
    pictures = {
        "the BRDF itself": picture({"type": "evaluated", "brdf": "truth"}),
        "MERL table": picture({"type": "evaluated", "brdf": "merl"}),
        "tensor file of RGL": picture({"type": "measured", "filename": str(here / "tensor.bsdf")}),
        "fit: glTF, MaterialX": picture({
            "type": "principled",
            "base_color": {"type": "rgb", "value": metal["baseColorFactor"][:3]},
            "metallic": metal["metallicFactor"],
            "roughness": metal["roughnessFactor"],
            "eta": max(ior, 1.0 + 1e-3),
        }),
    }

truth = pictures["the BRDF itself"]
ball = truth.max(-1) > 0.0
rows, columns = np.mgrid[:SIZE, :SIZE]
ball &= (rows - SIZE / 2) ** 2 + (columns - SIZE / 2) ** 2 < (0.43 * SIZE) ** 2
figure, axes = plt.subplots(1, 4, figsize=(12, 3.4), dpi=100)
for axis, (title, image) in zip(axes, pictures.items()):
    error = np.abs(image - truth)[ball] / np.maximum(truth[ball], 1e-3)
    told = "" if image is truth else f"\nmedian {np.median(error):.2%}, p95 {np.quantile(error, 0.95):.2%}"
    print(title, told.strip(), flush=True)
    shown = np.clip(np.where(image <= 0.0031308, 12.92 * image, 1.055 * np.maximum(image, 1e-9) ** (1 / 2.4) - 0.055), 0, 1)
    axis.imshow(shown)
    axis.set_title(title, fontsize=11)
    axis.set_xlabel(told.strip(), fontsize=10)
    axis.set_xticks([])
    axis.set_yticks([])
figure.tight_layout()
figure.savefig(FILE, metadata={"Software": None})
