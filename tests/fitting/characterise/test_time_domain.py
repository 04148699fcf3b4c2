"""Relaxation moduli and creep compliances: files, Prony series, E' and E'' with errors."""

import dataclasses
import functools

import mpmath
import numpy as np
import pytest
from support.exports import put
from support.refusals import refused
from support.scenes.fits import SCENE

import fitting
import rubberfric as rf
from fitting import CreepData, RelaxationData, fit_prony

TIMES = np.geomspace(1e-2, 1e4, 31)
TAU = np.geomspace(1e-2, 1e4, 7)
E = np.array([4.0, 3.0, 2.0, 1.0, 0.5, 0.3, 0.2]) * 1e6
# E(t) = E_1 (1 + 3 (1 + t / t_0)^-n), with a continuous spectrum.
E_1, T_0, POWER = 2e6, 1e-6, 0.2


def law(s):
    """E*(s) / E_1 of the power law, 1 + 3 x^n e^x Gamma(1 - n, x) with x = s t_0."""
    x = s * T_0
    return 1 + 3 * x**POWER * mpmath.exp(x) * mpmath.gammainc(1 - POWER, x)


@functools.cache
def truth():
    """E', E'' [Pa] at 21 frequencies within the measured times, and D(t) [1/Pa] by a Laplace transform."""
    omega = np.geomspace(1e-3, 1e1, 21)
    modulus = np.array([complex(law(1j * w)) for w in omega]) * E_1
    with mpmath.workdps(20):
        creep = [mpmath.invertlaplace(lambda s: 1 / (s * law(s)), t, degree=16) for t in TIMES]
    return omega, modulus, np.array(creep, float) / E_1


def relaxation():
    return E_1 * (1 + 3 * (1 + TIMES / T_0) ** -POWER)


# --- Prony series


@pytest.mark.parametrize("rest", [1e6, 0.0])
def test_a_relaxation_series_is_found_on_its_own_times(rest):
    modulus = rest + np.exp(-TIMES[:, None] / TAU) @ E
    fit = fit_prony(RelaxationData(TIMES, modulus), tau=TAU, E_inf="fit" if rest else 0.0)
    np.testing.assert_allclose(fit.material.E, E, rtol=1e-9)
    assert float(fit.material.E_inf) == pytest.approx(rest, rel=1e-8)
    np.testing.assert_allclose(fit.model([3.0])[0], rest + np.exp(-3.0 / TAU) @ E, rtol=1e-10)
    assert fit.success and fit.rms["E(t)"] < 1e-10


@pytest.mark.parametrize("fluidity", [0.0, 1e-11])
def test_a_retardation_series_is_found_and_converted(fluidity):
    """The Prony series has E* = 1 / D* of the retardation series."""
    D_0, D = 1e-8, E * 1e-14
    compliance = D_0 - np.expm1(-TIMES[:, None] / TAU) @ D + fluidity * TIMES
    fit = fit_prony(CreepData(TIMES, compliance), tau=TAU, E_inf=0.0 if fluidity else "fit")
    omega = np.geomspace(1e-5, 1e3, 30)
    exact = D_0 + np.sum(D / (1 + 1j * omega[:, None] * TAU), axis=1) + fluidity / (1j * omega)
    modulus = np.asarray(rf.complex_modulus(fit.material, omega))
    np.testing.assert_allclose(modulus * exact, 1, rtol=1e-7)
    assert fit.compliance is not None and pytest.approx(D_0, rel=1e-8) == fit.compliance.D_0
    assert fit.compliance.fluidity == pytest.approx(fluidity, rel=1e-7)
    np.testing.assert_allclose(fit.model(TIMES)[0], compliance, rtol=1e-9)


@pytest.mark.slow
def test_error_bars_of_converted_moduli():
    """Their covariance is that of refits of noisy compliances."""
    rng = np.random.default_rng(1)
    tau, D = np.array([0.1, 10.0]), np.array([1e-7, 2e-7])
    clean = 2e-8 - np.expm1(-TIMES[:, None] / tau) @ D
    fits = [
        fit_prony(
            CreepData(TIMES, clean * np.exp(0.02 * rng.normal(size=TIMES.size)), relative=0.02), tau=tau
        )
        for _ in range(150)
    ]
    found = np.log([one.values for one in fits])
    np.testing.assert_allclose(found.std(axis=0), fits[0].stderr / fits[0].values, rtol=0.2)


def test_shifts_with_temperature():
    """E(t, T) = b_T E(t / a_T) and D(t, T) = D(t / a_T) / b_T."""
    shift = rf.WLF(8.9, 120.0, 293.15, vertical=rf.Entropic())
    T = np.repeat([283.15, 293.15], TIMES.size)
    t = np.tile(TIMES, 2)
    above = T - 293.15
    a, b = 10 ** (-8.9 * above / (120 + above)), T / 293.15
    modulus = b * (1e6 + np.exp(-t[:, None] / a[:, None] / TAU) @ E)
    fit = fit_prony(RelaxationData(t, modulus, temperature=T), tau=TAU, shift=shift)
    np.testing.assert_allclose(fit.material.E, E, rtol=1e-7)
    compliance = (1e-8 - np.expm1(-t[:, None] / a[:, None] / TAU) @ (E * 1e-14)) / b
    creep = fit_prony(CreepData(t, compliance, temperature=T), tau=TAU, shift=shift)
    assert creep.compliance is not None
    np.testing.assert_allclose(creep.compliance.D, E * 1e-14, rtol=1e-7)
    assert creep.material.shift == shift


# --- E' and E''


@pytest.mark.parametrize("noise", [0.0, pytest.param(0.01, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", ["relaxation", "creep"])
def test_moduli_of_a_continuous_spectrum(kind, noise):
    omega, exact, creep = truth()
    rng = np.random.default_rng(0)
    inside, deviations = (omega > 3e-3) & (omega < 3.0), []
    for _ in range(10 if noise else 1):
        factor = np.exp(noise * rng.normal(size=TIMES.size))
        if kind == "relaxation":
            data = RelaxationData(TIMES, relaxation() * factor, relative=noise or None)
        else:
            data = CreepData(TIMES, creep * factor, relative=noise or None)
        found = fit_prony(data).moduli(omega)
        storage, loss = found.storage - exact.real, found.loss - exact.imag
        deviations.append([storage / found.sigma_storage, loss / found.sigma_loss])
        assert np.abs(storage / exact.real)[inside].max() < (0.04 if noise else 2e-3)
        if not noise:
            assert np.abs(loss / exact.imag)[inside].max() < 0.03
            assert np.median(found.sigma_loss / exact.imag) < 0.1  # the errors are not arbitrarily large
    assert np.mean(np.abs(deviations) < 2) > 0.93


def test_default_frequencies_and_use_of_converted_data():
    fit = fit_prony(RelaxationData(TIMES, relaxation(), temperature=293.15, body="upper", name="tread"))
    data = fit.moduli()
    np.testing.assert_allclose(data.omega, np.geomspace(1e-4, 1e2, 31), rtol=1e-12)
    assert (data.body, data.name) == ("upper", "tread, converted")
    np.testing.assert_allclose(data.temperature, 293.15)
    again = fit_prony(dataclasses.replace(data, temperature=None))
    omega = np.array([1e-2, 1.0])
    one, two = (np.asarray(rf.complex_modulus(x.material.replace(shift=None), omega)) for x in (fit, again))
    np.testing.assert_allclose(one, two, rtol=0.02)


@pytest.mark.slow
def test_a_master_curve_of_creep_at_several_temperatures():
    """Its shifts are those of the times, and its moduli those of the truth."""
    omega, exact, creep = truth()
    T = np.array([283.15, 293.15, 303.15])
    t = np.outer([10.0, 1.0, 0.1], TIMES).ravel()  # D(t / a_T)
    data = CreepData(t, np.tile(creep, 3), temperature=np.repeat(T, TIMES.size))
    curve = fitting.fit_master_curve(data, 293.15)
    np.testing.assert_allclose(curve.log_aT, np.log([10.0, 1.0, 0.1]), atol=0.05)
    fit = fit_prony(curve.data, 1.0, shift=curve.shift)
    found = np.asarray(rf.complex_modulus(fit.material, omega[8:14], 293.15))
    np.testing.assert_allclose(np.abs(found), np.abs(exact[8:14]), rtol=0.02)


# --- files


def test_tables(tmp_path):
    """G(t) and J(t) of a solid with nu = 1/2: E = 3 G and D = J / 3."""
    path = put(tmp_path, "Zeit [min];Relaxationsmodul [MPa];Temperatur [°C]\n1;6,0;20\n2;3,0;20\n")
    data = fitting.read(path)
    assert isinstance(data, RelaxationData)
    np.testing.assert_allclose([data.time, data.modulus], [[60, 120], [6e6, 3e6]])
    np.testing.assert_allclose(data.temperature, [293.15] * 2)
    path = put(tmp_path, "Step time (s)\tG(t) (kPa)\tTime (s)\n1\t2000\t101\n2\t1000\t102\n")
    np.testing.assert_allclose(fitting.read(path, poisson=0.5).modulus, [6e6, 3e6])
    np.testing.assert_allclose(fitting.read(path, poisson=0.5).time, [1, 2])
    assert "G_relax are of shear: poisson must be given" in refused(path, lambda: fitting.read(path))
    path = put(tmp_path, "temps [h],complaisance de fluage [1/MPa]\n1,0.5\n2,0.6\n")
    data = fitting.read(path)
    assert isinstance(data, CreepData)
    np.testing.assert_allclose([data.time, data.compliance], [[3600, 7200], [5e-7, 6e-7]])
    path = put(tmp_path, "t,J(t)\ns,1/Pa\n1,1.5e-6\n2,3e-6\n")
    np.testing.assert_allclose(fitting.read(path, poisson=0.5).compliance, [5e-7, 1e-6], rtol=1e-13)
    path = put(tmp_path, "Time (s),Tensile stress (MPa),Strain (%)\n1,0.6,10\n2,0.3,10\n")
    assert "must be the columns of one kind of data" in refused(path, lambda: fitting.read(path))
    np.testing.assert_allclose(fitting.read(path, kind="relaxation").modulus, [6e6, 3e6])
    np.testing.assert_allclose(fitting.read(path, kind="creep").compliance, [1 / 6e6, 1 / 3e6])


@pytest.mark.parametrize("suffix", [".csv", ".h5"])
def test_round_trip_of_files(tmp_path, suffix):
    path = tmp_path / f"data{suffix}"
    for data, column in (
        (RelaxationData(TIMES, relaxation(), relative=0.1, temperature=300.0), "modulus"),
        (CreepData(TIMES, 1 / relaxation(), sigma=1e-9), "compliance"),
    ):
        fitting.write(path, data)
        back = fitting.read(path)
        assert type(back) is type(data)
        np.testing.assert_array_equal(getattr(back, column), getattr(data, column))
        np.testing.assert_array_equal(back.error, data.error)


# --- messages, report and picture


RELAXATION = RelaxationData(TIMES, relaxation())
CREEP = CreepData(TIMES, 1 / relaxation())


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: fitting.fit(SCENE, CREEP, {}),
            r"data\[0\] is a CreepData: .*; fit_prony\(data\)\.moduli\(\) conv",
        ),
        (lambda: fit_prony(CREEP, E_inf=1e6), r"E_inf = 1000000\.0: must be 'fit' or 0 for creep data"),
        (lambda: fit_prony(RELAXATION, weights=(1.0, 0.5)), "weights = .*: must be equal for data over time"),
        (lambda: CreepData([1.0], [20.0]), "is it in 1/MPa or 1/GPa"),
        (lambda: fit_prony(RELAXATION).fit, "needs ModulusData, got RelaxationData"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_report_and_picture():
    pytest.importorskip("matplotlib", reason="needs matplotlib, which is in the test extra")
    for data, name in (
        (RelaxationData(TIMES, relaxation(), relative=0.01), "E(t)"),
        (CreepData(TIMES, 1 / relaxation(), relative=0.01), "D(t)"),
    ):
        fit = fit_prony(data, smooth=1.0)
        assert f"rms of ln(fit / measured): {name} " in fit.report()
        upper, lower = fit.plot()
        assert lower.get_xlabel() == "time $t$ [s]" and f"${name}$" in upper.get_ylabel()
