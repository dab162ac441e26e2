#!/usr/bin/env python3
"""Reads a run's brdf.binary with numpy alone and compares it with the run's model.

  merl_numpy.py RUN_DIR MODEL_VALUES      the second is the example of the tests crate
"""
import subprocess
import sys

import numpy as np

run_dir, model_values = sys.argv[1:]
path = run_dir + "/brdf.binary"
assert np.fromfile(path, "<i4", 3).tolist() == [90, 90, 180]
table = np.fromfile(path, "<f8", offset=12).reshape(3, 90, 90, 180)
f = table * (np.array([1.00, 1.15, 1.66]) / 1500)[:, None, None, None]

# The directions of the nodes, by the description of the format.
i, j, k = np.meshgrid(np.arange(90), np.arange(90), np.arange(180), indexing="ij")
theta_h, theta_d, phi_d = (i / 90) ** 2 * np.pi / 2, np.radians(j), np.radians(k)


def from_half(x, y, z):
    return np.stack([x * np.cos(theta_h) + z * np.sin(theta_h), y, z * np.cos(theta_h) - x * np.sin(theta_h)], -1)


x, y, z = np.sin(theta_d) * np.cos(phi_d), np.sin(theta_d) * np.sin(phi_d), np.cos(theta_d)
incident, exitant = from_half(x, y, z), from_half(-x, -y, z)
lowest = np.minimum(incident[..., 2], exitant[..., 2])
assert (table[:, lowest < -1e-9] == -1).all(), "below the horizon stands -1"

above = np.flatnonzero(lowest > 1e-9)[::97]
lines = np.hstack([incident.reshape(-1, 3)[above], exitant.reshape(-1, 3)[above]])
text = "\n".join(" ".join(map(repr, line)) for line in lines.tolist())
answer = subprocess.run([model_values, run_dir], input=text, capture_output=True, text=True, check=True).stdout
model = np.array([line.split() for line in answer.splitlines()], float).T
stored = f.reshape(3, -1)[:, above]
worst = np.abs(stored / model - 1).max()
passed = worst < 1e-12
print(f"brdf.binary in numpy: {above.size} nodes, worst relative difference {worst:.1e}")
print(f"numpy: {int(passed)} passed, {int(not passed)} failed")
sys.exit(not passed)
