"""The page on JAX libraries: its examples run, and their derivatives agree with finite differences."""

import re

import jax
import numpy as np
import pytest
from support.folders import ROOT

import rubberfric as rf

PAGE = (ROOT / "notebooks" / "jax_libraries.md").read_text()
START, *SECTIONS = re.split(r"^## (\w+)$", PAGE, flags=re.M)
SNIPPETS = dict(zip(SECTIONS[::2], SECTIONS[1::2], strict=True))


def names_after(library):
    """Return the names of the first snippet and of the snippet of a library after they ran."""
    names = {}
    for text in (START, SNIPPETS[library]):
        (code,) = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
        exec(compile(code, f"{library} in jax_libraries.md", "exec"), names)
    return names


def difference(function, scene, path, step):
    """Return the central difference of a function of a scene, with respect to the number at a key path."""
    value = scene.lower.spectrum.hurst if path.endswith("hurst") else scene.lower.spectrum.h_rms
    ends = [float(function(scene.replace(path, value + s))) for s in (step, -step)]
    return (ends[0] - ends[1]) / (2 * step)


def test_all_libraries_are_tested():
    assert list(SNIPPETS) == ["optax", "equinox", "numpyro", "flax"]
    assert "\njax_libraries\n" in (ROOT / "notebooks" / "index.md").read_text()


@pytest.mark.slow
def test_optax():
    names = names_after("optax")
    spectrum = names["found"].lower.spectrum
    np.testing.assert_allclose([spectrum.h_rms, spectrum.hurst], [4e-4, 0.8], rtol=2e-3)
    assert names["value"] < 1e-6


def test_equinox():
    names = names_after("equinox")
    exact = jax.grad(names["loss"])(names["guess"])
    for one, other in zip(jax.tree.leaves(names["gradient"]), jax.tree.leaves(exact), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8)
    by_hurst = difference(names["loss"], names["guess"], "lower.spectrum.hurst", 1e-5)
    np.testing.assert_allclose(names["gradient"].lower.spectrum.hurst, by_hurst, rtol=1e-5)
    slope = names["slope"]
    assert len(jax.tree.leaves(slope)) == 2 and slope.scene.lower.spectrum.h_rms is None
    np.testing.assert_allclose(slope.zero, 1.0)
    mean = difference(
        lambda one: np.mean(rf.friction(one, names["velocity"], 2e5)),
        names["guess"],
        "lower.spectrum.hurst",
        1e-5,
    )
    np.testing.assert_allclose(slope.scene.lower.spectrum.hurst, mean, rtol=1e-5)


@pytest.mark.slow
def test_numpyro():
    pytest.importorskip("numpyro")
    samples = names_after("numpyro")["samples"]
    for name, value in (("hurst", 0.8), ("h_rms", 4e-4)):
        drawn = np.asarray(samples[name])
        assert abs(drawn.mean() - value) < 2 * drawn.std() < 0.4 * value


@pytest.mark.slow
def test_flax():
    pytest.importorskip("flax")
    names = names_after("flax")
    scene = names["truth"].replace("lower.spectrum.h_rms", 2e-4)
    by_h_rms = 2e-4 * difference(names["loss"], scene, "lower.spectrum.h_rms", 1e-9)
    np.testing.assert_allclose(names["slopes"]["log_h_rms"][...], by_h_rms, rtol=1e-4)
    assert names["slopes"]["out"]["kernel"][...].shape == (8, 1)
