"""Radial meshes: panels that cover the roughness, weights of power laws, borders, interpolation."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD
from support.cases.stored import as_arrays, slow_if

import rubberfric as rf
from rubberfric.base.quadrature import gauss
from rubberfric.roughness.mesh.nodes import build_mesh
from rubberfric.roughness.moments import cumulative_moment

WORN = rf.SelfAffine(2e3, 5e3, 1e6, 0.6, 1e-6)
TABLE = rf.TabulatedSpectrum([150.0, 400.0, 700.0, 5e3, 2e5], [3e-11, 1e-11, 2e-12, 1e-15, 1e-20])
SPECTRA = {
    "self-affine": (ROAD,),
    "no plateau": (rf.SelfAffine(100.0, 100.0, 3.1e4, 0.8, 5e-4),),
    "plateau alone": (rf.SelfAffine(100.0, 1e4, 1e4, 0.8, 5e-4),),
    "ten decades": (rf.SelfAffine(1.0, 1e3, 1e10, 0.9, 1e-3),),
    "narrow": (rf.SelfAffine(1e3, 1.0005e3, 1.001e3, 0.5, 1e-6),),
    "table": (TABLE,),
    "two": (ROAD, WORN),
    "apart": (ROAD, rf.SelfAffine(1e6, 1e6, 1e7, 0.8, 1e-8)),
    "same ends": (ROAD, rf.SelfAffine(100.0, 2e3, 3.1e4, 0.7, 1e-5)),
}
each = pytest.mark.parametrize("spectra", SPECTRA.values(), ids=list(SPECTRA))


def laws(spectra):
    return [spectrum.power_law() for spectrum in spectra]


known_laws = functools.cache(jax.jit(laws))


@functools.partial(jax.jit, static_argnames=("graded", "logarithmic"))
def built(spectra, borders=None, **options):
    return build_mesh(laws(spectra), rf.Quadrature(), borders=borders, **options)


@functools.cache
def mesh_of(spectra, **options):
    return built(as_arrays(spectra), **options)


def moment(law, order, q=None):
    r"""int q^(4 + order) C d ln q, up to q or of all."""
    distance = jnp.inf if q is None else jnp.log1p((q - law.q[0]) / law.q[0])
    return cumulative_moment(law, 2 + order, distance) / (2 * np.pi)


@each
def test_panels_cover_the_roughness_in_order(spectra):
    mesh, ends = mesh_of(spectra), np.array([[law.q[0], law.q[-1]] for law in known_laws(spectra)])
    first, last = ends[:, 0].min(), ends[:, 1].max()
    q = np.asarray(mesh.q).ravel()
    assert (np.diff(q) >= -1e-13 * q[:-1]).all()
    assert first * (1 - 1e-14) <= q[0] < first * (1 + 1e-9)
    assert (last - q[-1]) < 0.1 * (last - first) and q[-1] <= last * (1 + 1e-14)
    assert float(mesh.last) == pytest.approx(last, rel=1e-13)
    # Widths of the panels, from their outermost nodes in Gauss' places, leave no gap: the length of all.
    angular = np.log(np.asarray(mesh.angular_q))
    node = gauss(rf.Quadrature().angular_order)[0]
    width = (angular[:, -1] - angular[:, 0]) / (node[-1] - node[0])
    left = angular[:, 0] - width * node[0]
    np.testing.assert_allclose(left[1:], (left + width)[:-1], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose([left[0], (left + width)[-1]], np.log([first, last]), rtol=1e-12, atol=1e-13)


@jax.jit
def integrals(spectra, mesh):
    """By the weights and exact, of every surface and order."""
    return [
        ([jnp.sum(weights * mesh.q**order) for order in ORDERS], [moment(law, order) for order in ORDERS])
        for law, weights in zip(laws(spectra), mesh.roughness, strict=True)
    ]


ORDERS = -4.0, -2.0, 0.0, 1.5


@each
def test_weights_integrate_power_laws(spectra):
    """The weights contain q^4 C, exact in every piece, so the integrand is a power of q."""
    for found, exact in integrals(as_arrays(spectra), mesh_of(spectra)):
        np.testing.assert_allclose(found, exact, rtol=1e-9)


@each
def test_no_panel_has_a_kink_inside(spectra):
    q = np.asarray(mesh_of(spectra).q)
    for law in known_laws(spectra):
        for kink in np.asarray(law.q):
            inside = (q < kink * (1 - 1e-12)).any(1) & (q > kink * (1 + 1e-12)).any(1)
            assert not inside.any()


def test_roughness_is_zero_outside_its_own_ends():
    mesh = jax.tree.map(np.asarray, mesh_of((ROAD, WORN)))
    for law, weights in zip(known_laws((ROAD, WORN)), mesh.roughness, strict=True):
        low, high = np.asarray(law.q)[[0, -1]]
        outside = (mesh.q < low * (1 - 1e-12)) | (mesh.q > high * (1 + 1e-12))
        assert outside.any() and not weights[outside].any()


def test_integrals_up_to_borders_are_sums_of_panels():
    """Borders just behind the beginning, at, between and beyond kinks; one outside is the nearer end."""
    borders = jnp.array([100 * (1 + 1e-11), 100 * (1 + 1e-6), 250.0, 1e3, 1.7e4, 10.0, 1e6])
    mesh = built(as_arrays((ROAD,)), borders)
    before = np.concatenate([[0.0], np.cumsum(np.sum(mesh.roughness[0], 1))])
    found = before[np.asarray(mesh.panels_below)]

    @jax.jit
    def exact_integrals(road, q):
        law = road.power_law()
        return moment(law, 0.0, jnp.clip(q, law.q[0], law.q[-1]))

    exact = exact_integrals(ROAD, borders)
    np.testing.assert_allclose(found, exact, rtol=1e-10)


@jax.jit
def interpolated(mesh):
    """Return wavevectors, a polynomial in ln q interpolated there, and its values: twice."""
    low, high = jnp.log(mesh.angular_q.min()), jnp.log(mesh.angular_q.max())
    degree = mesh.angular_q.shape[1] - 1

    def values(q):
        return jnp.cos(degree * jnp.arccos(jnp.clip(2 * (jnp.log(q) - low) / (high - low) - 1, -1, 1)))

    same = mesh.to_contact(values(mesh.angular_q)[:, None])[:, 0]
    q, basis = mesh.between.q, mesh.between.interpolate
    other = jnp.einsum("ki,kci->kc", mesh.serving(values(mesh.angular_q)), basis)
    return [(mesh.q, same, values(mesh.q)), (q, other, values(q))]


@pytest.mark.parametrize("spectra", slow_if(lambda name: name in ("two", "table"), SPECTRA))
def test_interpolation_is_exact_for_polynomials(spectra):
    """A polynomial in ln q of the degree of an angular panel, over the same and over other panels."""
    mesh = mesh_of(spectra, logarithmic=True)
    low, high = np.min(mesh.angular_q), np.max(mesh.angular_q)
    for q, found, exact in jax.tree.map(np.asarray, interpolated(mesh)):
        within = (q >= low) & (q <= high)
        assert within.any()
        np.testing.assert_allclose(found[within], exact[within], atol=3e-10)


@pytest.mark.parametrize("name", ["self-affine", "plateau alone", "two"])
def test_panels_shrink_towards_every_beginning(name):
    """P falls within ln(q/q0) ~ 1e-18 of it at light loads: the first panel ends at 4.5^-16 of the first."""
    mesh = mesh_of(SPECTRA[name])
    for law in known_laws(SPECTRA[name]):
        start = float(law.q[0])
        distance = np.log1p((np.asarray(mesh.q) - start) / start)
        first = distance[distance > 1e-15].min()
        assert first < 1e-10
    plain = mesh_of(SPECTRA[name], graded=False)
    assert plain.between is None and plain.q.shape[0] < mesh.q.shape[0]


@pytest.mark.parametrize("name", ["self-affine", "table"])
def test_derivatives_move_with_the_borders(name):
    """Derivatives of an integral by every number of the spectrum: the nodes move with its kinks."""
    (spectrum,) = SPECTRA[name]

    def integral(spectrum):
        mesh = build_mesh([spectrum.power_law()], rf.Quadrature())
        return jnp.sum(mesh.roughness[0] * mesh.q**-1.5)

    def known(spectrum):
        return moment(spectrum.power_law(), -1.5)

    found = jax.jit(jax.grad(integral))(spectrum)
    value, exact = jax.jit(jax.value_and_grad(known))(spectrum)
    for a, b, x in zip(
        *map(jax.tree.leaves, jax.tree.map(np.asarray, (found, exact, spectrum))), strict=True
    ):
        np.testing.assert_allclose(a * x, b * x, rtol=1e-8, atol=1e-9 * float(value))
