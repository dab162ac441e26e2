"""A run directory and a daemon, both on the simulator, made by the programs of this project.

GONIOD_PROGRAMS is the folder with `gonioctl` and `goniod`; without it that of a debug build.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import goniod
import numpy as np
import pytest
from goniod.mitsuba import VARIANT

ROOT = Path(__file__).parents[3]
PROGRAMS = Path(os.environ.get("GONIOD_PROGRAMS", ROOT / "target/debug"))


class Daemon(NamedTuple):
    """Where a daemon listens, and the token with which everything is allowed."""

    url: str
    token: str
    socket: Path


@pytest.fixture(scope="session")
def run_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture("quickstart", tmp_path_factory.mktemp("runs"))


@pytest.fixture(scope="session")
def flown_directory(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture("fly", tmp_path_factory.mktemp("flown"))


def capture(job: str, out: Path) -> Path:
    """The run directory of one of the project's own jobs."""
    command = [PROGRAMS / "gonioctl", "run", ROOT / f"config/jobs/{job}.toml", "--out", out]
    answer = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert answer.returncode == 0, answer.stderr
    return Path(answer.stdout.strip())


@pytest.fixture(scope="session")
def job_toml() -> str:
    """The quickstart job, whose specimen lies on the stage already."""
    text = (ROOT / "config/jobs/quickstart.toml").read_text("utf-8")
    return f"on_stage = true\n{text}"


@pytest.fixture(scope="session")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon on the simulator, over TCP and a Unix socket."""
    folder = tmp_path_factory.mktemp("daemon")
    socket = folder / "goniod.sock"
    command = [PROGRAMS / "goniod", "--data", folder / "runs", "--listen", "127.0.0.1:0", "--listen", f"unix:{socket}"]
    with open(folder / "log", "w") as log:
        process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, cwd=ROOT)
    try:
        assert process.stdout is not None
        url = process.stdout.readline().strip()
        assert url.startswith("http://"), (folder / "log").read_text()
        tokens = (folder / "runs/tokens.toml").read_text().splitlines()
        token = next(line.split('"')[1] for line in tokens if line.startswith("operate"))
        yield Daemon(url, token, socket)
    finally:
        process.terminate()
        process.wait()


@pytest.fixture(scope="session")
def done_job(daemon: Daemon, job_toml: str) -> str:
    """The id of a job that the daemon has done."""
    client = goniod.Client(daemon.url, daemon.token)
    return str(client.wait(client.submit(job_toml))["id"])


@pytest.fixture(scope="session")
def model() -> goniod.Model:
    """A model of gold paint, of three planes and an arc as a perfect instrument reads them."""
    return model_of("gold-paint")


def model_of(specimen: str) -> goniod.Model:
    truth = goniod.material(specimen)
    deviations = np.concatenate([-np.geomspace(0.3, 0.003, 12), [0.0], np.geomspace(0.003, 1.7, 24)])
    planes = [truth.read_plane(np.radians(theta), deviations) for theta in (20.0, 45.0, 70.0)]
    arc = np.vstack([truth.read_plane(np.radians(theta), [0.0]) for theta in (3.0, 20.0, 40.0, 55.0, 70.0, 80.0)])
    return goniod.fit(planes, arc, name=specimen)


@pytest.fixture(scope="session")
def mitsuba() -> object:
    """Mitsuba with its LLVM variant, which wants the library of LLVM."""
    import mitsuba

    mitsuba.set_variant(VARIANT)
    return mitsuba


def pairs(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of directions, even in angle below 80°."""
    random = np.random.default_rng(seed)
    theta, phi = np.radians(80.0) * random.random((2, count)), 2.0 * np.pi * random.random((2, count))
    vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    return vectors[0], vectors[1]
