"""Error budgets: shifts by hand and by new fits, the sentence of the verdict, table, picture and file."""

import dataclasses
import math

import numpy as np
import pytest
from support.scenes.fits import AFFINE, FAST, ROAD, SHIFTED, E, friction_data
from support.scenes.fits import H_RMS as H
from support.scenes.fits import WARM as SCENE

import fitting
import rubberfric as rf
from fitting.budget.changes import Sizes, changes
from fitting.budget.contact_model import law_scene
from fitting.budget.contributions import Contribution, largest_error
from fitting.solvers.problem import make_problem

# Velocities of the data, over the rise and fall of the friction [m/s].
V = np.geomspace(1e-5, 1e0, 9)
T = 303.15  # [K]
P = 2e5  # [Pa]
# Relative error of the data, as of a careful measurement.
ERROR = 0.03
FREE = {H: fitting.Positive(), f"{E}[0]": fitting.Positive(), f"{E}[1]": fitting.Positive()}
LAW = dataclasses.replace(SCENE, contact_model="boundary_elements")
# A prior of a free number, and the stated error of a fixed one.
PRIOR = {f"{E}[0]": fitting.Gaussian(5e7, 5e6), "upper.material.shift.C1": fitting.Gaussian(12.0, 0.5)}


def friction(scene, v=V, p=P, T=T):
    return np.asarray(rf.friction(scene, v, p, T, quadrature=FAST))


def data_of(scene=SCENE, noise=ERROR):
    return friction_data(scene, V, P, noise, seed=5, temperature=T, relative=ERROR)


def fitted(data, scene=SCENE, **options):
    options = {"prior": PRIOR, "quadrature": FAST, "tolerance": 1e-12} | options
    return fitting.fit(scene, data, FREE, **options)


@pytest.fixture(scope="module")
def fit():
    return fitted(data_of())


@pytest.fixture(scope="module")
def budget(fit):
    return fit.budget()


def scene_at(fit, x):
    values = dict(zip(fit.names, np.exp(x), strict=True))
    return fit.scene.replace(H, values[H]).replace(E, np.array([values[f"{E}[0]"], values[f"{E}[1]"]]))


def rows_by_hand(fit, x, changed=lambda scene: scene, **conditions):
    """Residuals of data and prior, from rubberfric.friction."""
    [data] = fit.data
    given = {"v": data.velocity, "p": data.pressure, "T": data.temperature} | conditions
    model = np.log(friction(changed(scene_at(fit, x)), **given) / data.friction) / ERROR
    return np.append(model, (x[1] - math.log(5e7)) / 0.1)


def jacobian_by_hand(fit):
    """Central differences of `rows_by_hand` at the minimum."""
    x, step = np.asarray(fit.x), 1e-5
    columns = [rows_by_hand(fit, x + step * e) - rows_by_hand(fit, x - step * e) for e in np.eye(3)]
    return np.stack(columns, 1) / (2 * step)


def stiffer(scene):
    return scene.replace("upper.material.E_inf", 1.1 * scene.upper.material.E_inf)


CHANGES = {
    "temperature": {"T": np.full(V.size, T + 1)},
    "velocity": {"v": 1.02 * V},
    "pressure": {"p": np.full(V.size, 1.05 * P)},
    "moduli": {"changed": stiffer},
    "gamma": {"changed": lambda scene: scene.replace("gamma", 0.6)},
    "upper.material.shift.C1": {"changed": lambda scene: scene.replace("upper.material.shift.C1", 12.5)},
    "contact model": {"changed": lambda scene: dataclasses.replace(scene, contact_model="boundary_elements")},
}


@pytest.mark.parametrize("loss", ["linear", pytest.param("huber", marks=pytest.mark.slow)])
def test_shifts_solve_the_normal_equations(loss, fit, budget):
    """J^T (r_changed(x + shift) - r) = 0 with J from differences; weights of the loss from its definition."""
    if loss == "huber":
        data, outlier = data_of(), np.where(np.arange(V.size) == 4, 1.3, 1.0)
        fit = fitted(data.replaced(data.friction * outlier), loss=loss)
        budget = fit.budget()
    x, J = np.asarray(fit.x), jacobian_by_hand(fit)
    rows = rows_by_hand(fit, x)
    weights = np.ones(rows.size)
    if loss == "huber":  # the curvature is 0 beyond the width, but at least a tenth of the slope
        beyond = np.abs(rows[:-1]) > 1.345
        assert beyond.sum() >= 1
        weights[:-1][beyond] = 0.1 * 1.345 / np.abs(rows[:-1][beyond])
    normal = J.T @ (weights[:, None] * J)
    for source, change in CHANGES.items():
        moved = np.log((fit.values + budget[source].shift) / fit.values)
        left = J.T @ (weights * (rows_by_hand(fit, x + moved, **change) - rows))
        remaining = np.linalg.solve(normal, left) / np.sqrt(np.diag(np.linalg.inv(normal)))
        size = np.linalg.norm(moved / np.sqrt(np.diag(np.linalg.inv(normal))))
        # Steps end when they are a thousandth of a standard error, or no longer become much shorter.
        assert np.abs(remaining).max() < 2e-3 + (0.5 * size if source == "contact model" else 0.01 * size), (
            source
        )


@pytest.mark.slow
def test_roughness_adds_squares(fit, budget):
    """One number at a time, with an error that a prior states, gives the parts of the sum."""
    assert not budget["roughness"].signed and (budget["roughness"].shift >= 0).all()
    parts = []
    for name, sigma in (("q0", 1e2 / 1.1 - 1e2), ("qr", 1e2), ("q1", 3e3), ("hurst", 0.05)):
        path = f"lower.spectrum.{name}"
        number = float(getattr(ROAD.spectrum, name))
        prior = PRIOR | {path: fitting.Gaussian(number, abs(sigma))}
        one = dataclasses.replace(fit, prior=prior).budget(roughness=0.0)
        assert "roughness" not in one.sources and one[path].stated
        parts.append(one[path].shift)
    # q0 moves down in a budget, and up here.
    np.testing.assert_allclose(budget["roughness"].shift, np.sqrt(np.sum(np.square(parts), 0)), rtol=0.05)


@pytest.mark.parametrize("source", ["temperature", "velocity", "moduli"])
def test_shifts_equal_new_fits(source):
    exact = fitted(data_of(noise=0.0))
    stated = {"temperature": {"temperature": T + 1}, "velocity": {"velocity": 1.02 * V}}.get(source, {})
    scene = stiffer(exact.scene) if source == "moduli" else exact.scene
    expected = fitted(dataclasses.replace(exact.data[0], **stated), scene).values - exact.values
    off = np.abs(exact.budget()[source].shift - expected)
    assert (off < 0.1 * np.abs(expected) + 0.01 * exact.stderr).all()


def test_sizes_and_their_text(fit):
    doubled = fit.budget(temperature=0.02, velocity=0.0, gamma=0)
    assert "velocity" not in doubled.sources and "gamma" not in doubled.sources
    tiny = fit.budget(temperature=0.01)
    np.testing.assert_allclose(doubled["temperature"].shift, 2 * tiny["temperature"].shift, rtol=1e-2)
    text = tiny.report()
    assert "temperature: all temperatures + 0.01 K\n" in text
    assert "pressure: all pressures x 1.05 (default)" in text
    assert "hurst of lower +0.05" in text
    assert tiny["temperature"].stated and not tiny["pressure"].stated
    with pytest.raises(ValueError, match=r"velocity = -1: must be a finite number >= 0"):
        fit.budget(velocity=-1)


def test_numerical_error(fit):
    """FAST has errors of 1e-4; the difference to a fine quadrature is what the budget finds."""
    exact = np.asarray(rf.friction(fit.scene, V, P, T, quadrature=rf.Quadrature()))
    rows = np.append(np.log(exact / friction(fit.scene)) / ERROR, 0.0)
    moved = -np.linalg.lstsq(jacobian_by_hand(fit), rows)[0] * fit.values
    found = fit.budget()["numerical"].shift
    assert (np.abs(found) < 0.05 * fit.stderr).all()
    np.testing.assert_allclose(found, moved, rtol=0.3, atol=1e-5 * fit.stderr.min())


@pytest.mark.slow
def test_the_law_adds_its_own_error():
    fit = fitted(data_of(LAW), LAW, prior={f"{E}[0]": PRIOR[f"{E}[0]"]})
    found = fit.budget()["contact model"]
    assert not found.signed and fit.largest_error == "" and "budget" not in fit.report()
    known = rf.analysis.theory_error(fit.scene)
    assert known is not None
    amplitude = math.log(known.friction[1] / known.friction[0]) / 2 / 1.645
    J = jacobian_by_hand(fit)
    lags = np.log(V[:, None] / V)
    covariance = (amplitude / ERROR) ** 2 / (1 + 0.5 * (lags / math.log(10)) ** 2)
    A = np.linalg.inv(J.T @ J) @ J.T[:, : V.size]
    expected = np.expm1(np.sqrt(np.diag(A @ covariance @ A.T))) * fit.values
    np.testing.assert_allclose(found.shift, expected, rtol=1e-4)


def test_the_sentence(fit, budget):
    assert budget.largest == fit.largest_error != ""
    share = np.abs(budget["contact model"].shift / fit.stderr)
    name = fit.names[int(np.argmax(share))]
    assert f"the theory's error moves {name} by " in fit.largest_error
    assert 'fit with contact_model="boundary_elements", or add fitting.Discrepancy()' in fit.largest_error
    assert f"budget    = {fit.largest_error}" in fit.report()
    stated = dataclasses.replace(fit, prior=PRIOR | {"gamma": fitting.Gaussian(0.5, 0.45)}).budget(moduli=3.0)
    assert "moduli" in stated.largest or "gamma" in stated.largest or "theory" in stated.largest


def test_words_for_the_largest_error():
    """Only signed differences to the law and stated errors count; large changes are factors."""
    names, values, stderr = ("a.E", "a.tau"), np.array([2.0, 10.0]), np.array([0.2, np.nan])
    contact = Contribution("contact model", "law", np.array([-0.8, np.nan]), True)
    default = Contribution("moduli", "E of upper x 1.1", np.array([5.0, 0.0]), True)
    given = Contribution("gamma", "gamma + 0.1", np.array([-7.0, 0.0]), False, stated=True)
    data = [data_of()]
    for found, expected in (
        (
            [contact],
            "the theory's error moves a.E by -40 % (4 standard errors), as boundary elements say: fit",
        ),
        ([default], ""),
        ([contact._replace(shift=np.array([0.1, 0.1]))], ""),
        ([contact._replace(shift=np.array([18.0, 0.1]))], "moves a.E by a factor of about 10 (90 standard"),
        ([contact._replace(shift=np.array([-1.9, 0.1]))], "moves a.E by a factor of about 0.05 (9.5"),
        ([contact, default, given], "an error of gamma (gamma + 0.1) moves a.E by +-3.5e+02 % (35"),
    ):
        text = largest_error(names, values, stderr, found, data, True, False)
        assert text.startswith(expected) or (expected and expected in text), text
    text = largest_error(names, values, stderr, [contact._replace(without=("heating",))], data, True, False)
    assert text.endswith("as boundary elements say: add fitting.Discrepancy()")
    text = largest_error(names, values, stderr, [contact], data, False, False)
    assert text.endswith('say: fit with contact_model="boundary_elements"')


def test_scenes_that_the_law_does_not_allow():
    shear = rf.ContactShear(5e6, 0.1, 6e-3)
    heated = dataclasses.replace(SCENE, heating=rf.Heating(0.2, 2e6, 1.0, 1e-3), shear=shear)
    found = law_scene(heated)
    assert found.without == ("heating",) and found.law.heating is None and found.law.shear is not None
    coated = rf.Scene(ROAD, rf.Body(SHIFTED, layer=rf.Coating(1e-4, rf.Elastic(1e8, 0.5))))
    assert law_scene(coated).without == ("upper.layer",)
    grooves = rf.Body(rf.Rigid(), rf.Anisotropic(AFFINE, 8.0))
    assert law_scene(rf.Scene(grooves, rf.Body(SHIFTED))).without == ("lower.spectrum.ratio",)
    both = rf.Scene(ROAD, rf.Body(SHIFTED, AFFINE.replace(h_rms=1e-6)), area_correction=True)
    found = law_scene(both)
    assert found.without == ("upper.spectrum",) and not found.law.area_correction
    assert found.theory.area_correction


@pytest.mark.slow
def test_equal_bodies_of_several_scenes_change_together():
    """A road that two rubbers share has one error. Values of one scene change as in the other."""
    other = SCENE.replace("upper.material.E_inf", 4e6)
    free = {"*.lower.spectrum.h_rms": fitting.Positive()}
    data = {name: data_of() for name in ("a", "b")}
    problem = fitting.fit({"a": SCENE, "b": other}, data, free, quadrature=FAST).problem
    found = [(one.source, one.text) for one in changes(problem, Sizes(), {})]
    assert ("roughness", "q1 of a.lower and b.lower x 1.1") in found
    assert ("moduli", "E_inf, E of a.upper x 1.1") in found
    assert ("moduli", "E_inf, E of b.upper x 1.1") in found


def test_a_table_of_a_spectrum_changes_by_its_values():
    """The wavevectors of a table do not change, and its C changes like the square of the heights."""
    q = np.geomspace(1e2, 1e4, 5)
    table = rf.TabulatedSpectrum(q, 1e-12 * (q / 1e2) ** -3.6)
    scene = SCENE.replace("lower.spectrum", table)
    problem = make_problem(scene, [data_of()], {f"{E}[0]": fitting.Positive()})
    texts = [change.text for change in changes(problem, Sizes(), {}) if change.source == "roughness"]
    assert texts == ["C of lower x 1.21"]


def test_fixed_numbers_with_an_error(fit):
    with pytest.raises(
        ValueError, match=r"mean = 0\.4, but the number is fixed at 0\.5: must be this number"
    ):
        fitted(data_of(), prior={"gamma": fitting.Gaussian(0.4, 0.1)})
    with pytest.raises(ValueError, match=r"mean must have 1 numbers or one"):
        fitted(data_of(), prior={"gamma": fitting.Gaussian((0.5, 0.5), 0.1)})
    assert "upper.material.shift.C1: fixed, its error enters the budget" in fit.report()
    assert fit.problem.numbers.prior[0].size == 1 and len(fit.problem.numbers.prior) == 1


def test_the_tables_show_the_shifts(budget):
    """The first in units of the numbers, the second in standard errors; "?" is an unknown shift."""
    number = len(budget.sources) + 2
    expected = np.stack([budget.noise, *(part.shift for part in budget.contributions), budget.total], 1)
    tables = budget.report().split("in standard errors:")
    for table, scale in zip(tables, (np.ones_like(budget.noise), budget.noise), strict=True):
        cells = {line.split()[0]: line.split()[-number:] for line in table.split("\n") if line.strip()}
        for name, values, unit in zip(budget.names, expected, scale, strict=True):
            np.testing.assert_allclose(np.array(cells[name], float), values / unit, rtol=0.05, atol=0.0051)
    unknown = budget.contributions[0]._replace(shift=np.full(len(budget.names), np.nan))
    text = dataclasses.replace(budget, contributions=(unknown, *budget.contributions[1:])).report()
    assert text.count(" ? ") == 2 * len(budget.names)


def test_file_html_and_picture(budget, tmp_path):
    budget.save(tmp_path / "fit.h5")
    again = fitting.Budget.load(tmp_path / "fit.h5")
    assert again.report() == budget.report() and again.sizes == budget.sizes
    for one, other in zip(budget.contributions, again.contributions, strict=True):
        np.testing.assert_array_equal(one.shift, other.shift)
        assert one._replace(shift=None) == other._replace(shift=None)
    assert fitting.FitResult.load(tmp_path / "fit.h5").budget().sources == budget.sources
    text = budget._repr_html_()
    assert "<table>" in text and "contact model" in text and "in standard errors" in text
    frame = budget.to_dataframe()
    assert list(frame.index) == list(budget.names) and frame["total"].iloc[0] == budget.total[0]
    axes = budget.plot()
    tops = np.sum([[bar.get_height() for bar in bars] for bars in axes.containers], 0)
    np.testing.assert_allclose(tops, 1.0)
    with pytest.raises(KeyError, match="must be one of contact model, temperature"):
        budget["heat"]
