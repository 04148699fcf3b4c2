"""Fits that an interrupt ends before the first evaluation, or between two searches."""

import numpy as np
import pytest
from support.scenes.fits import E_INF, SCENE, E, modulus_data

import fitting
import fitting.solvers.runs as runs_module
from fitting import Gaussian, ModulusData, Positive, fit
from fitting.solvers.objective import NOT_FINITE

OMEGA = np.logspace(0, 7, 8)
FREE = {E: Positive(), E_INF: Positive()}


def moduli(relative=0.02, factor=1.3):
    """Moduli of a scene whose E are all `factor` times larger, with some scatter."""
    material = SCENE.upper.material
    return modulus_data(material.replace(E=factor * material.E), OMEGA, relative=relative)


@pytest.fixture
def interrupt_start(monkeypatch):
    """Return a function that raises KeyboardInterrupt in the n-th evaluation of a start, counted from 1."""

    def interrupt(n):
        calls, start = [], runs_module.start

        def stopped(*arguments):
            calls.append(None)
            if len(calls) == n:
                raise KeyboardInterrupt
            return start(*arguments)

        monkeypatch.setattr(runs_module, "start", stopped)
        return calls

    return interrupt


@pytest.mark.parametrize(
    "options",
    [{}, {"starts": 6}, {"loss": "huber"}, {"prior": {E_INF: Gaussian(3e6, 1e6)}}, {"method": "lbfgs"}],
)
def test_before_the_first_evaluation(interrupt_start, options):
    interrupt_start(1)
    with pytest.raises(KeyboardInterrupt):
        fit(SCENE, moduli(), FREE, **options)


def test_if_the_starts_so_far_are_not_finite(monkeypatch):
    """Nothing is known about the starts that were not evaluated."""
    calls = []

    def start(engine, targets, iterate):
        del engine, targets
        calls.append(None)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return iterate._replace(status=iterate.status * 0 + NOT_FINITE, nfev=iterate.nfev + 1)

    monkeypatch.setattr(runs_module, "start", start)
    with pytest.raises(KeyboardInterrupt):
        fit(SCENE, moduli(), FREE, starts=12)
    assert len(calls) == 2


def test_before_a_second_fit_with_other_errors(interrupt_start):
    """The values and the cost of the first fit stay; its errors are 10 %."""
    data, prior = moduli(relative=None), {E_INF: Gaussian(3e6, 1e6)}
    calls = interrupt_start(2)
    result = fit(SCENE, data, FREE, prior=prior)
    assert len(calls) == 2
    assert not result.success and result.message.startswith("interrupted")
    first = fit(SCENE, moduli(relative=0.1), FREE, prior=prior)
    assert result.cost == pytest.approx(first.cost, rel=1e-6) and np.isfinite(result.cost)
    np.testing.assert_allclose(result.values, first.values, rtol=1e-6)
    assert "10 %" in result.report()


def test_a_bootstrap_without_any_fit(interrupt_start):
    result = fit(SCENE, moduli(), FREE)
    interrupt_start(1)
    with pytest.raises(KeyboardInterrupt):
        result.bootstrap(4)


def test_a_calibration_without_any_fit():
    def interrupt(*_):
        raise KeyboardInterrupt

    prior = {E: Gaussian((5e7, 8e6), (5e6, 8e5)), E_INF: Gaussian(3e6, 3e5)}
    with pytest.raises(KeyboardInterrupt):
        fitting.calibration(SCENE, moduli(), FREE, prior, members=4, callback=interrupt)


# --- a cost that overflows


def test_an_error_that_is_too_small_is_named():
    """The square of a residual of 1e300 standard errors overflows."""
    data = moduli(relative=None)
    tiny = ModulusData(OMEGA, data.storage, data.loss, np.full(8, 1e-300), np.full(8, 1e-300))
    with pytest.raises(FloatingPointError, match=r"the error 1e-300 at omega = 1 rad/s is so small") as found:
        fit(SCENE, tiny, FREE)
    assert "prior" not in str(found.value)


def test_a_prior_is_blamed_only_if_it_overflows():
    with pytest.raises(FloatingPointError, match="a prior is not finite at the start: check"):
        fit(SCENE, moduli(), FREE, prior={E_INF: Gaussian(4e6, 1e-300)})
    with pytest.raises(FloatingPointError, match="is so small that the cost overflows"):
        fit(SCENE, moduli(relative=1e-300), FREE, prior={E_INF: Gaussian(4e6, 1e6)})
