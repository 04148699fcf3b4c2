"""Tables of fits: the best scene, indistinguishable scenes, and invalid comparisons."""

import dataclasses
import functools

import numpy as np
import pytest
from support.ensembles.checks import refused
from support.scenes.fits import E_INF, FAST, ROAD, E, modulus_data

import fitting
import rubberfric as rf
from fitting import Free, ModulusData
from fitting.uncertainty.criteria import criteria

OMEGA = np.logspace(0, 6, 14)
TERMS = ([5e7, 8e6, 1e5], [1e-5, 1e-3, 1e-4])  # moduli [Pa] and relaxation times [s]
SHEAR = rf.ContactShear(tau_f0=3e5, c=0.1, v0=1e-3)
FREE = {E: Free(), E_INF: Free()}


def scene(terms, **parts):
    """Return a rubber with `terms` terms, which may be too few or too many."""
    rubber = rf.Prony(3e6, TERMS[0][:terms], TERMS[1][:terms])
    return rf.Scene(ROAD, rf.Body(rubber), **parts)


def measured(seed):
    return modulus_data(scene(2).upper.material, OMEGA, 0.03, seed)


def fitted(terms, data, **options):
    parts = {"shear": SHEAR} if terms > 1 else {}
    return fitting.fit(scene(terms, **parts), data, FREE, quadrature=FAST, **options)


@pytest.fixture(scope="module")
def fits():
    """Data of two terms: fitted with one, with two, and with one more than it takes."""
    return {name: fitted(terms, measured(1)) for name, terms in (("one", 1), ("two", 2), ("three", 3))}


def test_what_is_missing_shows_and_what_is_too_much_does_not(fits):
    table = fitting.compare(fits)
    assert {one.name for one in table.alike} == {"two", "three"}
    assert table.best == "two"
    assert [one.name for one in table.variants][-1] == "one"
    assert table.variants[0].worse == 0 and table.variants[0].worse_stderr == 0
    one = table["one"]
    assert one.worse > 4 * one.worse_stderr and one.explains is False
    differences = 2 * (criteria(fits[table.variants[0].name]).left_out - criteria(fits["one"]).left_out)
    np.testing.assert_allclose(one.worse, differences.sum(), rtol=1e-12)
    np.testing.assert_allclose(one.worse_stderr, np.sqrt(28) * np.std(differences, ddof=1), rtol=1e-12)
    assert one.chisqr == fits["one"].chisqr and one.parameters == pytest.approx(2.0)
    text = table.report()
    assert "the data cannot tell 'two', 'three' apart" in text.replace("'three', 'two'", "'two', 'three'")
    assert "the simplest is 'two' (3 numbers determined by the data)" in text
    assert "'one' predicts worse than " in text and "explains" in text.splitlines()[0]
    frame = table.to_dataframe()
    np.testing.assert_allclose(frame.loc["one", "loo"], one.loo)
    page = table._repr_html_()
    assert "<table" in page and "cannot tell" in page and "AICc" in page
    assert repr(table) == "<Comparison: 3 fits, best 'two'>"


def test_names_and_the_least_wrong(fits):
    table = fitting.compare(list(fits.values()))
    assert {one.name for one in table.variants} == {"plain", "shear", "shear #2"}
    table = fitting.compare([fits["one"], fits["one"]])
    assert table.words[0].startswith("the data cannot tell 'plain', 'plain #2' apart")
    bare = dataclasses.replace(fits["one"])
    table = fitting.compare({"one": fits["one"], "two": bare})
    assert any(line.startswith("NONE OF THEM EXPLAINS THE DATA") for line in table.words)
    failed = dataclasses.replace(bare, status=3)
    table = fitting.compare({"one": fits["one"], "two": failed})
    assert any("the fit of 'two' did not converge" in line for line in table.words)


def test_priors_that_differ_are_named(fits):
    """Their order does not matter, even if two of them are equal."""
    modulus, same = fitting.Gaussian(8e7, 1e7), fitting.Gaussian(8e7, 1e7)
    first, other_order = {E: modulus, E_INF: same}, {E_INF: same, E: modulus}
    for second, differ in ((other_order, False), ({E: modulus}, True)):
        results = [dataclasses.replace(fits["one"], prior=prior) for prior in (first, second)]
        assert any("their priors differ" in line for line in fitting.compare(results).words) == differ


def test_a_value_that_decides_alone_is_named():
    data = ModulusData([1.0, 2.0, 1e5], [3e6, 3e6, 3e7], [8e3, 2e4, 3e7], relative=[0.3, 0.3, 0.003])
    pair = [fitted(terms, data) for terms in (1, 2)]
    words = " ".join(fitting.compare(pair).words)
    assert "LOO is not reliable, 2 values alone determine a number of the scene, first" in words
    assert "at omega = 100000 rad/s" in words


def test_what_is_no_comparison(fits):
    other = fitted(1, measured(2))
    robust = fitted(1, measured(1), loss="huber")
    scaled = fitted(1, measured(1), scale_errors=True)
    one = fits["one"]
    two_sets = dataclasses.replace(one, data=one.data * 2)
    for results, text in (
        ([one], "results has 1 fits; there must be at least two"),
        (one, "results is a FitResult: must be a list or a dict of FitResults"),
        ([one, 3], "results[1]: is a int: must be a FitResult"),
        ({"a": one, "b": other}, "'b' and 'a': data[0], "),
        ({"a": one, "b": two_sets}, "'b' and 'a' are fits of 2 and 1 data sets; both must be of the same"),
        ({"a": one, "b": robust}, "losses are ('huber', 1.345) and ('linear', 1.0); they must be the same"),
        ({"a": one, "b": scaled}, "only one fit has errors scaled by the scatter: must be both or neither"),
    ):
        refused(functools.partial(fitting.compare, results), text, "must")
