"""A BSDF plugin for Mitsuba 3: the model itself in a renderer, without a file.

Everything is Dr.Jit arrays: Mitsuba traces the plugin once into its kernel, and no Python runs for a ray. The model's
small table is a Dr.Jit texture. It wants an RGB or monochromatic variant that Dr.Jit compiles, such as llvm_ad_rgb, which
needs the library of LLVM (Debian: libllvm19), or cuda_ad_rgb.

>>> import goniod, goniod.mitsuba, mitsuba
>>> mitsuba.set_variant(goniod.mitsuba.VARIANT)
>>> gold = goniod.mitsuba.bsdf(goniod.Run(run_directory).model())
>>> scene = mitsuba.load_dict({
...     "type": "scene",
...     "integrator": {"type": "path"},
...     "light": {"type": "constant"},
...     "camera": {"type": "perspective", "to_world": mitsuba.ScalarTransform4f().look_at([0, 0, 5], [0, 0, 0], [0, 1, 0])},
...     "ball": {"type": "sphere", "material": gold},
... })
>>> mitsuba.render(scene, spp=1).shape[2]
3
"""

from __future__ import annotations

from functools import cache
from itertools import count
from typing import Any

import numpy as np

from goniod._goniod import Model
from goniod.run import Run

__all__ = ["VARIANT", "bsdf", "register"]

VARIANT = "llvm_ad_rgb"
"""The variant that runs on a processor."""

# How much of what the pair of the same difference angle is brighter is believed; pdv has it as well.
_RISE = 0.4
_LOG2_E = 1.4426950408889634

_models: dict[str, Model] = {}
_numbers = count()


def register(name: str, model: Model) -> None:
    """Give a model a name by which scenes know it, also those in XML: the BSDF "goniod" with the string "model".

    The plugin is registered for the variant that is set.

    >>> import mitsuba
    >>> mitsuba.set_variant(goniod.mitsuba.VARIANT)
    >>> goniod.mitsuba.register("gold", goniod.Run(run_directory).model())
    >>> material = mitsuba.load_dict({"type": "goniod", "model": "gold"})
    >>> material = mitsuba.load_dict({"type": "goniod", "run": str(run_directory)})
    """
    _plugin(_variant())
    _models[name] = model


def bsdf(model: Model) -> Any:
    """Make a BSDF of a model, for the variant that is set.

    >>> import mitsuba
    >>> mitsuba.set_variant(goniod.mitsuba.VARIANT)
    >>> material = goniod.mitsuba.bsdf(goniod.Run(run_directory).model())
    >>> mitsuba.has_flag(material.flags(), mitsuba.BSDFFlags.GlossyReflection)
    True
    """
    import mitsuba

    name = f"model {next(_numbers)}"
    register(name, model)
    return mitsuba.load_dict({"type": "goniod", "model": name})


def _variant() -> str:
    import mitsuba

    variant = mitsuba.variant() or ""
    if not variant.startswith(("llvm", "cuda", "metal")) or "spectral" in variant or "polarized" in variant:
        raise RuntimeError(
            f"the variant of Mitsuba is {variant or 'not set'}; allowed are those of llvm and cuda with rgb or mono, such as "
            f"{VARIANT!r}"
        )
    return variant


@cache
def _plugin(variant: str) -> type:
    """Make and register the plugin of a variant; the classes that it is made of are the variant's own."""
    import drjit
    import mitsuba

    # Neither is typed for whoever writes for several variants.
    dr: Any = drjit
    mi: Any = mitsuba

    class Goniod(mi.BSDF):  # type: ignore[misc]
        """A model of goniod."""

        def __init__(self, props: Any) -> None:
            super().__init__(props)
            if "model" in props:
                name = props["model"]
                if name not in _models:
                    known = ", ".join(sorted(_models))
                    raise RuntimeError(f"no model {name!r} is registered; there are {known or 'none'}")
                model = _models[name]
            elif "run" in props:
                model = Run(props["run"]).model()
            else:
                raise RuntimeError('the BSDF "goniod" needs "model", a registered name, or "run", a run directory')
            table, rings = model.table(), model.sampler().rings()
            self.about = model.about
            self.inverse, self.cells = table["inverse"], table["cells"]
            self.light = [float(light) for light in table["light"]]
            self.rows, self.columns, _ = table["logs"].shape
            self.table = mi.Texture2f(
                mi.TensorXf(np.ascontiguousarray(table["logs"])),
                filter_mode=dr.FilterMode.Linear,
                wrap_mode=dr.WrapMode.Clamp,
            )
            self.viewers, self.rings = rings["shares"].shape
            self.shares = mi.Float(rings["shares"].ravel().astype(np.float32))
            self.own = mi.Float(rings["own"].ravel().astype(np.float32))
            self.alias = mi.UInt32(rings["alias"].ravel())
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide
            self.m_components, self.m_flags = [flags], flags

        # ---- reflectance

        def column(self, number: Any) -> Any:
            """The column of 1 + tan²(θ_h/2)/k², by its bits."""
            last_places = dr.reinterpret_array(mi.Int32, number) - dr.reinterpret_array(mi.Int32, mi.Float(1.0))
            return mi.Float(last_places) * self.cells

        def logs(self, column: Any, row: Any) -> Any:
            place = mi.Point2f((column + 0.5) / self.columns, (row + 0.5) / self.rows)
            return mi.Color3f(self.table.eval(place))

        def reflectance(self, light: Any, viewer: Any) -> Any:
            """f in 1/sr, as `pdv::PlainTable` tells."""
            total, apart = light + viewer, light - viewer
            flat = dr.square(total.x) + dr.square(total.y)
            height, product = total.z, light.z * viewer.z
            out = dr.square(light.x * viewer.y - light.y * viewer.x)
            length = flat + dr.square(height)
            cos = dr.square(height) + dr.square(apart.x) + dr.square(apart.y)
            root_length, root_cos = dr.sqrt(length), dr.sqrt(cos)
            tan = flat * self.inverse / dr.square(root_length + height)
            far_tan = 4.0 * dr.maximum(flat - out, 0.0) * self.inverse / (length * dr.square(2.0 + root_cos))
            last = self.rows - 1.0
            near = self.logs(self.column(1.0 + tan), last * dr.sqrt(product) * root_length / height)
            far = self.logs(self.column(1.0 + far_tan), last * 2.0 * dr.sqrt(product) / root_cos)
            most = _LOG2_E * out / dr.maximum(0.5 * dr.square(length) + out, dr.smallest(mi.Float))
            log = near + dr.minimum(dr.maximum(_RISE * (far - near), 0.0), most)
            rgb = dr.exp2(log) * mi.Color3f(*self.light)
            return mi.luminance(rgb) if mi.is_monochromatic else rgb

        # ---- sampling, as `pdv::Sampler` does

        def place(self, sin: Any, cos: Any) -> tuple[Any, Any]:
            """The row before a viewer's zenith angle and how far it is to the next."""
            place = dr.clip(sin / (1.0 + cos), 0.0, 1.0) * (self.viewers - 1.0)
            row = dr.minimum(mi.UInt32(place), self.viewers - 2)
            return row, place - mi.Float(row)

        def ring(self, cell: Any, sin: Any) -> tuple[Any, Any]:
            """Inner and outer d_p of a ring."""
            inner, outer = mi.Float(cell) / self.rings, mi.Float(cell + 1) / self.rings
            reach = 1.0 + sin
            return reach * dr.square(dr.square(inner)), reach * dr.square(dr.square(outer))

        def arc(self, d: Any, sin: Any, least: Any = 0.0) -> Any:
            """Angle of the ring about the mirror direction that lies on the unit disk.

            `least` is how far the ring reaches below the edge of the disk at least, where a direction is known to lie in it:
            at the horizon f32 could not tell.
            """
            inside = dr.maximum(1.0 + sin - d, least) * (1.0 + d - sin)
            crossing = 4.0 * dr.asin(dr.sqrt(dr.clip(inside / dr.maximum(4.0 * d * sin, 1e-30), 0.0, 1.0)))
            return dr.select(d <= 1.0 - sin, dr.two_pi, crossing)

        def density(self, light: Any, viewer: Any, active: Any) -> Any:
            """Density over solid angle, 1/sr."""
            sin = dr.minimum(dr.hypot(viewer.x, viewer.y), 1.0)
            row, between = self.place(sin, viewer.z)
            d = dr.hypot(light.x + viewer.x, light.y + viewer.y)
            share = dr.sqrt(dr.sqrt(d / (1.0 + sin)))
            cell = dr.minimum(mi.UInt32(share * self.rings), self.rings - 1)
            inner, outer = self.ring(cell, sin)
            at = row * self.rings + cell
            shares = dr.lerp(
                dr.gather(mi.Float, self.shares, at, active),
                dr.gather(mi.Float, self.shares, at + self.rings, active),
                between,
            )
            least = dr.square(light.z) / (1.0 + dr.hypot(light.x, light.y))
            area = (outer * outer - inner * inner) * self.arc(d, sin, least)
            return 2.0 * shares / dr.maximum(area, dr.smallest(mi.Float)) * light.z

        def draw(self, viewer: Any, number: Any, numbers: Any, active: Any) -> Any:
            """A unit vector to the light."""
            sin = dr.minimum(dr.hypot(viewer.x, viewer.y), 1.0)
            row, between = self.place(sin, viewer.z)
            after = number < between
            rest = dr.select(after, number / between, (number - between) / (1.0 - between))
            row = dr.select(after, row + 1, row)
            # One number chooses the ring, and what is left of it whether the ring's alias is meant.
            place = dr.clip(rest, 0.0, dr.one_minus_epsilon(mi.Float)) * self.rings
            cell = dr.minimum(mi.UInt32(place), self.rings - 1)
            own = dr.gather(mi.Float, self.own, row * self.rings + cell, active)
            alias = dr.gather(mi.UInt32, self.alias, row * self.rings + cell, active)
            cell = dr.select(place - mi.Float(cell) < own, cell, alias)
            inner, outer = self.ring(cell, sin)
            d = dr.sqrt(dr.lerp(inner * inner, outer * outer, numbers.x))
            sin_p, cos_p = dr.sincos((numbers.y - 0.5) * self.arc(d, sin))
            x, y = d * cos_p - sin, d * sin_p
            slanted = sin > 0.0
            along_x = dr.select(slanted, viewer.x / sin, 1.0)
            along_y = dr.select(slanted, viewer.y / sin, 0.0)
            z = dr.safe_sqrt(1.0 - x * x - y * y)
            return dr.normalize(mi.Vector3f(along_x * x - along_y * y, along_y * x + along_x * y, z))

        # ---- what Mitsuba asks

        def above(self, ctx: Any, si: Any, wo: Any, active: Any) -> Any:
            asked = ctx.is_enabled(mi.BSDFFlags.GlossyReflection, 0)
            return active & asked & (si.wi.z > 0.0) & (wo.z > 0.0)

        def sample(self, ctx: Any, si: Any, sample1: Any, sample2: Any, active: Any = True) -> Any:
            wo = self.draw(si.wi, sample1, sample2, active)
            active = self.above(ctx, si, wo, active)
            bs = mi.BSDFSample3f()
            bs.wo, bs.eta = wo, 1.0
            bs.pdf = dr.select(active, self.density(wo, si.wi, active), 0.0)
            bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
            bs.sampled_component = mi.UInt32(0)
            active &= bs.pdf > 0.0
            weight = self.reflectance(wo, si.wi) * (wo.z / bs.pdf)
            return bs, dr.select(active, weight, 0.0)

        def eval(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            active = self.above(ctx, si, wo, active)
            return dr.select(active, self.reflectance(wo, si.wi) * wo.z, 0.0)

        def pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            active = self.above(ctx, si, wo, active)
            return dr.select(active, self.density(wo, si.wi, active), 0.0)

        def eval_pdf(self, ctx: Any, si: Any, wo: Any, active: Any = True) -> Any:
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self) -> str:
            return f"Goniod[{self.about}]"

    mi.register_bsdf("goniod", lambda props: Goniod(props))
    return Goniod
