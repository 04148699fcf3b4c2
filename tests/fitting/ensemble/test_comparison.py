"""Tables of fits: which scene predicts best, when the data cannot tell, and what is no comparison."""

import dataclasses

import numpy as np
import pytest
from support.scenes.fits import AFFINE, FAST

import fitting
import rubberfric as rf
from fitting import Bounded, FrictionData, Positive
from fitting.uncertainty.criteria import criteria

V = np.logspace(-5, 0, 14)
PLAIN = rf.Scene(rf.Body(rf.Rigid(), AFFINE), rf.Body(rf.Prony(3e6, [5e7, 8e6], [1e-5, 1e-3])))
SHEARED = PLAIN.replace(shear=rf.ContactShear(tau_f0=3e5, c=0.1, v0=1e-3))
SIZE, PREFACTOR, TAU = "lower.spectrum.h_rms", "gamma", "shear.tau_f0"


def measured(scene, seed, sigma=0.03):
    noise = np.exp(sigma * np.random.default_rng(seed).standard_normal(V.size))
    return FrictionData(V, rf.friction(scene, V, 3e5, quadrature=FAST) * noise, pressure=3e5, relative=sigma)


@pytest.fixture(scope="module")
def fits():
    """Data of a sheared scene: fitted without, with, and with one number more than it takes."""
    data = measured(SHEARED, 1)
    free = {SIZE: Positive()}
    more = free | {TAU: Positive()}
    options = {"quadrature": FAST}
    return {
        "plain": fitting.fit(PLAIN, data, free, **options),
        "sheared": fitting.fit(SHEARED, data, more, **options),
        "both": fitting.fit(SHEARED, data, more | {PREFACTOR: Bounded(0.0, 1.0)}, **options),
    }


def test_what_is_missing_shows_and_what_is_too_much_does_not(fits):
    table = fitting.compare(fits)
    assert {one.name for one in table.alike} == {"sheared", "both"}
    assert table.best == "sheared"
    assert [one.name for one in table.variants][-1] == "plain"
    assert table.variants[0].worse == 0 and table.variants[0].worse_stderr == 0
    plain = table["plain"]
    assert plain.worse > 2.5 * plain.worse_stderr and plain.explains is False
    differences = 2 * (criteria(fits[table.variants[0].name]).left_out - criteria(fits["plain"]).left_out)
    np.testing.assert_allclose(plain.worse, differences.sum(), rtol=1e-12)
    np.testing.assert_allclose(plain.worse_stderr, np.sqrt(14) * np.std(differences, ddof=1), rtol=1e-12)
    assert plain.chisqr == fits["plain"].chisqr and plain.parameters == pytest.approx(1.0)
    text = table.report()
    assert "the data cannot tell 'sheared', 'both' apart" in text.replace(
        "'both', 'sheared'", "'sheared', 'both'"
    )
    assert "the simplest is 'sheared' (2 numbers)" in text
    assert "'plain' predicts worse than " in text and "explains" in text.splitlines()[0]
    frame = table.to_dataframe()
    np.testing.assert_allclose(frame.loc["plain", "loo"], plain.loo)
    page = table._repr_html_()
    assert "<table" in page and "cannot tell" in page and "AICc" in page
    assert repr(table) == "<Comparison: 3 fits, best 'sheared'>"


def test_names_say_what_the_scenes_have(fits):
    table = fitting.compare(list(fits.values()))
    assert {one.name for one in table.variants} == {"plain", "shear", "shear #2"}
    table = fitting.compare([fits["plain"], fits["plain"]])
    assert table.words[0].startswith("the data cannot tell 'plain', 'plain #2' apart")


def test_the_least_wrong_is_called_so(fits):
    bare = dataclasses.replace(fits["plain"])
    table = fitting.compare({"one": fits["plain"], "two": bare})
    assert any(line.startswith("NONE OF THEM EXPLAINS THE DATA") for line in table.words)
    failed = dataclasses.replace(bare, status=3)
    table = fitting.compare({"one": fits["plain"], "two": failed})
    assert any("the fit of 'two' did not succeed" in line for line in table.words)


def test_a_value_that_decides_alone_is_named():
    v = np.array([1e-5, 1e-4, 1e-3])
    mu = np.asarray(rf.friction(SHEARED, v, 3e5, quadrature=FAST))
    data = FrictionData(v, mu, pressure=3e5, relative=[0.3, 0.3, 0.003])
    options = {"quadrature": FAST}
    pair = [fitting.fit(scene, data, {SIZE: Positive()}, **options) for scene in (SHEARED, PLAIN)]
    words = " ".join(fitting.compare(pair).words)
    assert "LOO is not reliable, 1 value alone determines a number of the scene, first" in words
    assert "at velocity = 0.001 m/s" in words


def test_what_is_no_comparison(fits):
    free = {SIZE: Positive()}
    other = fitting.fit(PLAIN, measured(SHEARED, 2), free, quadrature=FAST)
    robust = fitting.fit(PLAIN, measured(SHEARED, 1), free, quadrature=FAST, loss="huber")
    scaled = fitting.fit(PLAIN, measured(SHEARED, 1), free, quadrature=FAST, scale_errors=True)
    one = fits["plain"]
    two_sets = dataclasses.replace(one, data=one.data * 2)
    for results, text in (
        ([one], "results: has 1 fits: must have two at least"),
        (one, "results is a FitResult: must be FitResults in a list or a dict"),
        ([one, 3], "results[1]: is a int: must be a FitResult"),
        ({"a": one, "b": other}, "'b' and 'a': data[0], "),
        ({"a": one, "b": two_sets}, "'b' and 'a' are fits of 2 and 1 data sets: must be of the same data"),
        ({"a": one, "b": robust}, "losses are ('huber', 1.345) and ('linear', 1.0): must be the same"),
        ({"a": one, "b": scaled}, "errors of one are scaled by the scatter: must be of both, or of none"),
    ):
        with pytest.raises(ValueError, match="must") as caught:
            fitting.compare(results)
        assert text in str(caught.value) and "\n" not in str(caught.value)
