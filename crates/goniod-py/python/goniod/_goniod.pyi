from collections.abc import Sequence
from os import PathLike
from typing import Any, Literal, TypedDict, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import disjoint_base

__all__ = [
    "Brdf",
    "Factor",
    "Model",
    "Sampler",
    "compare_json",
    "fit_rows",
    "formats",
    "load",
    "material",
    "materials",
    "model_of_job",
    "spheres_json",
]

_Float = NDArray[np.float64]

class _Figures(TypedDict):
    format: str
    bytes: int
    male: float
    median: float
    p95: float

class _Table(TypedDict):
    logs: NDArray[np.float32]
    inverse: float
    cells: float
    light: list[bool]

class _Rings(TypedDict):
    shares: _Float
    own: _Float
    alias: NDArray[np.uint32]

@disjoint_base
class Brdf:
    @property
    def name(self) -> str: ...
    def eval(self, incident: ArrayLike, exitant: ArrayLike, *, out: _Float | None = None) -> _Float: ...
    def eval_one_by_one(self, incident: ArrayLike, exitant: ArrayLike) -> _Float: ...
    def valid(self, incident: ArrayLike, exitant: ArrayLike) -> NDArray[np.bool_]: ...
    def albedo(self, exitant: ArrayLike) -> _Float: ...
    def read_plane(
        self, theta_r: float, deviations: Sequence[float] | _Float
    ) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]: ...
    def save(
        self, path: str | PathLike[str], format: str | None = None, *, specimen: str | None = None
    ) -> _Figures: ...

@final
class Model(Brdf):
    @property
    def about(self) -> str: ...
    def extrapolated(self, incident: ArrayLike, exitant: ArrayLike) -> NDArray[np.bool_]: ...
    def factors(self) -> list[Factor]: ...
    def sampler(self) -> Sampler: ...
    def table(self) -> _Table: ...

@final
class Factor:
    @property
    def name(self) -> Literal["F", "G"]: ...
    @property
    def variable(self) -> str: ...
    @property
    def rows(self) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]: ...

@final
class Sampler:
    def sample(self, exitant: ArrayLike, numbers: ArrayLike) -> tuple[_Float, _Float]: ...
    def pdf(self, incident: ArrayLike, exitant: ArrayLike) -> _Float: ...
    def rings(self) -> _Rings: ...

def load(path: str | PathLike[str]) -> Brdf: ...
def material(name: str) -> Brdf: ...
def materials() -> list[str]: ...
def formats() -> list[tuple[str, str, str]]: ...
def fit_rows(
    planes: list[np.ndarray[tuple[int, int], np.dtype[np.float64]]],
    arc: np.ndarray[tuple[int, int], np.dtype[np.float64]],
    kind: str,
    job: str | None,
    name: str,
) -> Model: ...
def model_of_job(job: str) -> str: ...
def compare_json(truth: Brdf, estimate: Brdf, pairs: int, theta_max: float, seed: int) -> str: ...
def spheres_json(truth: Brdf, estimate: Brdf) -> str: ...
