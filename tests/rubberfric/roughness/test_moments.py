"""Moments up to a wavevector and the wavevector of a slope, against their definition in 40 digits."""

import dataclasses

import jax
import jax.numpy as jnp
import mpmath as mp
import numpy as np
import pytest
from support.oracles.moments import moment_of_plateau, self_affine_moment, table_moment

import rubberfric as rf
from rubberfric.roughness.moments import cumulative_moment
from rubberfric.roughness.spectra import power_law_of

ROAD = (100.0, 1000.0, 3.1e4, 0.8, 5e-4)
SPECTRA = {
    "road": ROAD,
    "H = 1": (100.0, 1000.0, 3.1e6, 1.0, 5e-4),
    "H = 0": (100.0, 1000.0, 3.1e6, 0.0, 5e-4),
    "H = 1e-9": (100.0, 1000.0, 3.1e6, 1e-9, 5e-4),
    "no plateau": (100.0, 100.0, 3e6, 0.7, 5e-4),
    "plateau only": (100.0, 3e4, 3e4, 0.7, 1e-4),
    "narrow": (100.0, 100.05, 100.1, 0.6, 5e-3),
    "ten decades": (1.0, 1e2, 1e10, 0.9, 5e-3),
}
TABLE_Q = np.array([60.0, 150.0, 2e3, 4e4, 8e5])
TABLE_C = np.array([4e-13, 9e-13, 1e-15, 1e-19, 2e-28])


def exact(leaves, order, q):
    with mp.workdps(50):
        numbers = [mp.mpf(float(x)) for x in leaves]
        if len(numbers) == 5:
            return self_affine_moment(numbers, order, mp.mpf(q))
        n = len(numbers) // 2
        return table_moment(numbers[:n], numbers[n:], order, mp.mpf(q))


OBJECTS = {name: rf.SelfAffine(*leaves) for name, leaves in SPECTRA.items()}
OBJECTS["table"] = rf.TabulatedSpectrum(TABLE_Q, TABLE_C)
LEAVES = {**SPECTRA, "table": (*TABLE_Q, *TABLE_C)}
LAW_OF, spectrum_of = jax.jit(power_law_of), jax.jit(rf.power_spectrum)
LAWS = {name: LAW_OF(spectrum) for name, spectrum in OBJECTS.items()}
# Compiled once for each kind of spectrum.
MOMENT = jax.jit(cumulative_moment)
slope_of, height_of, cut = jax.jit(rf.rms_slope), jax.jit(rf.roughness.rms_height), jax.jit(rf.with_cutoff)
by_name = pytest.mark.parametrize("name", OBJECTS)


@by_name
@pytest.mark.parametrize("order", [0, 2, 4])
def test_moment_up_to_a_distance(name, order):
    law = LAWS[name]
    with mp.workdps(50):
        range_ = mp.log(mp.mpf(float(law.q[-1])) / mp.mpf(float(law.q[0])))
        fractions = [1e-18, 1e-9, 0.01, 0.3, 0.7, 0.999]
        distance = [float(f * range_) for f in fractions]
        wanted = [float(exact(LEAVES[name], order, law.q[0].item() * mp.exp(mp.mpf(d)))) for d in distance]
    # ln q1 - ln q0 keeps 13 digits of a range of 1.001.
    found = MOMENT(law, float(order), np.array(distance))
    np.testing.assert_allclose(found, wanted, rtol=1e-12 if name == "narrow" else 2e-13)


@by_name
def test_nothing_below_everything_above(name):
    law = LAWS[name]
    end = float(jnp.log(law.q[-1] / law.q[0]))
    below_and_above = MOMENT(law, 2.0, np.array([-np.inf, -1e30, -1e-18, 0.0, end + 1e-12, 1e30]))
    np.testing.assert_array_equal(below_and_above[:4], 0.0)
    np.testing.assert_allclose(below_and_above[4:], slope_of(OBJECTS[name]) ** 2, rtol=1e-14)


DERIVED = [("road", 2), ("H = 0", 0), ("H = 1e-9", 2), ("table", 2)]
ALL = [(name, order) for name in OBJECTS for order in (0, 2)]
SLOW = [pytest.param(*case, marks=pytest.mark.slow) for case in ALL if case not in DERIVED]


@pytest.mark.parametrize(("name", "order"), [*DERIVED, *SLOW])
def test_derivatives_of_a_moment(name, order):
    """With respect to the distance and every number of the spectrum, both modes; and of the whole moment."""
    spectrum, leaves = OBJECTS[name], LEAVES[name]
    flat, structure = jax.tree.flatten(spectrum)
    sizes = np.cumsum([np.size(x) for x in flat])[:-1]
    first = leaves[0]
    distance = 0.6 * float(np.log(leaves[2] / first if len(leaves) == 5 else TABLE_Q[-1] / first))

    def of(theta):
        parts = [p.reshape(np.shape(x)) for p, x in zip(jnp.split(theta[1:], sizes), flat, strict=True)]
        law = power_law_of(jax.tree.unflatten(structure, parts))
        return jnp.sum(jnp.log(cumulative_moment(law, order, jnp.stack([theta[0], 1e3]))))

    theta = np.array([distance, *leaves])
    forward, reverse = jax.jit(jax.jacfwd(of))(theta), jax.jit(jax.grad(of))(theta)
    np.testing.assert_allclose(forward, reverse, rtol=1e-11, atol=1e-12 * np.max(np.abs(forward * theta)))
    scale = np.where(theta == 0, 1.0, theta)
    for i, slope in enumerate(np.array(reverse)):
        if name != "no plateau" or i not in (1, 2):  # there q0 and qr tie: one-sided
            with mp.workdps(50):

                def moved(step, i=i):
                    at = [mp.mpf(float(x)) for x in theta]
                    at[i] += step * mp.mpf(float(scale[i]))
                    ends = at[1] * mp.exp(at[0]), mp.mpf(10) ** 30
                    if len(leaves) == 5:
                        return sum(mp.log(self_affine_moment(at[1:], order, q)) for q in ends)
                    return sum(mp.log(table_moment(at[1:6], at[6:], order, q)) for q in ends)

                h = mp.mpf(10) ** -14
                derivative = float((moved(h) - moved(-h)) / (2 * h))
            assert slope * scale[i] == pytest.approx(derivative, rel=1e-9, abs=1e-10)


def test_height_and_slope_up_to_q():
    spectrum = OBJECTS["road"]
    q = np.array([1e-30, 100.0, 100.0 * (1 + 1e-12), 1000.0, 7e3, 3.1e4, 1e30])
    for function, order in ((height_of, 0), (slope_of, 2)):
        wanted = [float(mp.sqrt(exact(ROAD, order, min(max(x, 100.0), 3.1e4)))) for x in q]
        np.testing.assert_allclose(function(spectrum, q), wanted, rtol=1e-13)
        assert function(spectrum, 1e30) == pytest.approx(float(function(spectrum)), rel=1e-15)
    assert height_of(spectrum) == pytest.approx(5e-4, rel=1e-14)
    slopes = jax.jit(jax.vmap(jax.grad(rf.rms_slope, (0, 1)), (None, 0)))(spectrum, q)
    assert all(np.isfinite(x).all() for x in jax.tree.leaves(slopes))


def test_smooth_spectrum_has_height_zero_and_its_derivative():
    smooth = rf.SelfAffine(*ROAD[:4], 0.0)
    assert rf.roughness.rms_height(smooth, 1e4) == 0 and rf.rms_slope(smooth) == 0
    assert jax.jit(jax.grad(rf.roughness.rms_height))(smooth).h_rms == pytest.approx(1.0, rel=1e-14)


def test_wavevector_must_be_positive():
    with pytest.raises(ValueError, match=r"^q = .*must be .*> 0$"):
        rf.rms_slope(OBJECTS["road"], 0.0)


@pytest.mark.parametrize("name", SPECTRA)
@pytest.mark.parametrize("fraction", [1e-3, 0.1, 0.9, 1.0, 1.3])
def test_cutoff_has_the_slope(name, fraction):
    """Below, at and above the present q1; the slope by 50 digits of the continued spectrum."""
    leaves, spectrum = SPECTRA[name], OBJECTS[name]
    slope = fraction * float(slope_of(spectrum))
    q1 = float(rf.roughness.cutoff(spectrum, slope))
    with mp.workdps(50):
        q0, qr, old, hurst, h = (mp.mpf(x) for x in leaves)
        # h_rms of a spectrum with the same plateau, continued far enough.
        C0 = h**2 / self_affine_moment((q0, qr, old, hurst, 1), 0, old)  # 1: h_rms^2 = 1
        end = max(mp.mpf(q1), qr) * 2
        old_height2, height2 = (moment_of_plateau((q0, qr, q, hurst), 0, q) for q in (old, end))
        height2 *= C0 / old_height2
        found = mp.sqrt(self_affine_moment((q0, qr, end, hurst, mp.sqrt(height2)), 2, mp.mpf(q1)))
    # q1 itself, rounded, leaves slope = sqrt(q1 - q0) with fewer digits beside q0.
    beside = 1e-16 * q1 / (q1 - leaves[0])
    assert float(found) == pytest.approx(slope, rel=max(1e-12, 10 * beside))


@pytest.mark.parametrize("name", ["road", "H = 0", "no plateau", "plateau only", "table"])
@pytest.mark.parametrize("fraction", [0.02, 0.5, 0.98])
def test_with_cutoff_keeps_the_spectrum_below(name, fraction):
    spectrum = OBJECTS[name]
    slope = fraction * float(slope_of(spectrum))
    shorter = cut(spectrum, slope)
    assert slope_of(shorter) == pytest.approx(slope, rel=1e-12)
    q1 = float(LAW_OF(shorter).q[-1])
    q = np.geomspace(LEAVES[name][0] * (1 + 1e-12), q1 * (1 - 1e-12), 9)
    np.testing.assert_allclose(spectrum_of(shorter, q), spectrum_of(spectrum, q), rtol=1e-11)
    assert height_of(shorter) == pytest.approx(float(height_of(spectrum, q1)), rel=1e-12)


def test_cutoff_at_the_end_of_a_table():
    table = OBJECTS["table"]
    slope = float(rf.rms_slope(table))
    assert rf.roughness.cutoff(table, slope) == pytest.approx(
        TABLE_Q[-1], rel=1e-4
    )  # saturated: C falls steeply
    assert slope_of(cut(table, slope)) == pytest.approx(slope, rel=1e-14)


def test_cutoff_of_a_published_road():
    """The asphalt of the literature: q0 = 100, qr = 1000 1/m, H = 0.8, 0.5 mm reaches 1.3 near 3.1e4."""
    road = rf.SelfAffine(*ROAD)
    q1 = rf.roughness.cutoff(road)
    assert q1 == pytest.approx(3.1e4, rel=0.02)
    assert rf.rms_slope(rf.with_cutoff(road)) == pytest.approx(1.3, rel=1e-13)
    more = rf.roughness.cutoff(road, 2.0)
    assert more > 3.1e4 and rf.with_cutoff(road, 2.0).h_rms > road.h_rms


def back_by_wavevector(spectrum, slope):
    return rf.rms_slope(spectrum, rf.roughness.cutoff(spectrum, slope))


def back_by_spectrum(spectrum, slope):
    return rf.rms_slope(rf.with_cutoff(spectrum, slope))


@jax.jit
def both_ways(spectrum, slope):
    both = [(jax.jacfwd, back_by_wavevector), (jax.grad, back_by_spectrum)]
    return [jacobian(back, (0, 1))(spectrum, slope) for jacobian, back in both]


@pytest.mark.parametrize("name", [pytest.param("road", marks=pytest.mark.slow), "H = 0", "table"])
def test_derivatives_of_the_cutoff(name):
    """slope(cutoff(s, spectrum), spectrum) = s, so all its derivatives are known: 1 and 0."""
    spectrum = OBJECTS[name]
    slope = 0.4 * float(slope_of(spectrum))
    for by_leaves, by_slope in both_ways(spectrum, slope):
        relative = jax.tree.map(lambda d, x: d * x / slope, by_leaves, spectrum)
        assert by_slope == pytest.approx(1.0, rel=1e-12)
        for value in jax.tree.leaves(relative):
            np.testing.assert_allclose(value, 0.0, atol=1e-11)


@pytest.mark.parametrize(
    "spectrum", [OBJECTS["table"], rf.SelfAffine(*ROAD[:4], 0.0)], ids=["table", "smooth"]
)
def test_slope_never_reached(spectrum):
    with pytest.raises(ValueError, match=r"^rms_slope = 1000.0: must be at most .*the slope of the whole"):
        rf.roughness.cutoff(spectrum, 1000.0)
    with pytest.raises(ValueError, match=r"^rms_slope = -1: must be > 0$"):
        rf.roughness.cutoff(spectrum, -1)
    assert jax.jit(rf.roughness.cutoff)(spectrum, 1000.0) == np.inf
    slopes = jax.jit(jax.grad(rf.roughness.cutoff, (0, 1)))(spectrum, 1000.0)
    assert all((x == 0).all() for x in jax.tree.leaves(slopes))


@pytest.mark.parametrize("name", ["road", "H = 0", "H = 1", "no plateau", "plateau only"])
@pytest.mark.parametrize("fraction", [1.01, 2.0, 5.0])
def test_cutoff_at_a_height(name, fraction):
    """The spectrum with that q1 and all its other numbers, the height too, has the slope."""
    spectrum = OBJECTS[name]
    plateau = float(rf.rms_slope(dataclasses.replace(spectrum, q1=spectrum.qr * (1 + 1e-9) + 1e-3)))
    slope = fraction * plateau
    q1 = rf.roughness.cutoff(spectrum, slope, keep="h_rms")
    assert rf.rms_slope(dataclasses.replace(spectrum, q1=q1)) == pytest.approx(slope, rel=1e-11)


@jax.jit
def slope_at_height(spectrum, slope):
    def back(spectrum, slope):
        q1 = rf.roughness.cutoff(spectrum, slope, keep="h_rms")
        return rf.rms_slope(dataclasses.replace(spectrum, q1=q1))

    both = [jacobian(back, (0, 1))(spectrum, slope) for jacobian in (jax.jacfwd, jax.grad)]
    return [*both, jax.hessian(back, 1)(spectrum, slope)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["road", "H = 0"])
def test_derivatives_of_the_cutoff_at_a_height(name):
    """The slope at the cutoff is the given one, so its derivatives are 1 and 0."""
    spectrum, slope = OBJECTS[name], 2.3 * float(slope_of(OBJECTS[name]))
    *both, second = slope_at_height(spectrum, slope)
    for by_leaves, by_slope in both:
        assert by_slope == pytest.approx(1.0, rel=1e-10)
        for value in jax.tree.leaves(jax.tree.map(lambda d, x: d * x / slope, by_leaves, spectrum)):
            np.testing.assert_allclose(value, 0.0, atol=1e-9)
    assert second * slope == pytest.approx(0.0, abs=1e-7)


def test_cutoff_at_a_height_where_there_is_none():
    """Below the plateau's own slope; of a table, whose C stays, as without it."""
    road = OBJECTS["road"]
    with pytest.raises(ValueError, match=r"^rms_slope = 0\.01: no cutoff gives this slope .* the plateau"):
        rf.roughness.cutoff(road, 0.01, keep="h_rms")
    assert jax.jit(lambda s: rf.roughness.cutoff(road, s, keep="h_rms"))(0.01) == np.inf
    both = [rf.roughness.cutoff(OBJECTS["table"], 0.1, keep=keep) for keep in ("C", "h_rms")]
    assert both[0] == both[1]
    with pytest.raises(ValueError, match=r"^keep = 'C0': must be \"C\" or \"h_rms\"$"):
        rf.roughness.cutoff(road, 1.0, keep="C0")
    with pytest.raises(ValueError, match=r"^spectrum is a Body: must be"):
        rf.with_cutoff(rf.Body(rf.Rigid()))


def test_single_precision():
    leaves = (1e-2, 1e2, 1e9, 0.8, 5e-4)
    single = rf.SelfAffine(*(jnp.float32(x) for x in leaves))
    found = rf.rms_slope(single, jnp.float32(1e6))
    assert found.dtype == jnp.float32
    assert found == pytest.approx(float(mp.sqrt(exact(leaves, 2, 1e6))), rel=1e-5)
    q1 = rf.roughness.cutoff(single, jnp.float32(0.5))
    assert q1.dtype == jnp.float32 and rf.rms_slope(single, q1) == pytest.approx(0.5, rel=1e-5)
    assert {x.dtype for x in jax.tree.leaves(rf.with_cutoff(single, 0.5))} == {jnp.dtype(jnp.float32)}


def test_a_gradient_without_jit():
    """h_rms and the slope are proportional to the parameter h_rms, C to its square."""

    def road(height):
        return rf.SelfAffine(*ROAD[:4], height)

    for function, power in (
        (rf.roughness.rms_height, 1),
        (rf.rms_slope, 1),
        (lambda s: rf.power_spectrum(s, 2e3), 2),
    ):
        slope = jax.grad(lambda height, function=function: function(road(height)))(5e-4)
        assert float(slope) == pytest.approx(power * float(function(road(5e-4))) / 5e-4, rel=1e-12)
