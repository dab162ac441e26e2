"""Arrays in, arrays out: evaluation, sampling, files and metrics."""

import threading

import goniod
import numpy as np
import pytest
from conftest import model_of, pairs
from hypothesis import given, settings
from hypothesis import strategies as st


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 4096, 10_001])
@pytest.mark.parametrize("specimen", ["gold-paint", "chrome", "black"])
def test_many_pairs_at_once_are_what_one_by_one_is(specimen, count):
    model = model_of(specimen)
    incident, exitant = pairs(count)
    # Some below the horizon, some at it, and some with no half vector.
    incident[::5, 2] *= -1.0
    incident[1::7] = [1.0, 0.0, 0.0]
    exitant[1::7] = [-1.0, 0.0, 0.0]
    assert (model.eval(incident, exitant) == model.eval_one_by_one(incident, exitant)).all()


def test_the_table_follows_the_material():
    gold = goniod.material("gold-paint")
    assert goniod.compare(gold, model_of("gold-paint"), pairs=20_000)["male"] < 0.002


def test_shapes_are_kept_and_one_direction_serves_for_all(model):
    incident, exitant = (half.reshape(4, 5, 3) for half in pairs(20))
    assert model.eval(incident, exitant).shape == (4, 5, 3)
    assert model.valid(incident, exitant[0, 0]).shape == (4, 5)
    alone = model.eval(incident[1, 2], exitant[1, 2])
    assert alone.shape == (3,) and (alone == model.eval(incident, exitant)[1, 2]).all()


def test_angles_vectors_lists_and_strides_say_the_same(model):
    angles = np.radians([[30.0, 180.0], [40.0, 10.0]])
    theta, phi = angles.T
    vectors = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    exitant = [0.0, 0.6, 0.8]
    truth = model.eval(angles, exitant)
    assert np.allclose(truth, model.eval(vectors, exitant), rtol=1e-6)
    assert (model.eval(vectors, exitant) == model.eval(vectors.tolist(), exitant)).all()
    strided = np.repeat(vectors, 2, axis=0)[::2]
    assert (model.eval(np.asfortranarray(strided), exitant) == model.eval(vectors, exitant)).all()


def test_a_result_goes_where_the_caller_wants_it(model):
    incident, exitant = pairs(100)
    rgb = np.empty((100, 3))
    assert model.eval(incident, exitant, out=rgb) is rgb
    assert (rgb == model.eval(incident, exitant)).all()
    for wrong in (np.empty((99, 3)), np.empty((100, 3), order="F"), np.empty((200, 3))[::2]):
        with pytest.raises(ValueError, match="allowed is"):
            model.eval(incident, exitant, out=wrong)
    rgb.flags.writeable = False
    with pytest.raises(ValueError, match="cannot be written"):
        model.eval(incident, exitant, out=rgb)
    with pytest.raises(TypeError):
        model.eval(incident, exitant, out=np.empty((100, 3), np.float32))
    # What is read while it is written.
    with pytest.raises(ValueError, match="cannot be written"):
        model.eval(incident, exitant, out=incident)


@pytest.mark.parametrize(
    ("incident", "exitant", "complaint"),
    [
        ([[0.0, 0.0, 2.0]], [[0.0, 0.0, 1.0]], "incident number 0"),
        ([[0.0, 0.0, np.nan]], [[0.0, 0.0, 1.0]], "incident number 0"),
        ([[0.0, 0.0, 1.0]], [[0.0, 0.0, 1.0], [np.inf, 0.0]], "inhomogeneous"),
        ([0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 1.0], "shape"),
        (1.0, [0.0, 0.0, 1.0], "shape"),
        (np.zeros((2, 2)), np.zeros((3, 2)), "equal shapes"),
    ],
)
def test_what_is_no_direction_is_refused_with_its_place(model, incident, exitant, complaint):
    with pytest.raises((ValueError, TypeError), match=complaint):
        model.eval(incident, exitant)


@settings(deadline=None, max_examples=200)
@given(st.lists(st.floats(), min_size=3, max_size=3), st.lists(st.floats(0.0, 6.3), min_size=2, max_size=2))
def test_prop_any_numbers_are_evaluated_or_refused(vector, angles):
    material = goniod.material("gold-paint")
    try:
        value = material.eval(vector, angles)
    except ValueError:
        return
    assert np.isfinite(value).all() and (value >= 0.0).all()


def test_other_threads_go_on_meanwhile(model):
    incident, exitant = pairs(2_000_000)
    started, counted = threading.Event(), 0

    def evaluate() -> None:
        started.set()
        model.eval_one_by_one(incident, exitant)

    thread = threading.Thread(target=evaluate)
    thread.start()
    started.wait()
    while thread.is_alive():
        counted += 1
    # With Python's lock held there would be a handful of turns before and after.
    assert counted > 1000


def test_densities_are_those_of_what_is_drawn(model):
    sampler, random = model.sampler(), np.random.default_rng(3)
    for theta in (0.1, 0.8, 1.3):
        viewer = [np.sin(theta), 0.0, np.cos(theta)]
        lights, densities = sampler.sample(viewer, random.random((200_000, 2)))
        assert np.allclose(densities, sampler.pdf(lights, viewer), rtol=1e-4)
        # The mean of f cos/p is the albedo.
        weights = model.eval(lights, viewer).mean(1) * lights[:, 2] / densities
        assert weights.mean() == pytest.approx(model.albedo(viewer).mean(), rel=0.01)


@pytest.mark.parametrize("name", [name for name, _, _ in goniod.formats()])
def test_every_format_is_written_and_read_back(name, tmp_path):
    paint, path = goniod.material("blue-rubber"), tmp_path / "paint"
    figures = paint.save(path, name)
    assert figures["bytes"] == path.stat().st_size
    again = goniod.compare(paint, goniod.load(path), pairs=5_000)
    assert np.isfinite(again["male"])
    if np.isfinite(figures["male"]) and figures["median"] < 0.01:
        assert again["median_rel"] < 0.02


def test_bad_files_are_told(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        goniod.load(tmp_path / "nowhere")
    (tmp_path / "text").write_text("no BRDF")
    with pytest.raises(ValueError, match="in no format that goniod reads"):
        goniod.load(tmp_path / "text")
    with pytest.raises(ValueError, match="several formats|no format"):
        goniod.material("black").save(tmp_path / "x.bsdf")


def test_models_by_name():
    gold = goniod.material("gold-paint")
    planes = [gold.read_plane(theta, np.linspace(-0.1, 0.8, 30)) for theta in (0.4, 0.9)]
    arc = np.vstack([gold.read_plane(theta, [0.0]) for theta in (0.1, 0.5, 1.0)])
    for kind in ("planes", "reciprocal", "bivariate", "separable", "auto"):
        assert goniod.compare(gold, goniod.fit(planes, arc, model=kind), pairs=2_000)["male"] < 0.05
    with pytest.raises(ValueError, match="there is no model"):
        goniod.fit(planes, arc, model="magic")
    with pytest.raises(ValueError, match="no such table"):
        goniod.fit(planes, arc, model="bivariate").table()
