"""Strain softening: the angular means and scenes against quadrature and the oracle, limits, extremes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import GROOVES, ROAD, SOFTENING
from support.cases.parts import CASES, expected, reverse, value
from support.cases.stored import arguments, as_arrays
from support.oracles import oracle
from support.oracles.angular import angular_means, prony, with_spring

import rubberfric as rf
from rubberfric.materials.in_series import in_series
from rubberfric.materials.material import Series, series_modulus
from rubberfric.scene.scene import optional_parts
from rubberfric.theory.paper import covers
from rubberfric.theory.stiffness.by_node import at_points
from rubberfric.theory.stiffness.kinds import kinds_of
from rubberfric.theory.stiffness.table import means_table
from rubberfric.theory.structure import RequiredMeans, rough_surfaces_of

# A tabulated modulus is integrated over the angle across its kinks.
TABLES = ("soft-table-modulus", "soft-table-on-elastic")


@pytest.mark.slow
@pytest.mark.parametrize("name", TABLES)
def test_a_tabulated_modulus_converges(name):
    """Its kinks are lines of the (q, angle) plane: the error falls with the square of the nodes."""
    given = CASES[name]
    at, exact = arguments(given), expected(given)[:3]
    setting = rf.Quadrature(order=24, panels=48)
    error = np.abs(np.array(jax.jit(lambda a: rf.solve(*a, quadrature=setting)[:3])(at)) / exact - 1)
    assert error.max() < 1e-8


# Angular means.

MEANS = RequiredMeans(mean_abs2=True, mean_cos_loss=True, mean_storage=True)
F = {
    "four terms": Series(1.0, [0.5, 30.0, 1e3, 2e4], [1e2, 1.0, 1e-3, 1e-8]),
    "equal times": Series(2.0, [1.0, 3.0, 0.0, 5.0], [1.0, 1.0, 1.0, 1.0]),
    "liquid": Series(0.0, [1.0, 1e-6, 1e6, 1.0], [1e-3, 1e3, 1.0, 2.0]),
}


SOLID = rf.Scene(rf.Body(rf.Rigid(), ROAD), rf.Body(rf.Prony(1.0, np.ones(4), np.ones(4), 0.0)))


def split_means(F, qv):
    given = {"E_inf": F.rest, "E": F.weight, "tau": F.tau}
    surface = rough_surfaces_of(SOLID.replace({f"upper.material.{k}": v for k, v in given.items()}))[0]
    found = means_table(surface, jnp.ones(()), MEANS, True).means(jnp.ones(()), qv, None, MEANS, True)
    return jnp.stack([*found["mean_abs2"], *found["mean_cos_loss"], *found["mean_storage"]])


@pytest.mark.parametrize("name", F)
def test_means_of_storage_and_loss_apart(name):
    """<F'^2> and <F''^2> over 20 decades of velocity, relative to their sum."""
    given = Series(*map(np.array, F[name]))
    qv = np.logspace(-10, 10, 21)
    found = jax.jit(split_means)(as_arrays(given), jnp.asarray(qv))
    exact = np.array([angular_means(prony(*given[:3]), x)[:4] for x in qv]).T
    scale = np.stack([exact[0] + exact[1], exact[0] + exact[1], exact[2], exact[3]])
    assert (np.abs(found - exact) <= 1e-12 * scale).all()


@pytest.mark.slow
def test_means_have_the_derivatives_of_the_quadrature():
    """<F'^2> and <F''^2>: forward mode = reverse mode = derivatives of the integrals by complex steps."""
    given, qv = Series(*map(np.array, F["four terms"])), np.array([1e-4, 0.3, 1e3])
    at = as_arrays(given)
    forward, reverse = (
        jax.jit(d(lambda F: split_means(F, jnp.asarray(qv))))(at) for d in (jax.jacfwd, jax.jacrev)
    )
    means = np.array([angular_means(prony(*given[:3]), x)[:4] for x in qv]).T
    for one, other, leaf in zip(*map(jax.tree.leaves, (forward, reverse, at)), strict=True):
        # A glassy term depends on its time only by 1/a^2, so digits are relative to the mean.
        scale = means.reshape(*means.shape, *(1,) * leaf.ndim)
        assert (np.abs(one - other) * leaf <= 1e-14 * scale + 1e-12 * np.abs(one * leaf)).all()
    step = 1e-100
    for field in ("weight", "tau"):
        for i in range(4):
            leaf = np.array(getattr(given, field), complex)
            leaf[i] *= 1 + 1j * step
            moved = given._replace(**{field: leaf})
            exact = np.array([angular_means(prony(*moved[:3]), x)[:4] for x in qv]).T.imag / step
            found = getattr(forward, field)[..., i] * getattr(given, field)[i]
            assert (np.abs(found - exact) <= 1e-13 * means + 1e-11 * np.abs(exact)).all()


def in_series_by_quadrature(storage_factor, loss_factor, spring, rest, weight, tau, qv):
    """<|F|^2>, <cos Im F>, <Re F> of a softened solid in series with a spring, analytic in every number."""

    def modulus(omega):
        storage, loss = prony(rest, weight, tau)(omega)
        return with_spring(storage_factor * storage, loss_factor * loss, spring)

    storage2, loss2, *others = angular_means(modulus, qv)[:4]
    return np.array([storage2 + loss2, *others])


def test_means_in_series_have_the_values_and_derivatives_of_the_quadrature():
    """By every factor, term and q v; forward = reverse = the integrals' own, taken by complex steps."""
    at = (0.7, 0.4, 3.0, 0.5, *np.array([[1.0, 2.0, 5.0, 20.0], [1e2, 1.0, 1e-2, 1e-4]]), 7.0)

    def means(numbers):
        f, g, spring, rest, weight, tau, qv = numbers

        def F(_, omega):
            E = series_modulus(Series(rest, weight, tau), omega)
            return in_series(jax.lax.complex(f * E.real, g * E.imag), spring)

        kinds = kinds_of(MEANS, False, "fall")
        found = at_points(F, jnp.ones((1, 1)), jnp.log(qv)[None], (), kinds, None, None)
        return jnp.stack([found[kind][0][0, 0, 0] for kind in MEANS.kinds])

    numbers = tuple(jnp.asarray(x) for x in at)
    exact_means = in_series_by_quadrature(*at)
    np.testing.assert_allclose(means(numbers), exact_means, rtol=1e-11)
    forward, reverse = (jax.jit(d(means))(numbers) for d in (jax.jacfwd, jax.jacrev))
    step = 1e-100
    for k, (one, other) in enumerate(zip(forward, reverse, strict=True)):
        np.testing.assert_allclose(one, other, rtol=1e-11)
        for i in np.ndindex(np.shape(at[k])):
            moved = [np.array(x, complex) for x in at]
            moved[k][i] += 1j * step
            exact = in_series_by_quadrature(*moved).imag / step
            # A distant term contributes a share of the means, which keep the digits.
            error = np.abs(np.asarray(at[k])[i] * (one[(slice(None), *i)] - exact))
            assert (error <= 1e-11 * exact_means).all()


# Scenes whose answer is known otherwise.

PLAIN = CASES["soft-plain"]


def solved(changes=(), **softening):
    """The four quantities of the plain scene with some numbers changed, in the one compiled structure."""
    given = PLAIN | dict(changes)
    return np.asarray(value(arguments(given | {"softening": PLAIN["softening"] | softening})))


def unsoftened_of(given):
    return np.asarray(value(arguments(given | {"softening": None})))


def test_ends_of_the_table_and_units():
    for factor, entry in ((1e-6, 0), (1e-200, 0), (1e6, -1), (1e200, -1)):
        held = {name: [PLAIN["softening"][name][entry]] * 20 for name in ("storage", "loss")}
        # On another mesh; and at 1e6 the strain passes the table within 1e-12 of the first wavevector.
        np.testing.assert_allclose(solved(factor=factor), solved(**held), rtol=1e-11)
    # Lower moduli make more contact and less separation.
    soft, stiff = solved(), unsoftened_of(PLAIN)
    assert soft[0] > stiff[0] and soft[2] < stiff[2]
    solid = PLAIN["solid1"]
    for unit in (1e-30, 1e30):
        scaled = solid | {"E_inf": solid["E_inf"] * unit, "E": [E * unit for E in solid["E"]]}
        found = solved({"solid1": scaled, "pressure": PLAIN["pressure"] * unit})
        np.testing.assert_allclose(found, solved(), rtol=1e-12)
    # Glass at all scales: no loss, and the storage of a spring of the sum.
    fast = solved({"v": 1e18})
    stiff = solid | {"E_inf": solid["E_inf"] + sum(solid["E"]), "E": [0.0] * 4}
    np.testing.assert_allclose(fast[[0, 2]], solved({"solid1": stiff})[[0, 2]], rtol=1e-9)
    assert 0 < fast[1] < 1e-9


EXTREMES = {
    "liquid": {"solid1": PLAIN["solid1"] | {"E_inf": 0.0}},
    "liquid at rest": {"solid1": PLAIN["solid1"] | {"E_inf": 0.0}, "v": 0.0, "pressure": 2e5},
    "one term": {"solid1": PLAIN["solid1"] | {"E": [0.0, 1e8, 0.0, 0.0]}},
    "equal times": {"solid1": PLAIN["solid1"] | {"tau": [1e-6] * 4}},
    "fast": {"v": 1e12, "pressure": 2e7},
    "light": {"pressure": 1e-2},
    "heavy": {"pressure": 1e12},
    "strain meets the last entry at the last wavevector": {
        "softening": PLAIN["softening"] | {"strain": np.geomspace(1e-8, 0.9, 20).tolist()}
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes(name):
    given = PLAIN | EXTREMES[name]
    found = np.asarray(value(arguments(given)))
    exact = expected(oracle.solve(given, halvings=60, order=12))
    floor = 1e-6 * given["psd2"]["h_rms"]  # of a separation
    np.testing.assert_allclose(found[[0, 1]], exact[[0, 1]], rtol=1e-9, atol=1e-300)
    np.testing.assert_allclose(found[2], exact[2], rtol=1e-9, atol=1e-9 * floor)


@pytest.mark.slow
def test_gradients_of_extremes_are_finite():
    changes = [*EXTREMES.values(), {"v": 0.0}, {"v": 1e-30}]
    changes += [{"softening": PLAIN["softening"] | {"factor": factor}} for factor in (1e-6, 1e6, 1e-200)]
    for change in changes:
        slopes = reverse(arguments(PLAIN | change))
        bad = [x for x in jax.tree.leaves(slopes) if not np.isfinite(x).all()]
        assert not bad, change


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 40])
def test_numbers_of_terms(count):
    tau = np.geomspace(1e-12, 1e2, count).tolist() if count > 1 else [1e-6]
    solid = PLAIN["solid1"] | {"E": [3e8 / count] * count, "tau": tau}
    given = PLAIN | {"solid1": solid}
    exact = expected(oracle.solve(given, halvings=40, order=10))
    np.testing.assert_allclose(value(arguments(given)), exact, rtol=1e-10)


@pytest.mark.slow
def test_elastic_solids_do_not_soften():
    stiff = {"kind": "elastic", "E": 2e7, "nu": 0.4}
    given = PLAIN | {"solid1": stiff}
    np.testing.assert_allclose(value(arguments(given)), unsoftened_of(given), rtol=1e-13)


# Tables of the bodies' own.

BOTH = CASES["soft-two-rubbers"]


@pytest.mark.slow
@pytest.mark.parametrize("softens", ["both", "solid1", "solid2", "solid1 and the scene"])
def test_tables_of_each_body_by_the_oracle(softens):
    tables = {
        "solid1": BOTH["softening"],
        "solid2": BOTH["softening"] | {"storage": [0.9] * 10 + [0.5] * 10, "factor": 0.7},
    }
    own = {name: BOTH[name] | {"softening": tables[name]} for name in tables if softens in (name, "both")}
    if softens == "solid1 and the scene":
        own = {"solid1": BOTH["solid1"] | {"softening": tables["solid1"]}, "softening": tables["solid2"]}
    given = BOTH | {"softening": None} | own
    found, exact = value(arguments(given)), oracle.solve(given)
    np.testing.assert_allclose(found[:3], list(exact.values()), rtol=1e-9)


RUBBER = rf.Prony(1e6, [1e8], [1e-6])
DIRECTIONS = rf.TabulatedAnisotropic([1e2, 1e4], np.full((2, 5), 1e-12))


def test_a_table_of_one_body_counts_wherever_that_of_a_scene_does():
    """In other methods and in refusals."""
    softened, road = rf.Body(RUBBER, softening=SOFTENING), rf.Body(rf.Rigid(), ROAD)
    for one in (rf.Scene(rf.Body(RUBBER), road, softening=SOFTENING), rf.Scene(softened, road)):
        assert optional_parts(one) == {"softening"}
        assert not covers(one) and rf.analysis.theory_error(one, np.array([0.1])) is None
        with pytest.raises(
            ValueError, match=r"^boundary_element: the scene has softening; it must have none$"
        ):
            rf.analysis.boundary_element(one, 1e-2, 1e5, jax.random.key(0))
    with pytest.raises(ValueError, match=r"^Scene\.correlation: not together with softening; one of"):
        rf.Scene(softened.replace(spectrum=ROAD), rf.Body(RUBBER, ROAD), correlation=rf.Correlation(0.5))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rf.Softening([1.0, 0.5], [1, 1], [1, 1]), r"Softening\.strain\[1\] = 0\.5 after 1\.0"),
        (lambda: rf.Softening([0.1, 1.0], [1, -1], [1, 1]), r"Softening\.storage\[1\] = -1.*: must be > 0"),
        (lambda: rf.Softening([0.1, 1.0], [1, 1], [1]), r"lengths differ .*loss has 1"),
        (lambda: rf.Softening([0.1], [1], [1]), r"Softening\.strain has 1 entries: must have at least 2"),
        (
            lambda: rf.Scene(rf.Body(RUBBER, DIRECTIONS), rf.Body(rf.Rigid(), ROAD), softening=SOFTENING),
            r"Scene\.softening: not together with anisotropic roughness",
        ),
        (
            lambda: rf.Scene(
                rf.Body(RUBBER, None, rf.Coating(1e-3, RUBBER)),
                rf.Body(rf.Rigid(), ROAD),
                softening=SOFTENING,
            ),
            r"Scene\.softening: not together with a Coating",
        ),
        (
            lambda: rf.Scene(rf.Body(RUBBER, softening=SOFTENING), rf.Body(rf.Rigid(), GROOVES)),
            r"Scene\.softening: not together with anisotropic roughness",
        ),
        (
            lambda: rf.Body(rf.Elastic(1e7, 0.5), softening=SOFTENING),
            r"Body\.softening: only viscoelastic solids soften; must be None",
        ),
        (
            lambda: rf.Scene(rf.Body(RUBBER), rf.Body(rf.Rigid(), ROAD), softening=0.5),
            r"Scene\.softening = 0\.5: must be Softening or None",
        ),
    ],
)
def test_refused(make, message):
    with pytest.raises(ValueError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)
