#!/usr/bin/env python3
"""Reads what the crate `formats` writes by programs that were not written here, and compares it with the BRDF itself.

  formats.py MATERIAL      the example of the crate `formats`

Mitsuba, OpenEXR, MaterialX and pygltflib read their own formats; MERL, RGL, ASTM, Zemax and SSDD are read by numpy as the formats' descriptions
say; Radiance makes its own files of pab-opto's text. A table must be within 1 % in the median and 5 % in 95 of 100 pairs
below 80 degrees, or the export must have been refused.
"""
import os
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import MaterialX
import mitsuba
import numpy as np
import OpenEXR
import pygltflib
import pyradiance

MATERIAL = sys.argv[1]
SPECIMENS = ["gold-paint", "chrome", "blue-rubber", "white-paint"]
PAIRS = 20_000
# Mitsuba's scalar variants are asked pair by pair.
ASKED = 4_000
FLOOR = 1e-3
WAVELENGTHS = [610.0, 550.0, 465.0]
failed = 0


def direction(theta, phi):
    return np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)


random = np.random.default_rng(1)
theta_i, theta_o = np.radians(80 * random.random((2, PAIRS)))
turn, phi_i = 2 * np.pi * random.random((2, PAIRS))
INCIDENT, EXITANT = direction(theta_i, phi_i), direction(theta_o, phi_i + turn)


def model(specimen, incident=INCIDENT, exitant=EXITANT):
    lines = np.hstack([incident, exitant])
    text = "\n".join(" ".join(map(repr, line)) for line in lines.tolist())
    answer = subprocess.run([MATERIAL, specimen], input=text, capture_output=True, text=True, check=True).stdout
    return np.array([line.split() for line in answer.splitlines()], float)


def report(reader, specimen, size, found, truth, median=0.01, p95=0.05):
    global failed
    error = np.abs(found - truth) / np.maximum(truth, FLOOR)
    half, most = np.quantile(error, [0.5, 0.95])
    cos = INCIDENT[: len(found), 2:3]
    male = np.abs(np.log1p(np.maximum(found, 0) * cos) - np.log1p(truth * cos)).mean()
    good = half <= median and most <= p95
    failed += not good
    word = "good" if good else "WRONG"
    print(f"{reader:32} {specimen:12} {size:9} bytes  median {half:8.3%}  p95 {most:8.3%}  MALE {male:.6f}  {word}", flush=True)


# ---- numpy readers, each from the description of its format


def grid(axes, values, at):
    """Linear between the nodes of three lists, held beyond them; values[a, b, c, channel]."""
    result, cells = 0.0, []
    for axis, place in zip(axes, at):
        if len(axis) == 1:
            cells.append((np.zeros(len(place), int), np.zeros(len(place))))
            continue
        index = np.clip(np.searchsorted(axis, place, side="right") - 1, 0, len(axis) - 2)
        cells.append((index, np.clip((place - axis[index]) / (axis[index + 1] - axis[index]), 0, 1)))
    for corner in range(8):
        weight, index = 1.0, []
        for (low, share), upper, axis in zip(cells, (corner & 1, corner >> 1 & 1, corner >> 2 & 1), axes):
            weight = weight * (share if upper else 1 - share)
            index.append(np.minimum(low + upper, len(axis) - 1))
        result = result + weight[:, None] * values[tuple(index)]
    return result


def half_difference(incident, exitant):
    half = incident + exitant
    half = half / np.linalg.norm(half, axis=1, keepdims=True)
    theta_h = np.arctan2(np.hypot(half[:, 0], half[:, 1]), half[:, 2])
    phi_h = np.arctan2(half[:, 1], half[:, 0])
    x = np.cos(phi_h) * incident[:, 0] + np.sin(phi_h) * incident[:, 1]
    y = np.cos(phi_h) * incident[:, 1] - np.sin(phi_h) * incident[:, 0]
    z = incident[:, 2]
    x, z = np.cos(theta_h) * x - np.sin(theta_h) * z, np.sin(theta_h) * x + np.cos(theta_h) * z
    return theta_h, np.arctan2(np.hypot(x, y), z), np.arctan2(y, x)


def merl(path):
    """Nodes at theta_h = (i/90)^2 90, theta_d = j, phi_d = k degrees; invalid neighbours are left out."""
    assert np.fromfile(path, "<i4", 3).tolist() == [90, 90, 180]
    table = np.fromfile(path, "<f8", offset=12).reshape(3, 90, 90, 180).transpose(1, 2, 3, 0)
    table = np.concatenate([table, table[:, :, :1]], 2)
    valid = (table >= 0).astype(float)
    table = np.maximum(table, 0) * np.array([1.00, 1.15, 1.66]) / 1500
    axes = [(np.arange(90) / 90) ** 2 * 90, np.arange(90.0), np.arange(181.0)]
    theta_h, theta_d, phi_d = half_difference(INCIDENT, EXITANT)
    at = [np.degrees(theta_h), np.degrees(theta_d), np.degrees(phi_d) % 180]
    return grid(axes, table, at) / grid(axes, valid, at)


def tensor(path):
    """Name, shape and numbers of each field."""
    data = Path(path).read_bytes()
    assert data[:12] == b"tensor_file\0" and data[12:14] == b"\1\0"
    types = [None, "u1", "i1", "<u2", "<i2", "<u4", "<i4", "<u8", "<i8", "<f2", "<f4", "<f8"]
    fields, at = {}, 18
    for _ in range(int.from_bytes(data[14:18], "little")):
        length = int.from_bytes(data[at : at + 2], "little")
        name = data[at + 2 : at + 2 + length].decode()
        at += 2 + length
        dimensions, kind = int.from_bytes(data[at : at + 2], "little"), data[at + 2]
        offset = int.from_bytes(data[at + 3 : at + 11], "little")
        shape = np.frombuffer(data, "<u8", dimensions, at + 11).astype(int)
        at += 11 + 8 * dimensions
        fields[name] = np.frombuffer(data, types[kind], int(shape.prod()), offset).reshape(shape)
    return fields


def rgl(path):
    """f cos = S(s) D / (4 sigma), s from u by the marginal and conditional distribution of the visible normals."""
    fields = tensor(path)
    nodes, values = fields["theta_i"].astype(float), fields["rgb"][0].astype(float)
    density = fields["vndf"][0].astype(float)
    rows = np.cumsum((density[:, :, 1:] + density[:, :, :-1]) / 2, 2)
    rows = np.concatenate([np.zeros_like(rows[:, :, :1]), rows], 2)
    total = rows[:, :, -1]
    below = np.cumsum((total[:, 1:] + total[:, :-1]) / 2, 1)
    below = np.concatenate([np.zeros_like(below[:, :1]), below], 1)
    scale = below[:, -1]
    density, rows, below = density / scale[:, None, None], rows / scale[:, None, None], below / scale[:, None]
    half = INCIDENT + EXITANT
    half = half / np.linalg.norm(half, axis=1, keepdims=True)
    theta_m = np.arctan2(np.hypot(half[:, 0], half[:, 1]), half[:, 2])
    x = np.sqrt(theta_m / (np.pi / 2))
    y = ((np.arctan2(half[:, 1], half[:, 0]) - phi_i + np.pi) / (2 * np.pi)) % 1
    t = np.clip(np.searchsorted(nodes, theta_i, side="right") - 1, 0, len(nodes) - 2)
    part = np.clip((theta_i - nodes[t]) / (nodes[t + 1] - nodes[t]), 0, 1)
    mixed = lambda table, *index: (1 - part) * table[(t, *index)] + part * table[(t + 1, *index)]
    _, height, width = density.shape
    column = np.minimum((x * (width - 1)).astype(int), width - 2)
    row = np.minimum((y * (height - 1)).astype(int), height - 2)
    fx, fy = x * (width - 1) - column, y * (height - 1) - row
    blend = lambda a, b: (1 - fy) * a + fy * b
    c0 = blend(mixed(density, row, column), mixed(density, row + 1, column))
    c1 = blend(mixed(density, row, column + 1), mixed(density, row + 1, column + 1))
    r0, r1 = mixed(rows, row, width - 1), mixed(rows, row + 1, width - 1)
    along = blend(mixed(rows, row, column), mixed(rows, row + 1, column)) + c0 * fx + (c1 - c0) * fx**2 / 2
    sx = np.clip(along / blend(r0, r1), 0, 1)
    sy = np.clip(mixed(below, row) + r0 * fy + (r1 - r0) * fy**2 / 2, 0, 1)
    side = np.linspace(0, 1, values.shape[-1])
    s = grid([nodes, side, side], values.transpose(0, 2, 3, 1), [theta_i, sy, sx])
    line = lambda name, u: np.interp(u, np.linspace(0, 1, fields[name].shape[1]), fields[name][0])
    d, sigma = line("ndf", x), line("sigma", np.sqrt(theta_i / (np.pi / 2)))
    return s * (d / (4 * sigma) / EXITANT[:, 2])[:, None]


def astm(path):
    """Rows theta_i, phi_i, theta_s, phi_s in radians; phi_s over the full circle."""
    lines = Path(path).read_text().splitlines()
    start = next(n for n, line in enumerate(lines) if line.startswith("VARS"))
    assert lines[start].split()[1] == "theta_i,phi_i,theta_s,phi_s,R,G,B"
    table = np.loadtxt(lines[start + 1 :], delimiter=",")
    assert len(table) == int(next(line for line in lines if line.startswith("NUM_POINTS")).split()[1])
    axes = [np.unique(table[:, n]) for n in (0, 2, 3)]
    assert abs(axes[2][0] + np.pi) < 1e-6 and abs(axes[2][-1] - np.pi) < 1e-6, "phi_s covers the full circle"
    values = table[np.lexsort((table[:, 3], table[:, 2], table[:, 0])), 4:].reshape(*map(len, axes), 3)
    return grid(axes, values, [theta_i, theta_o, (turn + np.pi) % (2 * np.pi) - np.pi])


RGB_OF_XYZ = np.linalg.inv([[0.4123908, 0.3575843, 0.1804808], [0.2126390, 0.7151687, 0.0721923], [0.0193308, 0.1191948, 0.9505322]])


def zemax(path):
    """Angle of incidence, azimuth and distance about the mirror direction; azimuth 0 towards the normal; XYZ."""
    words = " ".join(line for line in Path(path).read_text().splitlines() if not line.startswith("#")).split()
    lists = {}
    for name in ("AngleOfIncidence", "ScatterAzimuth", "ScatterRadial"):
        at = words.index(name)
        lists[name] = np.array(words[at + 2 : at + 2 + int(words[at + 1])], float)
    incidence, azimuth, radial = lists.values()
    blocks = []
    for name in ("TristimulusX", "TristimulusY", "TristimulusZ"):
        at = words.index(name) + 2
        size = 2 + len(azimuth) * len(radial)
        block = np.array([words[at + n * size + 2 : at + (n + 1) * size] for n in range(len(incidence))], float)
        assert words[at] == "TIS" and 0 < float(words[at + 1]) < 1.2
        blocks.append(block.reshape(len(incidence), len(azimuth), len(radial)))
    mirror = INCIDENT * [-1, -1, 1]
    out = np.stack([-np.cos(phi_i), -np.sin(phi_i), np.zeros(PAIRS)], -1)
    up = np.sin(theta_i)[:, None] * [0, 0, 1] - np.cos(theta_i)[:, None] * out
    side = np.cross(mirror, up)
    u, s, m = ((EXITANT * axis).sum(1) for axis in (up, side, mirror))
    at = [np.degrees(theta_i), np.degrees(np.abs(np.arctan2(s, u))), np.degrees(np.arctan2(np.hypot(u, s), m))]
    return grid([incidence, azimuth, radial], np.stack(blocks, -1), at) @ RGB_OF_XYZ.T


def ssdd(path):
    """Half and difference angles in degrees, the first one fastest; phi_d folded to 0 ... 90 by both symmetries."""
    head, data = Path(path).read_text().split("DATA ascii\n")
    lists = dict(line.split(" ", 1) for line in head.splitlines() if line.startswith("PARAM"))
    assert lists["PARAM_TYPE"] == "half_difference_coordinate_system"
    axes = [np.array(lists[f"PARAM{n}_LIST"].split(), float) for n in (0, 2, 3)]
    values = np.loadtxt(data.splitlines()).reshape(*map(len, axes[::-1]), 3).transpose(2, 1, 0, 3)
    theta_h, theta_d, phi_d = half_difference(INCIDENT, EXITANT)
    phi_d = np.degrees(np.abs(phi_d))
    return grid(axes, values, [np.degrees(theta_h), np.degrees(theta_d), np.minimum(phi_d, 180 - phi_d)])


# ---- programs


def by_mitsuba(path, variant, specimen, size, truth):
    global failed
    mitsuba.set_variant(variant)
    bsdf = mitsuba.load_dict({"type": "measured", "filename": str(path)})
    context, interaction = mitsuba.BSDFContext(), mitsuba.SurfaceInteraction3f()
    if variant == "scalar_spectral":
        interaction.wavelengths = [*WAVELENGTHS, 550.0]
    found = np.zeros((ASKED, 3))
    for n in range(ASKED):
        interaction.wi = mitsuba.Vector3f(*INCIDENT[n])
        value = bsdf.eval(context, interaction, mitsuba.Vector3f(*EXITANT[n]))
        found[n] = np.ravel(np.array(value))[:3] / EXITANT[n, 2]
    report(f"mitsuba {variant}", specimen, size, found, truth[:ASKED])
    if variant != "scalar_rgb":
        return
    # Importance sampling: the mean weight is the albedo, and weights differ little.
    for theta in (0.05, 0.8, 1.3):
        interaction.wi = mitsuba.Vector3f(*direction(np.array(theta), 0.3))
        samples = random.random((2000, 2))
        weights = [np.array(bsdf.sample(context, interaction, 0.5, mitsuba.Point2f(*s))[1]).mean() for s in samples]
        spread = np.std(weights) / np.mean(weights)
        good = spread < 0.25
        failed += not good
        print(f"  samples at {theta:4} rad: mean weight {np.mean(weights):.4f}, spread {spread:.3f}  {'good' if good else 'WRONG'}")


def by_openexr(path, specimen, size, name):
    global failed
    with OpenEXR.File(str(path), separate_channels=True) as picture:
        # Nothing of the file may be looked at once it is closed.
        header = {key: str(value) for key, value in picture.header().items()}
        found = np.stack([np.array(picture.channels()[c].pixels) for c in "RGB"], -1)
    text = lambda key: np.array(header[key].split(), float)
    if name == "exr":
        d_p, theta = np.meshgrid(text("d_p"), np.radians(text("theta_r_deg")))
        x = d_p - np.sin(theta)
        above = np.abs(x) < 1
        z = np.sqrt(np.maximum((1 - x) * (1 + x), 0))
        incident, exitant = np.stack([x, 0 * x, z], -1), direction(theta, 0 * theta)
    else:
        theta_h, theta_d = np.meshgrid(*(np.radians(text(key)) for key in ("theta_h_deg", "theta_d_deg")))
        across = np.stack([0 * theta_h, np.sin(theta_d), 0 * theta_h], -1)
        half = direction(theta_h, 0 * theta_h) * np.cos(theta_d)[..., None]
        incident, exitant = half + across, half - across
        above = np.minimum(incident[..., 2], exitant[..., 2]) > 0
    truth = np.zeros_like(found, float)
    truth[above] = model(specimen, incident[above], exitant[above])
    # Half an ulp of f32, and the rounding of directions that are computed in another order here.
    good = np.allclose(found, truth, rtol=1e-5, atol=1e-7)
    failed += not good
    worst = (np.abs(found - truth) / np.maximum(truth, FLOOR)).max()
    print(f"{'OpenEXR, ' + name:32} {specimen:12} {size:9} bytes  worst pixel {worst:.1e}  {'good' if good else 'WRONG'}")


def by_radiance(path, specimen, size):
    """pabopto2bsdf fits lobes, bsdf2klems averages them over patches of some 10 degrees: the whole must be the albedo."""
    global failed
    home = Path(pyradiance.__file__).parent
    environment = {**os.environ, "PATH": f"{home}/bin:{os.environ['PATH']}", "RAYPATH": f"{home}/lib"}
    run = lambda *words, **more: subprocess.run(words, env=environment, check=True, capture_output=True, **more).stdout
    with tempfile.TemporaryDirectory() as folder:
        run("tar", "xf", path, "-C", folder)
        every = sorted(Path(folder).glob("*.txt"))
        # Six angles and some hundred directions each are plenty for a fit of lobes.
        files = every[:: max(1, len(every) // 6)]
        for file in files:
            lines = file.read_text().splitlines()
            rows = [line for line in lines if not line.startswith("#")]
            head = [line for line in lines if line.startswith("#")]
            file.write_text("\n".join(head + rows[:: max(1, len(rows) // 800)]) + "\n")
        sir = Path(folder) / "x.sir"
        sir.write_bytes(run("pabopto2bsdf", "-n", "2", *map(str, files)))
        klems = Path(folder) / "k.xml"
        klems.write_bytes(run("bsdf2klems", "-p", str(sir)))
        tree = ElementTree.parse(klems)
    spaces = "{http://windows.lbl.gov}"
    for block in tree.iter(f"{spaces}WavelengthData"):
        kind = block.findtext(f"{spaces}Wavelength")
        inner = block.find(f"{spaces}WavelengthDataBlock")
        if inner is not None and "Reflection" in inner.findtext(f"{spaces}WavelengthDataDirection") and "Visible" in kind:
            numbers = np.array(inner.findtext(f"{spaces}ScatteringData").replace(",", " ").split(), float)
            values = numbers.reshape(145, 145)
            break
    # Solid angles of the Klems full basis, projected: rings by their zenith angles in degrees and numbers of patches.
    edges = np.radians([0, 5, 15, 25, 35, 45, 55, 65, 75, 90])
    counts = [1, 8, 16, 20, 24, 24, 24, 16, 12]
    projected = np.concatenate(
        [np.full(n, np.pi * (np.sin(b) ** 2 - np.sin(a) ** 2) / n) for a, b, n in zip(edges, edges[1:], counts)]
    )
    # Columns of some bases are incident patches and rows exitant ones; a reciprocal specimen does not mind.
    albedo = values @ projected
    sample = random.random((4000, 2))
    out = direction(np.arcsin(np.sqrt(sample[:, 0])), 2 * np.pi * sample[:, 1])
    luminance = np.array([0.2126390, 0.7151687, 0.0721923])
    for name, patch, theta in (("0 deg", 0, 0.0), ("40 deg", 50, 40.0)):
        incident = np.tile(direction(np.radians(theta), 0.0), (len(out), 1))
        # About the lobe, too, which cosine-weighted directions would miss.
        truth = float((model(specimen, incident, out) @ luminance).mean() * np.pi)
        good = abs(albedo[patch] / truth - 1) < 0.15
        failed += not good
        print(f"{'radiance, Klems at ' + name:32} {specimen:12} {size:9} bytes  albedo {albedo[patch]:.4f} of {truth:.4f}  {'good' if good else 'WRONG'}")


def by_material_libraries(mtlx, gltf, specimen):
    """MaterialX finds the document valid and knows every input; both files hold the same parameters."""
    global failed
    document, library = MaterialX.createDocument(), MaterialX.createDocument()
    MaterialX.readFromXmlFile(document, str(mtlx))
    folders, path = MaterialX.getDefaultDataLibraryFolders(), MaterialX.getDefaultDataSearchPath()
    MaterialX.loadLibraries(folders, path, library)
    document.importLibrary(library)
    surface = MaterialX.getShaderNodes(document.getMaterialNodes()[0])[0]
    known = surface.getNodeDef()
    inputs = {one.getName(): one.getValue() for one in surface.getInputs()}
    good = document.validate()[0] and all(known.getActiveInput(name) is not None for name in inputs)
    material = pygltflib.GLTF2.gltf_from_json(gltf.read_text()).materials[0]
    metallic = material.pbrMetallicRoughness
    pairs = [
        *zip(inputs["base_color"].asTuple(), metallic.baseColorFactor),
        (inputs["base_metalness"], metallic.metallicFactor),
        (inputs["specular_roughness"], metallic.roughnessFactor),
        (inputs["specular_ior"], material.extensions["KHR_materials_ior"]["ior"]),
    ]
    good = good and np.allclose(*zip(*pairs), atol=1e-3)
    failed += not good
    print(f"{'MaterialX and pygltflib':32} {specimen:12} {'good' if good else 'WRONG'}")


FORMATS = "merl rgl-rgb rgl-spectral astm zemax ssdd exr exr-half-difference pab-opto materialx gltf".split()
NUMPY = {"merl": merl, "rgl-rgb": rgl, "astm": astm, "zemax": zemax, "ssdd": ssdd}
with tempfile.TemporaryDirectory() as folder:
    for specimen in SPECIMENS:
        truth = model(specimen)
        for name in FORMATS:
            path = Path(folder) / f"{specimen}-{name}.file"
            written = subprocess.run([MATERIAL, specimen, name, str(path)], capture_output=True, text=True)
            if written.returncode:
                refused = "does not hold this specimen" in written.stderr
                failed += not refused
                print(f"{name:32} {specimen:12} refused: {written.stderr.strip()[:160]}")
                continue
            size = path.stat().st_size
            if name in NUMPY:
                report(f"numpy, {name}", specimen, size, NUMPY[name](path), truth)
            if name == "rgl-rgb":
                by_mitsuba(path, "scalar_rgb", specimen, size, truth)
            if name == "rgl-spectral":
                by_mitsuba(path, "scalar_spectral", specimen, size, truth)
            if name.startswith("exr"):
                by_openexr(path, specimen, size, name)
            if name == "gltf":
                by_material_libraries(path.with_name(f"{specimen}-materialx.file"), path, specimen)
            if name == "pab-opto" and specimen in ("gold-paint", "white-paint"):
                by_radiance(path, specimen, size)
print(f"formats: {failed} failed")
sys.exit(bool(failed))
