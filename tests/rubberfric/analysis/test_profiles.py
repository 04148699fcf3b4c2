"""Profiles over the wavevector against the paper's equations on roughness cut at each wavevector."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.cases.cut import CASES, SMOOTH, TYRE, by_paper, cut, ordinary
from support.oracles.numerical import derivatives

import rubberfric as rf

Q = np.array([50.0, 100.0, 100.0 * (1 + 1e-6), 317.0, 1000.0, 2.7e4, 2e5])  # kinks, and beyond both ends
WHERE = [2, 3, 4, 5]  # strictly inside the roughness


@pytest.mark.parametrize("name", ordinary("tyre"))
def test_profile_is_the_scene_cut_at_each_wavevector(name):
    """Contact and friction up to q do not know what lies beyond q."""
    scene, v, p = CASES[name]
    found = rf.analysis.profile(scene, v, p, q=Q)
    spectra = [body.spectrum for body in (scene.lower, scene.upper) if body.spectrum is not None]
    for i in WHERE:
        # The first 1e-6 of the roughness sees only the end of an angular panel, on which the means of
        # a tabulated modulus, interpolated, are far less accurate than in its integral.
        rel = 1e-8 if name != "table" else 1e-4 if i == WHERE[0] else 1e-6
        exact = by_paper(cut(scene, Q[i]), v, p)
        assert found.area[i] == pytest.approx(float(exact.area), rel=0.1 * rel)
        assert found.friction[i] == pytest.approx(float(exact.friction), rel=rel, abs=1e-30)
        S = scene.gamma + (1 - scene.gamma) * float(exact.area) ** 2
        assert found.energy_factor[i] == pytest.approx(S, rel=0.1 * rel)
        for function, value in ((rf.rms_slope, found.rms_slope), (rf.roughness.rms_height, found.rms_height)):
            wanted = np.linalg.norm([function(spectrum, Q[i]) for spectrum in spectra])
            assert value[i] == pytest.approx(wanted, rel=1e-11)
    assert (
        (found.area[:2] == 1).all() and (found.fluctuation[:2] == 0).all() and (found.friction[:2] == 0).all()
    )
    whole = rf.solve(scene, v, p)
    assert found.area[-1] == pytest.approx(float(whole.area), rel=1e-9)
    assert found.friction[-1] == pytest.approx(float(whole.friction), rel=rel, abs=1e-30)
    assert found.friction_density[0] == found.friction_density[-1] == 0
    first = min(float(spectrum.q[0]) for spectrum in spectra)
    np.testing.assert_allclose(found.magnification, Q / first, rtol=1e-15)


@pytest.mark.parametrize("name", ordinary("tyre"))
def test_density_integrates_to_the_friction(name):
    """Integrate with Gauss nodes between two wavevectors without kinks; P follows from G."""
    node, weight = np.polynomial.legendre.leggauss(30)
    a, b = 1100.0, 3900.0
    q = np.concatenate([[a, b], a * (b / a) ** (0.5 * (1 + node))])
    found = rf.analysis.profile(*CASES[name], q=q)
    integral = 0.5 * np.log(b / a) * np.sum(weight * found.friction_density[2:])
    difference = float(found.friction[1] - found.friction[0])
    rel = 1e-6 if name == "table" else 1e-8
    assert integral == pytest.approx(difference, rel=rel, abs=1e-9 * float(abs(found.friction[1])))
    np.testing.assert_allclose(
        found.area, jax.scipy.special.erf(0.5 / np.sqrt(found.fluctuation)), rtol=1e-12
    )


@pytest.mark.slow
def test_derivatives_by_the_wavevector():
    """By the paper on roughness cut a little before and after; dmu/dq also by the density."""
    q = jnp.array([150.0, 1e3, 2e4])

    def fields(q):
        found = rf.analysis.profile(*TYRE, q=q)
        return jnp.stack([found.area, found.friction, found.friction_density])

    by_q = jax.jit(jax.jacfwd(fields))(q)
    for i in (0, 2):

        def by_paper_up_to(share, i=i):
            found = by_paper(cut(TYRE[0], float(q[i] * (1 + share[0]))), *TYRE[1:])
            return [found.area, found.friction]

        (exact,) = derivatives(by_paper_up_to, 1, 1e-3)
        # The area is close to 1, and its rounding is divided by the step.
        np.testing.assert_allclose(by_q[:2, i, i] * q[i], exact, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(np.diag(by_q[1])[::2] * q[::2], fields(q)[2, ::2], rtol=1e-7)


def test_default_wavevectors_and_shapes():
    scene, *_ = TYRE
    v, p = np.logspace(-4, 0, 3), np.array([[1e5], [1e6]])
    found = rf.analysis.profile(scene, v, p)
    assert found.q.shape == (200,) and found.area.shape == found.friction.shape == (2, 3, 200)
    assert (found.q[0], found.q[-1]) == (100.0, 3.1e4) and found.temperature is None and found.strain is None
    np.testing.assert_allclose(np.diff(np.log(found.q)), np.log(310.0) / 199, rtol=1e-11)
    whole = rf.solve(scene, v, p)
    np.testing.assert_allclose(found.area[..., -1], whole.area, rtol=1e-11)
    np.testing.assert_allclose(found.friction[..., -1], whole.friction, rtol=1e-8)
    assert (found.friction_density[..., 0] > 0).all() and (found.friction_density[..., -1] > 0).all()


@pytest.mark.parametrize("v", [0.0, 1e-30, 1e12])
@pytest.mark.parametrize("p", [1e-3, 1e7])
def test_extreme_conditions_stay_finite_and_ordered(v, p):
    scene, *_ = TYRE
    found = rf.analysis.profile(scene, np.array([[v]]), np.array([p]), q=Q)
    for field in found[:9]:
        assert np.isfinite(field).all()
    assert (np.diff(found.area[0, 0]) <= 0).all() and (np.diff(found.friction[0, 0]) >= 0).all()
    assert (np.diff(found.fluctuation[0, 0]) >= 0).all()
    if v == 0:
        assert not np.any(found.friction) and not np.any(found.friction_density)


@pytest.mark.slow
@pytest.mark.parametrize("q1", [100.1, 1e12])
def test_extreme_ranges(q1):
    road = rf.SelfAffine(100.0, 100.05 if q1 < 101 else 1000.0, q1, 0.8, 5e-4)
    scene = rf.Scene(TYRE[0].lower, rf.Body(rf.Rigid(), road))
    found = rf.analysis.profile(scene, 1e-2, 2e5)
    whole = rf.solve(scene, 1e-2, 2e5)
    assert found.area[-1] == pytest.approx(float(whole.area), rel=1e-9)
    assert found.friction[-1] == pytest.approx(float(whole.friction), rel=1e-8)
    assert all(np.isfinite(field).all() for field in found[:9])


def test_smooth_scene():
    found = rf.analysis.profile(SMOOTH, np.ones(3), 1e5, q=[10.0, 30.0])
    assert found.area.shape == (3, 2) and (found.area == 1).all() and (found.energy_factor == 1).all()
    assert not np.any(found.friction) and not np.any(found.rms_slope) and not np.any(found.fluctuation)
    with pytest.raises(ValueError, match=r"^q is None, but the scene has no roughness; give wavevectors$"):
        rf.analysis.profile(SMOOTH, 1.0, 1e5)


@pytest.mark.parametrize("q", [[1.0, -1.0], [0.0], [np.nan]])
def test_wavevectors_must_be_positive(q):
    with pytest.raises(ValueError, match=r"^q\[\d\] = .*must be .*> 0$"):
        rf.analysis.profile(*TYRE, q=q)


def test_single_precision_stays_single():
    arguments = jax.tree.map(lambda x: jnp.asarray(x, jnp.float32), TYRE)
    found = rf.analysis.profile(*arguments, q=Q)
    assert {field.dtype for field in found[:9]} == {jnp.dtype(jnp.float32)}
    exact = rf.analysis.profile(*TYRE, q=Q)
    for name in ("area", "friction", "friction_density", "rms_slope", "energy_factor"):
        wanted = getattr(exact, name)
        # Single precision does not resolve 1e-6 next to the first wavevector.
        apart = np.arange(Q.size) != 2
        np.testing.assert_allclose(getattr(found, name)[apart], wanted[apart], rtol=2e-5)


def test_plot():
    pytest.importorskip("matplotlib")
    from rubberfric.plot.over_wavevectors import plot_profile

    scene, *_ = TYRE
    axes = plot_profile(
        rf.analysis.profile(scene, np.array([1e-3, 1.0]), 2e5, q=Q[::-1]), labels=["slow", "fast"]
    )
    assert [len(a.lines) for a in axes] == [2, 2, 1]
    assert (np.diff(axes[0].lines[0].get_xdata()) > 0).all()
    assert [text.get_text() for text in axes[0].get_legend().get_texts()] == ["slow", "fast"]
    assert all("[" in a.get_ylabel() for a in axes)
