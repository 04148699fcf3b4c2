"""Angular means of any modulus without a series: against quadrature of it, and closed forms."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.oracles.tables import by_quadrature

import rubberfric as rf
from rubberfric.materials.material import Material
from rubberfric.theory.stiffness.angular_means import PronyStiffness
from rubberfric.theory.stiffness.means_table import means_table
from rubberfric.theory.stiffness.softened_means import SoftenedInSeries
from rubberfric.theory.stiffness.tabulated_means import Tabulated
from rubberfric.theory.structure import RequiredMeans

ALL = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True, mean_sin_loss=True)
TABLE = {
    "omega": [1e-2, 1.0, 30.0, 1e4, 1e6],
    "storage": [3.7e6, 4.8e6, 7.3e6, 3.0e7, 9.0e8],
    "loss": [2.2e5, 5.1e5, 1.5e6, 1.5e7, 4.5e8],
}
SCALE = 1e-8
# Far below, between and far above the entries.
QV = np.array([1e-9, 1e-3, 0.4, 17.0, 2e3, 5e5, 1e8, 1e12])
HARMONICS = np.array([0.3, -0.2, 0.1]), np.array([0.25, 0.1, -0.15])


@pytest.mark.parametrize(
    ("spring", "outside"),
    [
        pytest.param(None, "fall", marks=pytest.mark.slow),
        pytest.param(None, "hold", marks=pytest.mark.slow),
        pytest.param(None, "none", marks=pytest.mark.slow),
        (0.3, "fall"),
    ],
    ids=str,
)
def test_means_of_a_table(spring, outside):
    """Every mean by its own integral, and by the table over ln(q v), at the middle and both ends."""
    spring = None if spring is None else jnp.asarray(spring)
    F = Tabulated(rf.TabulatedModulus(**TABLE, outside=outside), jnp.asarray(SCALE), spring)

    @jax.jit
    def both(F, qv, harmonics):
        table = means_table(F, ALL, False, harmonics)
        tabled = table.means(qv[None], jnp.ones(1), None, ALL, harmonics=harmonics)
        return F.means(qv[None], ALL, harmonics=harmonics), tabled

    found, tabled = both(F, QV, HARMONICS)
    scaled = [
        np.log(TABLE["omega"]),
        *(np.log(SCALE * np.array(TABLE[name])) for name in ("storage", "loss")),
    ]
    exact = by_quadrature(scaled, outside, np.log(QV), spring, HARMONICS)
    # The transverse mean may cancel, so errors are relative to the dissipation; a loss that steps to
    # zero is far less than the largest of all.
    scale = dict(zip(ALL.kinds, np.abs(exact), strict=True))
    scale["mean_sin_loss"] = scale["mean_sin_loss"] + scale["mean_cos_loss"]
    for kind, known in zip(ALL.kinds, exact, strict=True):
        floor = 1e-3 * scale[kind].max() if outside == "none" else 0.0
        for mean in (found, tabled):
            error = np.abs(mean[kind][0][0] - known)
            assert (error <= 1e-9 * (scale[kind] + floor)).all(), (kind, error / scale[kind])


class Maxwell(Material):
    """Two Maxwell elements and a spring that answer by E' and E'' alone."""

    poisson = 0.5
    rest, weight, tau = 1.0, np.array([30.0, 400.0]), np.array([1.0, 1e-3])

    def frequency_range(self):
        return jnp.asarray(1e-7), jnp.asarray(1e10)

    def storage_and_loss(self, log_omega):
        a = jnp.exp(log_omega)[..., None] * self.tau
        storage = self.rest + jnp.sum(self.weight * a * (a / (1 + a * a)), -1)
        return storage, jnp.sum(self.weight * a / (1 + a * a), -1)


@functools.cache
def alike(nodes=()):
    """A solid by its series and by its modulus; a scale at every node if there are nodes."""
    scale = jnp.asarray(nodes) if nodes else jnp.ones(())
    by_series = PronyStiffness(
        scale * Maxwell.rest, scale[..., None] * Maxwell.weight, jnp.asarray(Maxwell.tau)
    )
    if nodes:
        by_series = by_series._replace(tau=jnp.broadcast_to(by_series.tau, by_series.weight.shape))
    return by_series, Tabulated(Maxwell(), scale, None)


def assert_alike(found, known, rtol):
    assert found.keys() == known.keys()
    for kind in known:
        for a, b in zip(found[kind], known[kind], strict=True):
            np.testing.assert_allclose(a, b, rtol=rtol, atol=1e-12 * np.abs(b).max(), err_msg=kind)


@pytest.mark.parametrize("options", [{}, {"split": True}, {"harmonics": HARMONICS}], ids=str)
def test_a_smooth_modulus_has_the_means_of_its_series(options):
    needs = ALL if "harmonics" in options else dataclasses.replace(ALL, mean_sin_loss=False)
    qv = np.logspace(-6, 8, 29)[None] * np.array([[1.0], [-3.0]])
    split, harmonics = options.get("split", False), options.get("harmonics")
    series, modulus = alike()

    @jax.jit
    def three(scale, qv, harmonics):
        options = {"split": split, "harmonics": harmonics}
        scaled = modulus._replace(scale=scale)
        table = means_table(scaled, needs, split, harmonics)
        by_table = table.means(jnp.ones(1), qv, None, needs, **options)
        return series.means(qv, needs, **options), scaled.means(qv, needs, **options), by_table

    known, by_modulus, by_table = three(1.0, qv, harmonics)
    assert_alike(by_modulus, known, 1e-10)
    assert_alike(by_table, known, 1e-9)


@pytest.mark.slow
def test_harmonics_that_vary_and_a_modulus_of_every_node():
    """Shares of harmonics at every node, as roughness has them whose direction turns with q."""
    series, modulus = alike((0.7, 1.0, 2.5))
    qv = jnp.logspace(-2, 4, 4)[:, None] * jnp.array([1.0, 30.0, 1e3])
    shares = tuple(jnp.asarray(np.outer(h, [1.0, -0.5, 0.3])) for h in HARMONICS)
    assert series.by_node and modulus.by_node
    assert_alike(modulus.means(qv, ALL, harmonics=shares), series.means(qv, ALL, harmonics=shares), 1e-10)
    one, alone = alike()
    table = means_table(alone, ALL, False, shares)
    tabled = table.means(jnp.ones(1), qv, None, ALL, harmonics=shares)
    assert_alike(tabled, one.means(qv, ALL, harmonics=shares), 1e-9)


def test_softened_solids_in_series():
    """1 / (1/(f E' + i g E'') + 1/k), f and g of every node: a modulus has the means of its series."""
    needs = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True)
    factors = jnp.array([[1.0, 0.4]]), jnp.array([[1.0, 0.7]]), jnp.array([[50.0, 200.0]])
    qv = jnp.array([[[0.3, 7.0], [200.0, -4e3]]])  # panels, points, order
    by_modulus, by_series = (SoftenedInSeries(solid, *factors) for solid in (Maxwell(), alike()[0]))
    means = jax.jit(lambda qv: [one.means(qv, needs) for one in (by_modulus, by_series)])
    assert_alike(*means(qv), 1e-8)
