"""Where a measured spectrum begins and ends within its table: against tables that really end there."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.counting.compilations import compilations
from support.scenes.fits import FAST

import rubberfric as rf
from rubberfric.roughness.moments import cumulative_moment

rng = np.random.default_rng(5)
Q = np.geomspace(1e2, 1e6, 12) * np.exp(0.1 * rng.standard_normal(12))
C = 1e-10 * np.minimum(1, (Q / 1e3) ** -3.6) * np.exp(0.3 * rng.standard_normal(12))
TREAD = rf.Prony(4e6, [8e8, 7e8, 9e7, 1.5e7], [1e-9, 1e-7, 1e-5, 1e-3])
V = np.geomspace(1e-4, 1.0, 4)  # [m/s]
P = 3e5  # [Pa]
# (q0, q1): the ends of the table, between entries, on them, within one piece.
CUTS = {
    "ends": (Q[0], Q[-1]),
    "below": (Q[0], 1.3 * Q[7]),
    "both": (1.2 * Q[1], 1.3 * Q[8]),
    "entries": (Q[1], Q[8]),
    "one piece": (1.1 * Q[4], 1.4 * Q[4]),
}
by_cut = pytest.mark.parametrize("name", CUTS)


def values_at(q, C, at):
    return np.exp(np.interp(np.log(at), np.log(q), np.log(C)))


def really_cut(q0, q1, q=Q, C=C):
    inside = q[(q > q0 * (1 + 1e-9)) & (q < q1 * (1 - 1e-9))]
    at = np.concatenate([[q0], inside, [q1]])
    return rf.TabulatedSpectrum(at, values_at(q, C, at))


def table(x):
    """The table with C, q0 and q1 moved by their logarithms, shape (14,)."""
    q0, q1 = jnp.exp(x[:2])
    return rf.TabulatedSpectrum(Q, C * jnp.exp(x[2:]), q0, q1)


def at_cut(name):
    return np.concatenate([np.log(CUTS[name]), np.zeros(12)])


def on_road(spectrum):
    return rf.Scene(rf.Body(rf.Rigid(), spectrum), rf.Body(TREAD))


@jax.jit
def moments_up_to(spectrum, q0, q):
    return [cumulative_moment(spectrum.power_law(), order, jnp.log(q / q0)) for order in (0, 2, 4)]


@by_cut
def test_spectrum_and_moments(name):
    """Values at every q, and moments up to it, at wavevectors within, on and outside the ends."""
    q0, q1 = CUTS[name]
    found, exact = rf.TabulatedSpectrum(Q, C, q0, q1), really_cut(q0, q1)
    q = np.concatenate([Q, np.geomspace(q0, q1, 7)[1:-1], [q0, q1]])
    inside = (q >= q0) & (q <= q1)
    np.testing.assert_allclose(
        rf.power_spectrum(found, q), np.where(inside, values_at(Q, C, q), 0.0), rtol=1e-13
    )
    for one, other in zip(moments_up_to(found, q0, q), moments_up_to(exact, q0, q), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)
    np.testing.assert_allclose(rf.rms_slope(found, q), rf.rms_slope(exact, q), rtol=1e-12)
    np.testing.assert_allclose(rf.roughness.rms_height(found), rf.roughness.rms_height(exact), rtol=1e-12)
    lines = [rf.roughness.line_spectrum(one, np.geomspace(10.0, 1.1 * q1, 5)) for one in (found, exact)]
    np.testing.assert_allclose(*lines, rtol=1e-11)


def log_slope(x):
    return jnp.log(rf.rms_slope(table(x)))


MANY_SLOPES = jax.jit(jax.vmap(log_slope))
SLOPES_OF_SLOPE = jax.jit(lambda x: (jax.jacfwd(log_slope)(x), jax.jacrev(log_slope)(x)))


@by_cut
def test_derivatives_of_the_slope(name):
    """By C, q0 and q1, also at an entry, where the second derivative jumps but the first does not."""
    x, h = at_cut(name), 1e-4
    forward, reverse = SLOPES_OF_SLOPE(x)
    np.testing.assert_allclose(forward, reverse, rtol=1e-12, atol=1e-14)
    moved = MANY_SLOPES(x + h * np.concatenate([k * np.eye(14) for k in range(5)]))
    up = np.array([-25, 48, -36, 16, -3]) @ np.array(moved).reshape(5, 14) / (12 * h)
    down = MANY_SLOPES(x - h * np.concatenate([k * np.eye(14) for k in range(5)]))
    down = -np.array([-25, 48, -36, 16, -3]) @ np.array(down).reshape(5, 14) / (12 * h)
    np.testing.assert_allclose(forward, up, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(forward, down, rtol=1e-8, atol=1e-9)


@jax.jit
def solved(spectrum):
    found = rf.solve(on_road(spectrum), V, P, quadrature=FAST)
    return jnp.stack([found.friction, found.area, found.separation])


@pytest.mark.parametrize("name", ["ends", "both", "entries"])
def test_contact_and_friction(name):
    q0, q1 = CUTS[name]
    np.testing.assert_allclose(
        solved(rf.TabulatedSpectrum(Q, C, q0, q1)), solved(really_cut(q0, q1)), rtol=1e-12
    )


def log_friction(x):
    return jnp.log(rf.friction(on_road(table(x)), V, P))


FRICTION, FORWARD, REVERSE = (
    jax.jit(f) for f in (log_friction, jax.jacfwd(log_friction), jax.jacrev(log_friction))
)


@pytest.mark.parametrize("name", CUTS)
def test_derivatives_of_the_friction(name):
    x, h = at_cut(name), 2e-4
    forward = FORWARD(x)
    np.testing.assert_allclose(forward, REVERSE(x), rtol=1e-9, atol=1e-13)
    for i in (0, 1, 6, 10):  # q0, q1 and two of C
        step = h * np.eye(14)[i]
        inward = -1.0 if i == 1 else 1.0  # from an entry, of one piece; and within the table
        five = np.stack([FRICTION(x + inward * k * step) for k in range(5)])
        slope = inward * np.array([-25, 48, -36, 16, -3]) @ five / (12 * h)
        np.testing.assert_allclose(forward[:, i], slope, atol=1e-7, rtol=1e-7)


@pytest.mark.slow
def test_one_program_for_every_cut():
    scene = on_road(rf.TabulatedSpectrum(Q, C, *CUTS["both"]))
    with compilations() as compiled:
        rf.friction(scene, V, P, quadrature=FAST).block_until_ready()
        first = len(compiled)
        for cut in CUTS.values():
            other = scene.replace(dict(zip(("lower.spectrum.q0", "lower.spectrum.q1"), cut, strict=True)))
            rf.friction(other, V, P, quadrature=FAST).block_until_ready()
    assert first > 0 and compiled[first:] == []


DIRECTIONS = C[:, None] * (1 + 0.4 * np.cos(2 * np.pi * np.arange(8) / 8 - np.linspace(0, 1, 12)[:, None]))


@pytest.mark.slow
def test_directions_are_cut():
    """Quotients of harmonics and mean are linear in ln q, not their logarithms."""
    q0, q1 = CUTS["both"]
    law, at = np.mean(DIRECTIONS, 1), np.asarray(really_cut(q0, q1).q)
    quotient = [np.interp(np.log(at), np.log(Q), column) for column in (DIRECTIONS / law[:, None]).T]
    exact = rf.TabulatedAnisotropic(at, values_at(Q, law, at)[:, None] * np.stack(quotient, 1), 0.2)
    spectra = rf.TabulatedAnisotropic(Q, DIRECTIONS, 0.2, q0, q1), exact
    found, wanted = (np.asarray(solved(spectrum)) for spectrum in spectra)
    np.testing.assert_allclose(found, wanted, rtol=1e-11)


@pytest.mark.slow
def test_profile_ends_at_the_cut():
    found, exact = (
        rf.analysis.profile(on_road(one), V[:2], P, quadrature=FAST)
        for one in (rf.TabulatedSpectrum(Q, C, *CUTS["both"]), really_cut(*CUTS["both"]))
    )
    for one, other in zip(found, exact, strict=True):
        if one is not None:
            np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-14)
    assert float(found.q[-1]) == CUTS["both"][1]


@pytest.mark.slow
def test_joined_and_resampled():
    """A cut table joins and resamples like a table that ends there."""
    upper = rf.SelfAffine(1e4, 1e4, 1e7, 0.8, 1e-6)
    for q0, q1 in (CUTS["both"], (Q[0], 3e3)):  # overlapping, and with a gap
        found, exact = (
            rf.roughness.join_spectra(one, upper)
            for one in (rf.TabulatedSpectrum(Q, C, q0, q1), really_cut(q0, q1))
        )
        np.testing.assert_allclose(found.spectrum.q, exact.spectrum.q, rtol=1e-13)
        np.testing.assert_allclose(found.spectrum.C, exact.spectrum.C, rtol=1e-11)
        np.testing.assert_allclose(found.joints[0], exact.joints[0], rtol=1e-9)
    finer = [
        rf.roughness.resample(one, per_decade=4, preserve=True)
        for one in (rf.TabulatedSpectrum(Q, C, *CUTS["both"]), really_cut(*CUTS["both"]))
    ]
    np.testing.assert_allclose(finer[0].C, finer[1].C, rtol=1e-10)


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ({"q1": 2e7}, r"^TabulatedSpectrum\.q1 = 2e\+07|q1 = 20000000\.0: must lie within the table, "),
        ({"q0": 1.0}, r"^TabulatedSpectrum\.q0 = 1\.0: must lie within the table, \S+ \.\.\. \S+ 1/m$"),
        ({"q0": 2e4, "q1": 1e4}, r"^TabulatedSpectrum\.q1 = 10000\.0: must be > q0 = 20000\.0$"),
        ({"q1": -1.0}, r"^TabulatedSpectrum\.q1 = -1\.0: must be > 0$"),
        ({"q1": [1e4]}, r"^TabulatedSpectrum\.q1 has shape \(1,\): must be a scalar$"),
    ],
)
def test_refused(ends, message):
    with pytest.raises(ValueError, match=message):
        rf.TabulatedSpectrum(Q, C, **ends)
    with pytest.raises(ValueError, match=message.replace("^", "^lower.spectrum: ").split("|")[-1]):
        on_road(rf.TabulatedSpectrum(Q, C)).replace({f"lower.spectrum.{k}": x for k, x in ends.items()})


def test_single_precision():
    """The ends of a table are its ends in its own precision; the cut keeps float32."""
    single = rf.TabulatedSpectrum(np.float32(Q), np.float32(C * 1e3), Q[0], Q[-1])
    whole = rf.TabulatedSpectrum(np.float32(Q), np.float32(C * 1e3))
    assert rf.rms_slope(single) == pytest.approx(float(rf.rms_slope(whole)), rel=1e-6)
    cut = rf.TabulatedSpectrum(np.float32(Q), np.float32(C), np.float32(CUTS["both"][0]))
    assert {x.dtype for x in jax.eval_shape(lambda one: one.power_law(), cut)} == {jnp.dtype(jnp.float32)}


def test_the_cut_of_a_slope_is_a_number_of_the_table():
    """`with_cutoff` sets q1 and keeps the table; the present q1 does not limit it."""
    spectrum = rf.TabulatedSpectrum(Q, C, 1.2 * Q[1], 1.1 * Q[3])
    slope = 0.8 * float(rf.rms_slope(rf.TabulatedSpectrum(Q, C, 1.2 * Q[1])))
    cut = rf.with_cutoff(spectrum, slope)
    assert cut.q1 > spectrum.q1 and cut.q0 == spectrum.q0
    np.testing.assert_array_equal(cut.C, C)
    assert rf.rms_slope(cut) == pytest.approx(slope, rel=1e-13)
    directions = rf.TabulatedAnisotropic(Q, DIRECTIONS)
    assert rf.rms_slope(rf.with_cutoff(directions, slope)) == pytest.approx(slope, rel=1e-13)
    unreached = jax.jit(rf.with_cutoff)(spectrum, 1e3)
    assert float(unreached.q1) == Q[-1]


@pytest.mark.parametrize("ends", [(None, None), (1.2 * Q[1], 1.3 * Q[8])])
def test_padded_tables_say_the_same(ends):
    """Tables of 10 entries as ones of 12: C, slopes and directions."""
    tables = (
        rf.TabulatedSpectrum(Q[:10], C[:10], *ends),
        rf.TabulatedAnisotropic(Q[:10], DIRECTIONS[:10], 0.2, *ends),
    )
    for found in tables:
        longer = found.padded()
        assert longer.q.size == 12 and (longer.q0, longer.q1) == (
            Q[0] if ends[0] is None else ends[0],
            found.q[-1] if ends[1] is None else ends[1],
        )
        q = np.geomspace(50.0, 2e6, 30)
        np.testing.assert_allclose(rf.power_spectrum(longer, q), rf.power_spectrum(found, q), rtol=1e-13)
        np.testing.assert_allclose(rf.rms_slope(longer, q), rf.rms_slope(found, q), rtol=1e-13)
    inside = np.geomspace(Q[0], Q[9], 7)
    harmonics_at = jax.jit(lambda one, q: one.harmonics_at(q))
    for one, other in zip(harmonics_at(longer, inside), harmonics_at(found, inside), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12)


@by_cut
def test_all_breakpoints_lie_on_the_table(name):
    law = rf.TabulatedSpectrum(Q, C, *CUTS[name]).power_law()
    found = law.height2 * np.exp(law.log_value) / law.q**2
    np.testing.assert_allclose(found, values_at(Q, C, np.asarray(law.q)), rtol=1e-12)
