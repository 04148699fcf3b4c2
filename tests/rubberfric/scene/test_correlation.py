"""Correlated roughness of two solids at rest equals the roughness of their difference."""

import jax
import numpy as np
import pytest
from support.scenes.common import RIGID, ROAD, TREAD, WORN

import rubberfric as rf

PRESSURE = np.array([1e3, 1e5, 1e7])
QUADRATURE = rf.Quadrature(order=10, panels=6, graded=3, ratio=6.0)


def _scene(coherence=None, lower=ROAD, upper=WORN, **options):
    correlation = None if coherence is None else rf.Correlation(coherence)
    bodies = rf.Body(rf.Elastic(5e6, 0.4), lower), rf.Body(TREAD, upper)
    return rf.Scene(*bodies, correlation=correlation, **options)


def _solved(scene):
    found = rf.solve(scene, 0.0, PRESSURE, quadrature=QUADRATURE, quantities=("area", "separation"))
    return np.array([found.area, found.separation])


def test_limits_of_coherence():
    np.testing.assert_allclose(_solved(_scene(0.0)), _solved(_scene()), rtol=1e-13)
    area, separation = _solved(_scene(1.0, upper=ROAD))
    assert np.all(area == 1)
    assert np.all(separation == 0)


@pytest.mark.parametrize(("coherence", "height"), [(-1.0, 3.0), (1.0, 1.0), (0.5, 3.0**0.5)])
def test_heights_of_equal_form_add_as_those_of_the_difference(coherence, height):
    # (2 h - h)^2 = 1, (2 h + h)^2 = 9, and 4 + 1 - 2 . 0.5 . 2 = 3 times one surface.
    found = _solved(_scene(coherence, upper=ROAD.replace(h_rms=2 * ROAD.h_rms)))
    wanted = _solved(_scene(lower=ROAD.replace(h_rms=height * ROAD.h_rms), upper=None))
    np.testing.assert_allclose(found, wanted, rtol=1e-9)


def test_derivatives_by_the_coherence_are_those_of_the_values():
    def area(coherence):
        return rf.contact_area(_scene(0.0).replace("correlation.coherence", coherence), 0.0, 1e5)

    slope = (area(0.3001) - area(0.2999)) / 2e-4
    assert float(jax.jit(jax.grad(area))(0.3)) == pytest.approx(float(slope), rel=1e-6)
    assert np.isfinite(jax.jit(jax.grad(area))(1.0))


def test_what_correlation_does_not_allow_is_refused():
    with pytest.raises(ValueError, match=r"^velocity\[1\] = 1.0: must be 0, because correlated roughness"):
        rf.contact_area(_scene(0.5), [0.0, 1.0], 1e5)
    assert np.isnan(jax.jit(lambda v: rf.contact_area(_scene(0.5), v, 1e5))(1.0))
    with pytest.raises(ValueError, match=r"^Scene.correlation: upper.spectrum is None; both"):
        _scene(0.5, upper=None)
    with pytest.raises(ValueError, match=r"^Scene.correlation: upper.spectrum is anisotropic"):
        _scene(0.5, upper=rf.Anisotropic(ROAD, 2.0))
    with pytest.raises(ValueError, match=r"^scene.correlation: profile is not defined with correlation"):
        rf.analysis.profile(_scene(0.5), 0.0, 1e5)
    assert rf.Scene(rf.Body(RIGID, ROAD), rf.Body(TREAD)).correlation is None
