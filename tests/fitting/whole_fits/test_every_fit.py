"""Properties of every kind of fit: minimum, derivatives, error bars, order, ensembles, and files."""

import dataclasses

import h5py
import jax.numpy as jnp
import numpy as np
import optimistix
import pytest
from support.jacobians import functions, scipy_minimum
from support.scenes.fit_problems import FEW, FITS, PARAMETERS, fitted, problem, same

import fitting
from fitting.results.hdf5 import save
from rubberfric.io.hdf5 import read_object


def deviations(result):
    return np.sqrt(np.diag(result.uncertainty.spread))


def moved(result, share):
    """Return x away from the minimum by a share of each standard error, or by 0.01 without one."""
    return result.x + share * np.where(deviations(result) < 1, deviations(result), 0.01)


def assert_same_minimum(result, cost, x, rel=1e-7):
    """Costs that are `rel` of themselves apart allow x to be sqrt(2 rel cost) standard errors apart."""
    assert result.cost == pytest.approx(cost, rel=rel)
    known = np.isfinite(result.uncertainty.deviation)
    away = np.abs(result.x - x)[known] / deviations(result)[known]
    np.testing.assert_array_less(away, np.sqrt(2 * rel * cost) + 1e-4)


@pytest.mark.parametrize("name", PARAMETERS)
def test_jacobian_is_that_of_the_residuals(name):
    rows, both = functions(fitted(name).problem)
    x = moved(fitted(name), 0.5)
    values, jacobian = both(x)
    np.testing.assert_allclose(values, rows(x), rtol=1e-9, atol=1e-9)
    columns = np.stack([(rows(x + h) - rows(x - h)) / 2e-6 for h in 1e-6 * np.eye(x.size)], 1)
    np.testing.assert_allclose(jacobian, columns, rtol=1e-5, atol=1e-5 * np.abs(columns).max())


@pytest.mark.parametrize("name", PARAMETERS)
def test_minimum_is_that_of_scipy(name):
    """SciPy starts half an error away."""
    result = fitted(name)
    theirs = scipy_minimum(result.problem, moved(result, 0.5))
    assert_same_minimum(result, theirs.cost, theirs.x)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["friction", "joint", "two bodies", "two scenes"])
def test_minimum_is_that_of_optimistix(name):
    result = fitted(name)
    rows, _ = functions(result.problem)
    solver = optimistix.LevenbergMarquardt(rtol=1e-10, atol=1e-10)
    start = jnp.asarray(moved(result, 1.0))
    # If costs differ only by rounding it may not stop; the result reached is compared.
    theirs = optimistix.least_squares(lambda x, _: rows(x), solver, start, max_steps=500, throw=False).value
    assert_same_minimum(result, 0.5 * float(jnp.sum(rows(theirs) ** 2)), np.asarray(theirs))


@pytest.mark.parametrize("name", PARAMETERS)
def test_covariance_is_the_inverse_of_the_normal_matrix(name):
    """The estimates are those of least squares, for all x that the data determine."""
    result = fitted(name)
    if result.problem.structure.loss != "linear" or result.unidentified:
        pytest.skip("robust losses have weights; unidentified directions are cut off")
    jacobian = np.asarray(functions(result.problem)[1](result.x)[1])
    covariance = np.linalg.inv(jacobian.T @ jacobian)
    np.testing.assert_allclose(result.uncertainty.deviation, np.sqrt(np.diag(covariance)), rtol=1e-6)
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    np.testing.assert_allclose(result.correlation, covariance / scale, atol=1e-6)


def turned(data):
    """Data with their rows in reverse order."""
    if isinstance(data, dict):
        return {name: turned(one) for name, one in data.items()}
    if isinstance(data, list):
        return [turned(one) for one in reversed(data)]
    fields = {field.name: getattr(data, field.name) for field in dataclasses.fields(data)}
    arrays = {name: x[::-1] for name, x in fields.items() if isinstance(x, np.ndarray)}
    return dataclasses.replace(data, **arrays)


@pytest.mark.parametrize("name", FEW)
def test_order_of_rows_and_of_parameters_does_not_matter(name):
    result, of = fitted(name), problem(name)
    free = dict(reversed(of.free.items()))
    other = of._replace(data=turned(of.data), free=free).fit()
    assert set(other.names) == set(result.names) and set(other.withheld) == set(result.withheld)
    at = [other.names.index(one) for one in result.names]
    assert_same_minimum(result, other.cost, other.x[at])
    np.testing.assert_allclose(other.stderr[at], result.stderr, rtol=2e-3)


@pytest.mark.parametrize("name", [one for one in FEW if one.id not in ("joint", "discrepancy")])
def test_a_member_of_an_ensemble_ends_at_the_same_minimum(name):
    """From half an error away. Ensembles have no discrepancy and estimate no errors."""
    result, of = fitted(name), problem(name)
    options = {key: value for key, value in of.options.items() if key != "further_time"}
    starts = np.stack([moved(result, 0.5), result.x])
    ends = fitting.run_ensemble(
        fitting.multi_start(of.scene, of.data, of.free, starts, prior=of.prior, **options)
    )
    assert ends.names == result.names and ends.good.all()
    for cost, x in zip(ends.cost, ends.x, strict=True):
        assert_same_minimum(result, cost, x)


# --- files


@pytest.mark.parametrize("name", PARAMETERS)
def test_file_round_trip(name, tmp_path):
    result = fitted(name)
    result.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    properties = [
        key for key in dir(fitting.FitResult) if isinstance(getattr(fitting.FitResult, key), property)
    ]
    assert {"scene", "values", "stderr", "redchi", "success", "unidentified"} < set(properties)
    for key in (*properties, *(field.name for field in dataclasses.fields(result))):
        assert same(getattr(result, key), getattr(again, key)), key
    assert again.report() == result.report()
    assert same(result.interval(), again.interval())


@pytest.mark.slow
@pytest.mark.parametrize("name", FITS)
def test_a_fit_from_a_file_predicts_and_goes_on(name, tmp_path):
    result = fitted(name)
    result.save(tmp_path / "fit.h5")
    again = fitting.FitResult.load(tmp_path / "fit.h5")
    assert same(again.profile(result.names[0], points=2), result.profile(result.names[0], points=2))
    assert same(again.bootstrap(2), result.bootstrap(2))
    if not isinstance(result.scene, dict):
        T = 300.0 if name == "joint" else None
        at = np.array([1e-3, 1e-1]), 2e5, T
        np.testing.assert_array_equal(again.predict(*at), result.predict(*at))
        if not result.unidentified:
            assert same(again.band(*at), result.band(*at))


@pytest.mark.parametrize("name", PARAMETERS)
def test_other_tools_can_read_the_file(name, tmp_path):
    result = fitted(name)
    save(tmp_path / "fit.h5", result, title="Title")
    with h5py.File(tmp_path / "fit.h5") as file:
        assert (file.attrs["format"], file.attrs["title"]) == ("rubberfric fit", "Title")
        assert file.attrs["message"] == result.message
        assert file["report"].asstr()[()] == result.report()
        parameters = file["parameters"]
        assert parameters["names"].asstr()[()].tolist() == list(result.names)
        for key in ("values", "start_values", "stderr"):
            np.testing.assert_array_equal(parameters[key], getattr(result, key))
        for key in ("covariance", "correlation"):
            np.testing.assert_array_equal(file[f"uncertainty/{key}"], getattr(result, key))
        assert [file[f"data/{i}"].attrs["name"] for i in range(len(result.data))] == [
            data.name for data in result.data
        ]
        if name == "joint":
            assert parameters["units"].asstr()[()].tolist() == ["Pa", "Pa", "Pa", "-"]
        if not isinstance(result.scene, dict):
            assert same(read_object(file["scene"]), result.scene)
