"""The law fitted to boundary elements: its stored evaluations, brute force, limits, derivatives, refusals."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import optimize, special
from support.folders import BOUNDARY_ELEMENTS, DATA

import rubberfric as rf
from rubberfric.analysis.jacobian import value_and_jacobian
from rubberfric.theory.area.law_roughness import CONSTANTS

STORED = BOUNDARY_ELEMENTS / "friction_law.json"
ROAD = rf.SelfAffine(q0=100.0, qr=400.0, q1=1e4, hurst=0.8, h_rms=2e-4)
RUBBER = rf.Prony(1e6, [9e6, 3e6], [1e-3, 1e-1], poisson=0.5)


def _scene(material=RUBBER, road=ROAD, **options):
    return rf.Scene(
        rf.Body(material), rf.Body(rf.Rigid(), road), contact_model="boundary_elements", **options
    )


MODELS = "boundary_elements", "paper"
_value_and_slopes = jax.jit(jax.value_and_grad(rf.friction, argnums=(0, 2)))


def _solve(scene, velocity, pressure):
    return rf.solve(scene, velocity, pressure, quantities=("area", "friction"))


def _with(name):
    return _scene().replace({"contact_model": name})


def _rubber(omega):
    """Return E / (1 - nu^2) of RUBBER."""
    relaxing = sum(E * 1j * omega * tau / (1 + 1j * omega * tau) for E, tau in ((9e6, 1e-3), (3e6, 0.1)))
    return (1e6 + relaxing) / 0.75


def _isotropic(phi):
    return np.ones_like(phi)


def _brute_force(
    E_of, road, velocity, pressure, count=3000, angles=400, *, stiffer=np.ones_like, density=_isotropic
):
    """Area and friction along and across, by trapezoids, on E / (1 - nu^2) = `E_of` omega.

    road : self-affine, the mean over the directions
    stiffer : ratio of the stiffnesses of a slab and a half-space, as a function of q
    density : C(q, phi) over its mean over phi
    """
    c = CONSTANTS
    q0, qr, q1, hurst = (float(x) for x in (road.q0, road.qr, road.q1, road.hurst))
    s = np.linspace(0, 1, count + 1)[1:]
    q = q0 * np.exp(s**2 * np.log(q1 / q0))
    step = 2 * s * np.log(q1 / q0) / count
    step[-1] /= 2
    shape = np.where(q < qr, 1.0, (q / qr) ** (-2 - 2 * hurst))
    C = float(road.h_rms) ** 2 * shape / (2 * np.pi * np.sum(q**2 * shape * step))
    phi = (np.arange(angles) + 0.5) / angles
    phi = np.pi / 2 * (1 - (1 - phi) ** 4)  # towards cos(phi) = 0
    dphi = np.gradient(phi) / np.sum(np.gradient(phi)) / 2
    phi, dphi = np.append(phi, -phi), np.append(dphi, dphi)
    beyond = q1 * np.exp((np.arange(count) + 0.5) / count * np.log(6))
    dln = np.log(6) / count
    circle = np.linspace(0, np.pi, 2000, endpoint=False)
    full, light = (density(phi) ** x / np.mean(density(circle) ** x) for x in (1, 1 - c.c_g))
    e2 = abs(np.mean(density(circle) * np.exp(2j * circle)) / np.mean(density(circle))) ** 2

    def mean(f, A):
        return f @ (dphi * (A * full + (1 - A) * light))

    E, E_beyond = (E_of(x[:, None] * velocity * np.cos(phi)) * stiffer(x)[:, None] for x in (q, beyond))
    m0, m2, m4 = (2 * np.pi * np.sum(q ** (2 + n) * C * step) for n in (0, 2, 4))
    alpha = m0 * m4 / m2**2
    density_q = q**4 * C
    F = (np.cumsum(density_q * step) - 0.5 * density_q * step) / np.sum(density_q * step)
    D = density_q / np.sum(density_q * step)

    def means(E, A):
        """E_g, E_r and E_h."""
        squares = (mean(abs(E) ** n, A) ** (1 / n) for n in (2.0, -2.0))
        return np.exp(mean(np.log(abs(E)), A)), *squares

    def tail(A):
        above = c.c_T * A * (1 - A) * D[-1] ** c.c_e * np.exp(-c.c_eT * e2)
        return above / ((1 + c.c_r * A) ** 2 * (1 + c.c_alpha * np.log(alpha)))

    def bound(A):
        """-ln W_m"""
        N2 = c.c_n * np.log(F / D + 0.25) ** 2
        light = c.c_0 - c.c_D * np.log(D) + c.c_f * np.log(F) - N2 - c.c_e0 * e2
        heavy = c.h_0 - c.h_D * np.log(D) + c.h_F * np.log(F) - N2
        log_W = np.log(A) + (1 - A) ** c.c_A * light + A * (1 - A) * heavy
        return np.logaddexp(0, -c.n / (1 - A) * log_W) * (1 - A) / c.n

    def effective(A):
        here, there = D * np.exp(-bound(A)) * step, c.k * D[-1] * tail(A) * dln * np.ones(count)
        total, B = 0.0, (1 - A) ** c.a
        for weight, one in ((here, E), (there, E_beyond)):
            E_g, E_r, _ = means(one, A)
            total += np.sum(weight * (E_g**B * E_r ** (1 - B)) ** 2)
        return np.sqrt(total / (here.sum() + there.sum()))

    S_0 = (1 - 1 / (c.s_0 + c.s_alpha * np.log(alpha))) * (1 - c.c_eS * e2)

    def excess(log_A):
        A = np.exp(log_A)
        load = np.sqrt(2) * pressure / (effective(A) * np.sqrt(m2))
        return special.erf(load / np.sqrt(S_0 + (1 - S_0) * A**c.s)) - A

    A = np.exp(optimize.brentq(excess, -20, -1e-9, xtol=1e-13))
    E_eff, B = effective(A), (1 - A) ** c.a
    _, E_r, E_h = means(E, A)
    E_W, E_h_beyond = (E_h**B * E_r ** (1 - B))[:, None], means(E_beyond, A)[2]
    Y = 1 / np.expm1(bound(A))[:, None] * (E_eff / E_W) ** (c.c_v * (1 - A) + c.c_w * A)
    Y = Y * (E_W / abs(E)) ** (c.c_phi * (1 - A))
    heat = E_beyond.imag * (E_h_beyond[:, None] / abs(E_beyond)) ** c.c_phi
    tail_factor = tail(A) * q1**4 * C[-1] * (beyond / q1) ** -3 * (E_eff / E_h_beyond) ** c.c_b * dln
    forces = []
    for side in (np.cos(phi), np.sin(phi)):
        inside = np.sum(q**4 * C * step * mean(side * E.imag * Y / (1 + Y), A))
        forces.append(np.pi / pressure * (inside + np.sum(tail_factor * mean(side * heat, A))))
    return A, *forces


@pytest.mark.parametrize(("velocity", "pressure"), [(1e-3, 2e4), (0.1, 3e5), (10.0, 3e3), (0.1, 3e6)])
def test_brute_force(velocity, pressure):
    found = _solve(_scene(), velocity, pressure)
    expected = _extrapolated(_rubber, ROAD, velocity, pressure)
    np.testing.assert_allclose([found.area, found.friction], expected[:2], rtol=5e-6)


@pytest.mark.parametrize(("ratio", "angle"), [(1.5, 0.0), (0.6, 0.7), (1.8, 2.2)])
def test_brute_force_of_grooves(ratio, angle):
    """Area and friction along and across the direction of sliding, and full contact as in the paper."""
    scene = _scene(road=rf.Anisotropic(ROAD, ratio, angle))

    def density(phi):
        across = np.cos(phi - angle) ** 2 * ratio + np.sin(phi - angle) ** 2 / ratio
        return across ** -(1 + float(ROAD.hurst))

    expected = _extrapolated(_rubber, ROAD, 0.1, 2e5, density=density)
    law, paper = (scene.replace({"contact_model": name}) for name in MODELS)
    names = ("area", "friction", "transverse_friction")
    found, full, papers = (
        rf.solve(one, 0.1, pressure, quantities=names)
        for one, pressure in ((law, 2e5), (law, 1e9), (paper, 1e9))
    )
    for name, value in zip(names, expected, strict=True):
        np.testing.assert_allclose(getattr(found, name), value, rtol=5e-6, atol=1e-12)
        np.testing.assert_allclose(getattr(full, name), getattr(papers, name), rtol=1e-7, atol=1e-15)


@pytest.mark.slow
@pytest.mark.parametrize("slab", [rf.Slab(5e-3, "bonded"), rf.Slab(2e-3, "frictionless")])
def test_brute_force_of_a_slab(slab):
    """The stiffness of a slab is a factor of the modulus at every wavevector."""
    x = rf.Scene(rf.Body(RUBBER, layer=slab), rf.Body(rf.Rigid(), ROAD), contact_model="boundary_elements")
    found = _solve(x, 0.1, 3e5)

    def stiffer(q):
        x = np.minimum(slab.thickness * q, 100.0)
        if slab.base == "frictionless":
            return 1 / np.tanh(x) + x / np.sinh(x) ** 2
        return (2 * np.sinh(x) ** 2 + 2 * x**2 + 2) / (np.sinh(2 * x) - 2 * x)

    expected = _extrapolated(_rubber, ROAD, 0.1, 3e5, stiffer=stiffer)
    np.testing.assert_allclose([found.area, found.friction], expected[:2], rtol=5e-6)


def test_thick_slabs_are_half_spaces():
    thick = _scene().replace(lower=rf.Body(RUBBER, layer=rf.Slab(1.0, "bonded")))
    found, expected = (_solve(one, 0.1, 1e5) for one in (thick, _scene()))
    np.testing.assert_allclose([found.area, found.friction], [expected.area, expected.friction], rtol=1e-10)


def _extrapolated(E_of, road, velocity, pressure, count=500, angles=200, **options):
    """Return the brute force with the error of second order removed, from two meshes [Richardson]."""
    coarse, fine = (
        np.array(_brute_force(E_of, road, velocity, pressure, count=n * count, angles=n * angles, **options))
        for n in (1, 2)
    )
    return (4 * fine - coarse) / 3


@pytest.mark.slow
def test_brute_force_of_the_stored_scenes():
    """The 24 stored scenes by brute force with today's constants: five materials, q1/q0 = 8 to 128."""
    stored, errors = json.loads(STORED.read_text()), []
    for case in stored["cases"]:
        road = rf.SelfAffine(case["q0"], case["qr"], case["q1"], case["hurst"], h_rms=1.0)
        road = road.replace(h_rms=1 / float(rf.rms_slope(road)))
        series = rf.Prony(**stored["materials"][case["material"]])
        conditions = case["velocity"], case["pressure"]
        found = _solve(_scene(series, road), *conditions)
        expected = _extrapolated(
            lambda omega, series=series: np.asarray(rf.complex_modulus(series, omega)),
            road,
            *conditions,
            count=1000,
            angles=400,
        )
        errors.append(np.array([found.area, found.friction]) / expected[:2] - 1)
    errors = np.abs(errors)
    print(f"\nmedian {np.median(errors):.1e}, largest {errors.max():.1e}")
    # The largest are 2e-6: the bound of W_m is sharp at A/A0 = 0.74, and the mesh is coarse for q1/q0 = 128.
    assert np.median(errors) < 1e-7 and np.sum(errors.max(1) > 1e-6) <= 2 and errors.max() < 2.5e-6


def test_light_loads_have_one_friction():
    """And areas in proportion to the load."""
    pressure = np.logspace(-6, 1, 8)
    found = _solve(_scene(), 0.1, pressure)
    np.testing.assert_allclose(found.friction, found.friction[0], rtol=1e-4)
    np.testing.assert_allclose(found.area / pressure, found.area[0] / pressure[0], rtol=1e-4)


@pytest.mark.parametrize("layer", [None, rf.Slab(5e-3)])
def test_full_contact_is_the_papers(layer):
    law, paper = (_with(name).replace(lower=rf.Body(RUBBER, layer=layer)) for name in MODELS)
    found, expected = (_solve(scene, 0.1, 1e9) for scene in (law, paper))
    np.testing.assert_allclose(found.area, 1.0, rtol=1e-12)
    np.testing.assert_allclose(found.friction, expected.friction, rtol=1e-7)


def test_separation_is_the_papers():
    law, paper = (float(rf.separation(_with(name), 0.1, 1e5)) for name in MODELS)
    assert law == pytest.approx(paper, rel=1e-9)


def test_contact_shear_acts_on_the_area():
    shear = rf.ContactShear(5e6, 0.1, 1e-2)
    found = rf.solve(_scene(shear=shear), 0.01, 2e5, quantities=("area", "shear_friction"))
    plain = rf.solve(
        _with("paper").replace({"shear": shear}), 0.01, 2e5, quantities=("area", "shear_friction")
    )
    np.testing.assert_allclose(
        found.shear_friction / plain.shear_friction, found.area / plain.area, rtol=1e-12
    )


@pytest.mark.slow
def test_other_solids():
    """A smooth rigid solid on rough rubber is at rest; a table of the modulus and a spring in series."""
    at_rest = rf.Scene(rf.Body(RUBBER, ROAD), rf.Body(rf.Rigid()), contact_model="boundary_elements")
    elastic = _scene(rf.Elastic(1e6, 0.5))
    area = rf.contact_area(at_rest, [1e-3, 10.0], 1e4)
    np.testing.assert_allclose(area, rf.contact_area(elastic, 1.0, 1e4), rtol=1e-10)
    assert float(rf.friction(at_rest, 0.1, 1e4)) == 0
    omega = np.logspace(-6, 8, 400)
    E = np.asarray(rf.complex_modulus(RUBBER, omega))
    table = rf.TabulatedModulus(omega, E.real, E.imag, poisson=0.5)
    tabulated, series = (rf.friction(_scene(one), 0.1, 1e5) for one in (table, RUBBER))
    np.testing.assert_allclose(tabulated, series, rtol=3e-3)
    soft = rf.Scene(rf.Body(RUBBER), rf.Body(rf.Elastic(1e14, 0.3), ROAD), contact_model="boundary_elements")
    np.testing.assert_allclose(rf.friction(soft, 0.1, 1e5), series, rtol=1e-6)


@pytest.mark.slow
def test_profile():
    """The friction of all wavevectors, the area of cut roughness, the density, and W."""
    scene, velocity, pressure = _scene(), np.array([1e-3, 1.0]), np.array([2e5, 2e4])
    near = np.outer([150.0, 399.0, 401.0, 3e3, 9.99e3, 1.01e4, 3e4], [np.exp(-1e-3), 1.0, np.exp(1e-3)])
    q = np.concatenate([ROAD.q1 * np.array([1e-3, 0.1, 0.3, 1.0, 6.0, 9.0]), near.ravel()])
    found = rf.analysis.profile(scene, velocity, pressure, q=q, quadrature=rf.Quadrature())
    cut = scene.replace({"upper.spectrum": ROAD.cut(0.3 * ROAD.q1)})
    at = velocity, pressure
    options = {"quantities": ("area", "friction"), "quadrature": rf.Quadrature()}
    whole, part = (rf.solve(one, *at, **options) for one in (scene, cut))
    np.testing.assert_allclose(found.friction[:, 5], whole.friction, rtol=1e-12)
    np.testing.assert_allclose(found.area[:, 3:6], whole.area[:, None] * np.ones(3), rtol=1e-12)
    np.testing.assert_allclose(found.area[:, 2], part.area, rtol=1e-6)
    np.testing.assert_array_equal(found.area[:, 0], 1.0)
    np.testing.assert_array_equal(found.friction[:, 0], 0.0)
    # The density is the derivative of the friction, on both sides of the kinks at qr and q1.
    density, friction, share = (
        np.asarray(x)[:, 6:].reshape(2, 7, 3) for x in (found.friction_density, found.friction, found.share)
    )
    np.testing.assert_allclose(density[..., 1], (friction[..., 2] - friction[..., 0]) / 2e-3, rtol=1e-5)
    assert np.all((share[:, :5] > 0) & (share[:, :5] < 1 + 1e-12)) and np.all(share[:, 5:] == 0)
    full = rf.analysis.profile(scene, 0.1, 1e9)
    np.testing.assert_allclose(full.share[full.q < ROAD.q1], 1.0, rtol=1e-9)
    np.testing.assert_allclose(full.friction[-1], full.friction[np.argmax(full.q > ROAD.q1)], rtol=1e-9)


def _six_scenes():
    """Six kinds of scenes; the last one is rough elastic on rubber with a temperature shift and shear."""
    q, omega = np.logspace(2, 4, 7), np.logspace(-4, 8, 25)
    E = np.asarray(rf.complex_modulus(RUBBER, omega))
    shifted = rf.Prony(
        1e6, [9e6, 3e6], [1e-3, 1e-1], poisson=0.5, shift=rf.WLF(T_ref=293.0, C1=8.86, C2=101.6)
    )
    rough_elastic = rf.Body(rf.Elastic(1e8, 0.3), ROAD)
    shear = rf.ContactShear(5e6, 0.1, 1e-2)
    return {
        "half-space": (_scene(), None),
        "slab": (_scene().replace(lower=rf.Body(RUBBER, layer=rf.Slab(5e-3, "bonded"))), None),
        "grooves": (_scene(road=rf.Anisotropic(ROAD, 1.7, 0.5)), None),
        "tabulated roughness": (_scene(road=rf.TabulatedSpectrum(q, rf.power_spectrum(ROAD, q))), None),
        "tabulated modulus": (_scene(rf.TabulatedModulus(omega, E.real, E.imag, poisson=0.5)), None),
        "rough elastic": (
            rf.Scene(rf.Body(shifted), rough_elastic, contact_model="boundary_elements", shear=shear),
            np.array([283.0, 303.0]),
        ),
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", list(_six_scenes()))
def test_derivatives(name):
    """Forward mode, differences of fourth order, and the Jacobian of fits, which uses reverse mode, agree."""
    velocity, pressure = jnp.array([1e-3, 0.3]), jnp.array([2e5, 2e4])
    scene, temperature = _six_scenes()[name]
    quantities = ("area", "friction", "shear_friction") if scene.shear else ("area", "friction")
    leaves, structure = jax.tree.flatten(jax.tree.map(jnp.asarray, scene))
    sizes = np.cumsum([leaf.size for leaf in leaves])

    def scene_of(x):
        parts = jnp.split(jnp.exp(x), sizes[:-1])
        scaled = [leaf * part.reshape(leaf.shape) for leaf, part in zip(leaves, parts, strict=True)]
        return jax.tree.unflatten(structure, scaled)

    def logs(x):
        found = rf.solve(scene_of(x), velocity, pressure, temperature, quantities=quantities)
        return jnp.concatenate([jnp.log(getattr(found, quantity)) for quantity in quantities])

    logs_of, x = jax.jit(logs), jnp.zeros(sizes[-1])
    forward, reverse = (np.asarray(jax.jit(transformed(logs))(x)) for transformed in (jax.jacfwd, jax.jacrev))
    h = 2e-5
    at = [logs_of(x + k * h * unit) for unit in np.eye(x.size) for k in (-2, -1, 1, 2)]
    at = np.reshape(at, (x.size, 4, -1))
    differences = (8 * (at[:, 2] - at[:, 1]) - (at[:, 3] - at[:, 0])).T / (12 * h)
    np.testing.assert_allclose(forward, differences, atol=1e-7, rtol=1e-7)
    np.testing.assert_allclose(reverse, forward, rtol=1e-8, atol=1e-11)
    if temperature is None:
        values, jacobian = value_and_jacobian(
            scene_of, x, (velocity, pressure, None), "friction", rf.Quadrature()
        )
        np.testing.assert_allclose(jacobian, forward[2:4] * values[:, None], rtol=1e-8, atol=1e-11)


@pytest.mark.slow
def test_derivative_by_the_modulus():
    def friction(factor):
        scene = _scene()
        return rf.friction(scene.replace("lower.material.E", factor * scene.lower.material.E), 0.3, 2e4)

    factors = jnp.array([1.0, 1 - 1e-4, 1 + 1e-4])
    values, slopes = jax.jit(jax.vmap(jax.value_and_grad(friction)))(factors)
    assert float(slopes[0]) == pytest.approx(float(values[2] - values[1]) / 2e-4, rel=1e-6)
    one = jax.jit(friction)
    np.testing.assert_allclose(values, [one(factor) for factor in factors], rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "body",
    [
        rf.Body(rf.Rigid(), rf.Anisotropic(ROAD, 1.5, 0.5)),
        pytest.param(rf.Body(rf.Rigid(), ROAD), id="slab"),
    ],
)
def test_scenes_made_within_a_trace(body):
    """Checks of the known numbers of grooves or a slab do not meet tracers.

    Scenes with traced numbers have another quadrature.
    """
    layer = None if body.spectrum.harmonic_count() else rf.Slab(5e-3)
    scene = rf.Scene(rf.Body(RUBBER, layer=layer), body, contact_model="boundary_elements")

    @jax.jit
    def areas(factor):
        softer = scene.replace("lower.material.E", factor * scene.lower.material.E)
        same = scene.replace("gamma", 0.5)
        return [rf.contact_area(one, 0.3 * factor, 2e4) for one in (softer, same)]

    np.testing.assert_allclose(areas(1.0), rf.contact_area(scene, 0.3, 2e4), rtol=1e-9)


def test_derivative_by_the_thickness_of_a_slab():
    def friction(thickness):
        slab = rf.Slab(thickness, "bonded")
        return rf.friction(_scene().replace(lower=rf.Body(RUBBER, layer=slab)), 0.1, 3e5)

    both = jax.jit(jax.value_and_grad(friction))
    step = 1e-4 * 5e-3
    difference = (both(5e-3 + step)[0] - both(5e-3 - step)[0]) / (2 * step)
    assert float(both(5e-3)[1]) == pytest.approx(float(difference), rel=1e-6)
    for extreme in (1e-30, 1e-10, 1e30):
        assert np.all(np.isfinite(both(extreme)))


@pytest.mark.parametrize("pressure", [1e-25, 1e3, 1e25])
def test_extreme_loads_are_finite(pressure):
    found = _value_and_slopes(_scene(), 0.1, pressure)
    assert all(np.all(np.isfinite(x)) for x in jax.tree.leaves(found))


@pytest.mark.slow
def test_derivatives_without_a_plateau():
    """With qr = q0 some panels have no width, and nodes lie at q0, where F = 0."""

    @jax.jit
    @jax.jacfwd
    def slopes_of(log_numbers):
        road = rf.SelfAffine(*jnp.exp(log_numbers))
        return jnp.log(rf.friction(_scene(road=road), 0.1, 1e5))

    at, near = (
        slopes_of(jnp.log(jnp.array([ROAD.q0, qr, ROAD.q1, ROAD.hurst, ROAD.h_rms])))
        for qr in (ROAD.q0, 1.000001 * ROAD.q0)
    )
    np.testing.assert_allclose(at, near, atol=1e-5)


@pytest.mark.slow
def test_signs_rest_and_single_precision():
    law = _scene()
    forth, back, at_rest = rf.friction(law, [0.1, -0.1, 0.0], 1e5)
    assert float(forth) == -float(back) > 0 == float(at_rest)
    single = jax.tree.map(lambda x: np.asarray(x, np.float32), law)
    found, slopes = _value_and_slopes(single, np.float32(0.1), np.float32(1e5))
    expected = _value_and_slopes(law, 0.1, 1e5)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, forth, rtol=1e-4)
    # Relative to the friction, for relative changes of each number.
    numbers = zip(*(jax.tree.leaves(x) for x in (slopes, expected[1], (law, 1e5))), strict=True)
    for slope, exact, number in numbers:
        np.testing.assert_allclose(slope * number, exact * number, atol=1e-3 * float(forth))


def test_refusals():
    with pytest.raises(ValueError, match="one rough surface, got two"):
        rf.Scene(rf.Body(RUBBER, ROAD), rf.Body(rf.Rigid(), ROAD), contact_model="boundary_elements")
    elastic = rf.Elastic(1e9, 0.3)
    for layer, lower in ((rf.Coating(1e-3, elastic), rf.Rigid()), (rf.Slab(1e-3), elastic)):
        body = rf.Body(RUBBER, layer=layer)
        with pytest.raises(ValueError, match=r"half-spaces, or Slab and Rigid, but upper\.layer is a"):
            rf.Scene(rf.Body(lower, ROAD), body, contact_model="boundary_elements")
    with pytest.raises(ValueError, match=r"this slab is 6\.2. times as stiff"):
        _scene().replace(lower=rf.Body(RUBBER, layer=rf.Slab(2e-3, "bonded")))
    with pytest.raises(ValueError, match=r"here they are 3\.\d* times as large"):
        _scene(road=rf.Anisotropic(ROAD, 4.0, 0.0))
    with pytest.raises(ValueError, match="same anisotropy at all wavevectors"):
        _scene(road=rf.TabulatedAnisotropic([1e2, 1e4], np.ones((2, 8))))
    with pytest.raises(ValueError, match="not possible together with area_correction"):
        _scene(area_correction=True)
    with pytest.raises(ValueError, match="contact_model"):
        rf.analysis.separation_profile(_scene(), 0.1, 1e5)
    with pytest.raises(ValueError, match="contact_model"):
        _with("finite_elements")


def test_files_keep_the_model(tmp_path):
    rf.save_scene(tmp_path / "scene.h5", _scene())
    assert rf.load_scene(tmp_path / "scene.h5").contact_model == "boundary_elements"
    text = (DATA / "tread_on_asphalt.toml").read_text()
    (tmp_path / "scene.toml").write_text('contact_model = "boundary_elements"\n' + text)
    assert rf.load_scene(tmp_path / "scene.toml").contact_model == "boundary_elements"
