"""Boundary elements: closed forms of contact mechanics, the conditions themselves, and published numbers."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import MAXWELL, Q0, RIGID, TREAD, WLF, scene, slope_one

import rubberfric as rf
from rubberfric.analysis import boundary_element, random_surface, sliding_contact

ELASTIC = rf.Elastic(2.0e6, 0.3)
E_STAR = 2.0e6 / (1 - 0.3**2)
ROUGH = scene((RIGID, slope_one()), (MAXWELL,))
FINE = scene((RIGID, slope_one(4.0)), (MAXWELL,))  # 16 points a shortest wavelength at 128, 2 periods


def test_hertz():
    """Spheres anywhere on the grid, their images ten contact radii away."""
    n, length, radius = 128, 1.0, 2.0
    x, random, found = length * (np.arange(n) / n - 0.5), np.random.default_rng(0), []
    for a in np.linspace(0.07, 0.1, 8):
        load = 4 * E_STAR * a**3 / (3 * radius)
        cx, cy = random.uniform(-0.5, 0.5, 2) / n
        sphere = -((x[:, None] - cx) ** 2 + (x - cy) ** 2) / (2 * radius)
        one = sliding_contact(sphere, length, ELASTIC, 0.0, load / length**2)
        assert one.converged
        np.testing.assert_allclose(one.pressure.max(), 1.5 * load / (math.pi * a**2), rtol=4e-3)
        found.append(np.array([one.area, one.pixel_area]) * length**2 / (math.pi * a**2))
    area, in_pixels = np.mean(found, 0)
    np.testing.assert_allclose(area, 1, atol=0.01)
    assert in_pixels > 1.015


@pytest.mark.parametrize("share", [0.05, 0.4, 0.9])
@pytest.mark.parametrize("across", [False, True])
def test_wavy_surface(share, across):
    """Partial contact of a sine [Westergaard, J. Appl. Mech. 6 (1939) A49]."""
    n, length, height = 128, 0.3, 1e-3
    full = math.pi * E_STAR * height / length
    x = length * np.arange(n) / n
    heights = np.broadcast_to(height * np.cos(2 * math.pi * x / length), (n, n))
    found = sliding_contact(heights if across else heights.T, length, ELASTIC, 0.0, share * full)
    edge = math.asin(math.sqrt(share))
    np.testing.assert_allclose(found.area, 2 / math.pi * edge, atol=1.0 / n)  # whole pixels
    inside = np.maximum(math.sin(edge) ** 2 - np.sin(math.pi * x / length) ** 2, 0)
    exact = 2 * full * np.abs(np.cos(math.pi * x / length)) * np.sqrt(inside)
    row = found.pressure[0] if across else found.pressure[:, 0]
    np.testing.assert_allclose(row, exact, atol=0.05 * exact.max())  # the points next to the edge
    np.testing.assert_allclose(row[exact > 0.5 * exact.max()], exact[exact > 0.5 * exact.max()], rtol=1e-2)
    np.testing.assert_allclose(row.max(), exact.max(), rtol=2e-3)


TABLE = rf.TabulatedModulus(
    np.geomspace(1e-2, 1e6, 30), 1e6 + 1e5 * np.geomspace(1e-2, 1e6, 30) ** 0.3, 1e5 * np.geomspace(1, 10, 30)
)


@pytest.mark.parametrize("material", [TREAD, TABLE, rf.PronyShear(1e6, [1e7, 1e8], [1e-3, 1e-6], 2e9)])
@pytest.mark.parametrize("velocity", [0.02, -3.0])
def test_full_contact_of_a_wave(material, velocity):
    """Loss modulus in, friction out: mu = q_x q |h|^2 E''/(4 sigma_0), h = height cos(q x)."""
    n, length, height = 32, 1e-3, 1e-6
    kx, ky = 3, 2
    x = 2 * math.pi * np.arange(n) / n
    heights = height * np.cos(kx * x[:, None] + ky * x)
    qx, q = 2 * math.pi * kx / length, 2 * math.pi * math.hypot(kx, ky) / length
    omega = qx * abs(velocity)
    if isinstance(material, rf.PronyShear):
        G = material.G_inf + np.sum(
            material.G * (1j * omega * material.tau / (1 + 1j * omega * material.tau))
        )
        nu = (3 * material.bulk - 2 * G) / (2 * (3 * material.bulk + G))
        loss = complex(2 * G * (1 + nu) / (1 - nu**2)).imag
    else:
        loss = float(rf.complex_modulus(material, omega).imag) / (1 - 0.5**2)
    found = sliding_contact(heights, length, material, velocity, 5e7, tolerance=1e-9)
    exact = np.sign(velocity) * qx * q * height**2 * loss / (4 * 5e7)
    np.testing.assert_allclose([found.friction, found.friction_of_heat], exact, rtol=1e-4)
    assert found.area == 1.0 and found.separation == 0.0


def modes_of(surface):
    """Squares of the amplitudes, and wavevectors, of all modes of a surface, in NumPy."""
    n = surface.heights.shape[0]
    qx = 2 * math.pi / surface.length * np.fft.fftfreq(n, 1 / n)[:, None]
    return np.abs(np.fft.fft2(surface.heights) / n**2) ** 2, qx, np.hypot(qx, qx.T)


@pytest.mark.parametrize("velocity", [0.02, -0.3])
def test_full_contact_of_two_rough_solids(velocity):
    """A surface excites the other solid, in series with its own solid at rest: mu of every mode."""
    other = rf.Prony(2.0, [30.0], [0.1], 0.0)
    rough = slope_one(4.0)
    both = scene((other, rough), (MAXWELL, rough))
    key = jax.random.key(3)
    found = boundary_element(both, velocity, 50.0, key, grid=32, periods=1.0, tolerance=1e-9)
    exact = 0.0
    for k, own, passing in ((key, other, MAXWELL), (jax.random.fold_in(key, 1), MAXWELL, other)):
        power, qx, q = modes_of(random_surface(rough, k, 32, 1.0))
        omega = 1j * qx * abs(velocity)
        tau, at_rest = float(passing.tau[0]), float(own.E_inf)
        moving = float(passing.E_inf) + float(passing.E[0]) * omega * tau / (1 + omega * tau)
        exact += np.sum(power * qx * q / 2 * np.imag(moving * at_rest / (moving + at_rest))) / 50.0
    np.testing.assert_allclose([found.friction, found.friction_of_heat], np.sign(velocity) * exact, rtol=1e-5)
    assert found.area == 1.0


@pytest.mark.parametrize("lower", [MAXWELL, rf.Elastic(5.0, 0.0), RIGID])
def test_two_rough_solids_in_partial_contact(lower):
    """The work of friction is the heat of both solids. If one solid is smooth, one surface makes the heat."""
    rough = slope_one(4.0)
    upper = rf.Body(MAXWELL, rough.replace(h_rms=0.5 * rough.h_rms))
    both = rf.Scene(rf.Body(lower, rough), upper)

    def solved(upper):
        options = {"grid": 32, "periods": 1.0, "tolerance": 1e-5}
        return boundary_element(both.replace(upper=upper), 0.02, 0.15, jax.random.key(1), **options)

    found = solved(upper)
    assert found.pressure.shape == (32, 32, 32) and 0.05 < found.area < 0.6
    np.testing.assert_allclose(found.friction, found.friction_of_heat, rtol=3e-2)
    flat = solved(rf.Body(MAXWELL, rough.replace(h_rms=1e-9 * rough.h_rms)))
    exact = solved(rf.Body(MAXWELL))
    np.testing.assert_allclose([flat.friction, flat.area], [exact.friction, exact.area], rtol=1e-4)


def test_full_contact_of_a_slab():
    slab = rf.Slab(0.3 / Q0, "bonded")
    layered = scene((RIGID, slope_one(4.0)), (rf.Prony(1.0, [9.0], [1.0], 0.4), None, slab))
    key = jax.random.key(1)
    found = boundary_element(layered, 0.02, 500.0, key, grid=32, periods=1.0, tolerance=1e-9)
    power, qx, q = modes_of(random_surface(slope_one(4.0), key, 32, 1.0))
    x, a, omega = q * 0.3 / Q0, 3 - 4 * 0.4, 1j * qx * 0.02
    x[0, 0] = 1.0
    stiff = 2 * a * np.sinh(x) ** 2 + 2 * x**2 + 8 * 0.6**2
    stiff /= a * (np.sinh(2 * x) - 2 * x) + 4 * (1 - 0.8) * x
    loss = np.imag(9 * omega / (1 + omega)) / (1 - 0.4**2)
    exact = np.sum(power * qx * q / 2 * stiff * loss) / 500.0
    np.testing.assert_allclose([found.friction, found.friction_of_heat], exact, rtol=1e-5)


def test_anisotropic_surface():
    """Slopes along and across: 1 +- c_1 / 2 of their mean."""
    spectrum = rf.Anisotropic(slope_one(16.0), 2.0, 0.3)
    surface = random_surface(spectrum, jax.random.key(2), 256, 4.0)
    power, qx, _ = modes_of(surface)
    xx, yy, xy = (np.sum(power * one) for one in (qx**2, qx.T**2, qx * qx.T))
    cosine, sine = (float(one[0]) for one in spectrum.harmonics_at(jnp.asarray(Q0)))
    np.testing.assert_allclose((xx - yy) / (xx + yy), cosine / 2, atol=0.01)
    np.testing.assert_allclose(2 * xy / (xx + yy), sine / 2, atol=0.01)


def test_conditions_of_contact():
    """Gaps of the pressures by the compliances, in NumPy: no pressure where there is a gap, none below 0."""
    found = boundary_element(FINE, 0.02, 0.1, jax.random.key(3), grid=64, periods=2.0, tolerance=1e-8)
    assert found.converged and found.residual <= 1e-8
    n = 64
    qy = 2 * math.pi / found.length * np.fft.fftfreq(n, 1 / n)
    qx = qy[:, None]
    omega = 1j * qx * 0.02
    stiffness = np.hypot(qx, qy) / 2 * (1 + 9 * omega / (1 + omega))
    stiffness[n // 2] = stiffness[n // 2].real
    modes = np.fft.fft2(found.pressure)
    u = np.fft.ifft2(np.divide(modes, stiffness, out=np.zeros_like(modes), where=stiffness != 0)).real
    gap = u - found.heights
    gap -= np.mean(gap[found.pressure > 0])
    height = found.heights.std()
    np.testing.assert_allclose(found.pressure.mean(), 0.1, rtol=1e-6)
    np.testing.assert_allclose(found.gap, gap, atol=1e-5 * height)
    assert not np.any((found.pressure > 0) & (found.gap > 0))
    assert found.pressure.min() == 0 and found.gap.min() == 0


def test_reversal():
    """Backwards over the mirrored surface: the same pressures mirrored, and the friction changes its sign."""
    surface = random_surface(FINE.lower.spectrum, jax.random.key(0), 64, 2.0)
    forth = sliding_contact(*surface, MAXWELL, 0.02, 0.1)
    mirrored = np.roll(surface.heights[::-1], 1, 0)
    back = sliding_contact(mirrored, surface.length, MAXWELL, -0.02, 0.1)
    np.testing.assert_allclose(back.friction, -forth.friction, rtol=1e-4)
    assert forth.friction > 0
    atol = 1e-3 * forth.pressure.max()
    np.testing.assert_allclose(np.roll(back.pressure[::-1], 1, 0), forth.pressure, atol=atol)
    still = sliding_contact(*surface, MAXWELL, 0.0, 0.1)
    assert still.friction_of_heat == 0 and abs(still.friction) < 2e-3 and still.heat_beyond(1.0) == 0


def test_a_surface_that_alternates_from_point_to_point_has_no_direction():
    """Turned round it is the same one row on, so that nothing can pull either way."""
    waves = np.random.default_rng(0).standard_normal(32)
    heights = 0.02 * np.where(np.arange(32)[:, None] % 2, waves, -waves)
    found = sliding_contact(heights, 1.0, MAXWELL, 0.02, 0.1)
    assert found.converged and 0.1 < found.pixel_area < 0.9
    assert abs(found.friction) < 1e-6 and abs(found.friction_of_heat) < 1e-12


def test_both_forms_of_the_friction_agree():
    found = boundary_element(FINE, 0.02, 0.1, jax.random.key(1), grid=128, periods=2.0)
    np.testing.assert_allclose(found.friction, found.friction_of_heat, rtol=1e-2)
    np.testing.assert_allclose(found.friction_by_wavevector.sum(), found.friction_of_heat, rtol=1e-12)
    assert 0.05 < found.heat_beyond(4 * Q0) < 0.4


def test_random_surface():
    spectrum = slope_one(4.0)
    coarse, fine = (random_surface(spectrum, jax.random.key(2), n, 4.0) for n in (64, 192))
    np.testing.assert_allclose(fine.heights[::3, ::3], coarse.heights, atol=1e-12)
    assert fine.length == 4 * 2 * math.pi / Q0
    np.testing.assert_allclose(fine.heights.std(), spectrum.h_rms, rtol=0.05)
    measured = rf.roughness.spectrum_of_topography(
        fine.heights, fine.length / 192, window="none", detrend=None, per_decade=5
    )
    inside = (measured.q > 1.2 * Q0) & (measured.q < 3.2 * Q0)
    np.testing.assert_allclose(measured.C[inside], rf.power_spectrum(spectrum, measured.q[inside]), rtol=0.15)
    other = random_surface(spectrum, jax.random.key(3), 64, 4.0)
    assert abs(np.mean(other.heights * coarse.heights)) < 0.3 * coarse.heights.std() ** 2


def test_distributions():
    found = boundary_element(FINE, 0.02, 0.1, jax.random.key(1), grid=64, periods=2.0)
    for field, share in (("pressure", found.pixel_area), ("gap", 1 - found.pixel_area)):
        values, density = found.distribution(field, 40)
        np.testing.assert_allclose(density.sum() * (values[1] - values[0]), share, rtol=1e-9)
    with pytest.raises(ValueError, match=r'^field = .heat.: must be "pressure" or "gap"$'):
        found.distribution("heat")


def test_shift_with_temperature():
    """Hotter by a factor in time is slower by it."""
    material = rf.Prony(1.0, [9.0], [1.0], 0.3, WLF)
    hot = scene((RIGID, slope_one(4.0)), (material,))
    factor = float(np.exp(WLF.log_factor(300.0)))
    options = {"grid": 32, "periods": 2.0, "tolerance": 1e-7}
    found = boundary_element(hot, 0.02 / factor, 0.1, jax.random.key(1), 300.0, **options)
    cold = boundary_element(hot, 0.02, 0.1, jax.random.key(1), **options)
    np.testing.assert_allclose([found.friction, found.area], [cold.friction, cold.area], rtol=1e-4)


def test_what_did_not_converge_says_so():
    found = boundary_element(FINE, 0.02, 0.1, jax.random.key(1), grid=64, periods=2.0, most_steps=3)
    assert not found.converged and found.iterations == 3 and found.residual > 1e-5


REFUSED = {
    "both solids are smooth": scene((RIGID,), (TREAD,)),
    "a solid has a Coating": scene((RIGID, slope_one()), (TREAD, None, rf.Coating(1e-3, ELASTIC))),
    "the scene has heating": scene((RIGID, slope_one()), (TREAD,), heating=rf.Heating(1e3, 1e3, 0.2, 1e-3)),
    r"grid = 64: must be even and >= 128, .* 256 reduces": ROUGH,
}


@pytest.mark.parametrize("words", REFUSED)
def test_refusals(words):
    with pytest.raises(ValueError, match=words):
        boundary_element(REFUSED[words], 1.0, 1e5, jax.random.key(0), grid=64)


def test_single_precision_is_refused():
    with jax.enable_x64(False), pytest.raises(ValueError, match="double precision"):
        sliding_contact(np.zeros((8, 8)), 1.0, ELASTIC, 0.0, 1.0)
