"""Self-affine spectra from tables: recovery of known spectra, SciPy's minimum, refusals."""

import numpy as np
import pytest
import scipy.optimize
from support.html_tables import cells
from support.published import needs, outside

import rubberfric as rf
from fitting import SpectrumData, SpectrumFit, fit_spectrum
from fitting.characterise.broken_line import broken_line

TRUTH = rf.SelfAffine(100.0, 1000.0, 1e6, 0.8, 5e-4)
Q = np.geomspace(100.0, 1e6, 60)


def measured(spectrum=TRUTH, q=Q, noise=0.0, seed=0):
    inside = np.clip(q, float(spectrum.q0) * (1 + 1e-12), float(spectrum.q1) * (1 - 1e-12))
    scatter = np.exp(noise * np.random.default_rng(seed).standard_normal(q.size))
    return np.asarray(rf.power_spectrum(spectrum, inside)) * scatter


def leaves(spectrum):
    return [float(getattr(spectrum, name)) for name in ("q0", "qr", "q1", "hurst", "h_rms")]


@pytest.fixture(scope="module")
def noisy():
    return fit_spectrum(SpectrumData(Q, measured(noise=0.3, seed=3), name="road 7", body="upper"))


def test_known_spectrum_is_found():
    found = fit_spectrum((Q, measured()))
    assert isinstance(found, SpectrumFit) and found.fit.success and found.remarks == ()
    np.testing.assert_allclose(leaves(found.spectrum), leaves(TRUTH), rtol=1e-7)
    assert found.rms < 1e-8


@pytest.mark.slow
def test_surface_finer_than_the_data():
    found = fit_spectrum(rf.TabulatedSpectrum(Q, measured()), q1=3e6)
    np.testing.assert_allclose(leaves(found.spectrum)[:4], [100.0, 1000.0, 3e6, 0.8], rtol=1e-7)


def test_error_bars_of_noisy_data(noisy):
    assert noisy.fit.success and not noisy.fit.withheld
    assert noisy.fit.names == ("upper.spectrum.h_rms", "upper.spectrum.hurst", "upper.spectrum.qr")
    truth = np.array([5e-4, 0.8, 1000.0])
    assert np.abs((noisy.fit.values - truth) / noisy.fit.stderr).max() < 3.5
    assert noisy.fit.estimated[0] == pytest.approx(0.3, rel=0.25)
    assert set(noisy.stderr) == {"h_rms", "hurst", "qr"}


@pytest.mark.parametrize("seed", range(6))
def test_broken_line_is_the_global_minimum(seed):
    """None of a fine grid of kinks, each with scipy's bounded least squares, is lower."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, 9, 25))
    y = -3.6 * np.maximum(t - 3, 0) + 0.8 * rng.standard_normal(25)
    weight = rng.uniform(0.3, 3, 25)
    found = broken_line(t, y, weight, (2.0, 4.0), t[0], t[-1])
    root = np.sqrt(weight)

    def cost(kink):
        A = root[:, None] * np.stack([np.ones(25), -np.maximum(t - kink, 0)], 1)
        return 2 * scipy.optimize.lsq_linear(A, root * y, ([-np.inf, 2], [np.inf, 4]), tol=1e-14).cost

    assert found.cost == pytest.approx(cost(found.kink), rel=1e-9)
    assert found.cost <= min(cost(kink) for kink in np.linspace(t[0], t[-1], 300)) * (1 + 1e-9)


def test_minimum_is_scipys(noisy):
    data = noisy.fit.data[0]

    def residuals(x):
        spectrum = rf.SelfAffine(Q[0], float(np.exp(x[2])), Q[-1], x[1], float(np.exp(x[0])))
        return np.log(measured(spectrum) / data.C)

    start = [np.log(4e-4), 0.7, np.log(800.0)]
    best = scipy.optimize.least_squares(residuals, start, x_scale=[0.1, 0.1, 0.1], xtol=1e-12, ftol=1e-14)
    assert np.sum(noisy.residuals**2) <= 2 * best.cost * (1 + 1e-8)
    fitted = [
        np.log(float(noisy.spectrum.h_rms)),
        float(noisy.spectrum.hurst),
        np.log(float(noisy.spectrum.qr)),
    ]
    np.testing.assert_allclose(noisy.residuals, residuals(fitted), atol=1e-11)


@pytest.mark.parametrize("noise", [pytest.param(0.0, marks=pytest.mark.slow), 0.3])
def test_no_rolloff_in_the_data(noise):
    fractal = rf.SelfAffine(100.0, 100.0, 1e6, 0.7, 5e-4)
    found = fit_spectrum((Q, measured(fractal, noise=noise)))
    assert float(found.spectrum.qr) == float(found.spectrum.q0) == Q[0] and "qr" not in found.stderr
    assert found.remarks == ("no roll-off is seen above 100 1/m: qr is held at q0 = 100 1/m",)
    assert float(found.spectrum.hurst) == pytest.approx(0.7, abs=0.1 if noise else 1e-7)
    assert found.remarks[0] in found.report()


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "held"), [(-4.6, 1.0), (-1.5, 0.0)])
def test_slopes_of_no_self_affine_surface(slope, held):
    found = fit_spectrum((Q, 1e-13 * np.minimum(1, (Q / 1e3) ** slope)), qr=1e3)
    assert float(found.spectrum.hurst) == held and set(found.stderr) == {"h_rms"}
    assert "H is fixed at this limit" in found.remarks[0]


@pytest.mark.slow
def test_held_and_left_out():
    found = fit_spectrum((Q, measured()), hurst=0.8, qr=1000.0)
    assert found.fit.names == ("lower.spectrum.h_rms",)
    np.testing.assert_allclose(leaves(found.spectrum), leaves(TRUTH), rtol=1e-9)
    low = np.geomspace(10.0, 90.0, 9)
    found = fit_spectrum((np.concatenate([low, Q]), np.concatenate([1e-9 * low**0, measured()])), q0=100.0)
    np.testing.assert_allclose(leaves(found.spectrum), leaves(TRUTH), rtol=1e-7)
    assert found.remarks == ("9 of 69 points lie outside q0 ... q1: not used",)
    assert "(fixed)" in found.report()


@pytest.mark.slow
def test_weights():
    """A spoiled half counts for little where its error says so."""
    C = measured()
    C[::2] *= 3.0
    relative = np.where(np.arange(Q.size) % 2, 0.01, 100.0)
    found = fit_spectrum(SpectrumData(Q, C, relative=np.minimum(relative, 3.0), check_units=False))
    np.testing.assert_allclose(leaves(found.spectrum), leaves(TRUTH), rtol=1e-3)
    found = fit_spectrum(SpectrumData(Q, measured(), sigma=0.1 * measured()))
    np.testing.assert_allclose(leaves(found.spectrum), leaves(TRUTH), rtol=1e-6)


def test_report(noisy):
    lines = noisy.report().splitlines()
    assert lines[0] == "Self-affine spectrum of road 7" and len(lines) == 10
    value, error = float(noisy.spectrum.hurst), noisy.stderr["hurst"]
    assert lines[5].split() == [
        "hurst",
        "[-]",
        f"{value:.4g}",
        "+/-",
        f"{error:.2g}",
        f"({error / value:.1%})",
    ]
    assert repr(noisy).startswith("<SpectrumFit: h_rms 0.000")
    headings, height, hurst, *_, rms, _ = cells(noisy)
    assert headings == ["parameter", "value", "error"] and height[1].endswith(" m")
    assert hurst == ["hurst", f"{value:.4g}", f"+/- {error:.2g} ({error / value:.1%})"]
    assert rms == [f"rms of ln(fit / measured): {noisy.rms:.2g}, a factor of {np.exp(noisy.rms):.2f}"]
    assert rms[0] == lines[2].strip()


@pytest.mark.slow
@needs("tyre")
def test_measured_road():
    q, C = np.loadtxt(outside("tyre") / "psd_asphalt.csv", delimiter=",", skiprows=2).T
    found = fit_spectrum((q, C))
    assert found.fit.success and found.remarks == () and not found.fit.withheld
    np.testing.assert_allclose(
        leaves(found.spectrum)[1:4:2] + leaves(found.spectrum)[4:], [305.4, 0.5746, 6.32e-4], rtol=2e-3
    )
    assert found.rms == pytest.approx(0.76, abs=0.01)
    assert ": poor; the surface is not self-affine" in found.report()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: fit_spectrum([1.0]),
            "data is a list: must be SpectrumData, TabulatedSpectrum, MeasuredSpectrum",
        ),
        (lambda: fit_spectrum((Q, -Q)), "SpectrumData.C[0] = -100.0: must be > 0"),
        (lambda: fit_spectrum((Q, measured()), q0=1e7), "q1 = 1e+06: must be > q0 = 1e+07"),
        (lambda: fit_spectrum((Q, measured()), q0=-1), "q0 = -1: must be None or a number > 0"),
        (lambda: fit_spectrum((Q, measured()), q0=7e5), "3 values within 700000 ... 1e+06 1/m for 3"),
        (lambda: fit_spectrum((Q, measured()), hurst=1.5), "hurst = 1.5: must be 'fit' or a number, 0 ... 1"),
        (lambda: fit_spectrum((Q, measured()), qr=1.0), "qr = 1.0: must be 'fit' or a number, 100 ... 1e+06"),
        (
            lambda: fit_spectrum(SpectrumData(Q, measured(), relative=0.1), relative=0.2),
            "relative = 0.2: must not be given, because the data specify it",
        ),
    ],
)
def test_what_is_refused(call, message):
    with pytest.raises(ValueError, match="must") as error:
        call()
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(("factor", "questioned"), [(1.0, False), (5.0, True)])
def test_the_rms_height_of_the_data_is_compared(factor, questioned):
    """Long waves that no self-affine spectrum has. The rms height is integrated over a dense grid."""
    q = np.geomspace(1e2, 1e5, 31)
    C = 1e-12 * np.where(q < 1e3, 1.0, (q / 1e3) ** -3.6) * np.where(q < 3e2, factor, 1.0)
    found = fit_spectrum((q, C))
    dense = np.geomspace(1e2, 1e5, 30_001)
    heights = np.exp(np.interp(np.log(dense), np.log(q), np.log(C)))
    height = np.sqrt(2 * np.pi * np.trapezoid(dense**2 * heights, np.log(dense)))
    assert found.rms_height == pytest.approx(height, rel=1e-5)
    fitted = float(found.spectrum.h_rms)
    percent = round(100 * (fitted / height - 1), 1) + 0.0
    text = f"rms height: fit {fitted:.4g} m, data {height:.4g} m, {percent:+.1f} %"
    assert text in found.report() and text in found._repr_html_()
    assert ("more than 10% and two standard errors" in found.report()) == questioned
