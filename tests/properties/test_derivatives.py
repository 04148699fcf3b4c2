"""Derivatives: forward mode is reverse mode, and both are differences of the values.

With respect to every number of a scene and its conditions, relative to the number. The derivatives of
`tests/reference` are differences of brute force.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from problems import POINTS, PROBLEMS, compiled, distinct, each, having, stored
from support.cases.stored import elements, names_of

import rubberfric as rf
from rubberfric.base import fixed_points
from rubberfric.base.objects.physical import parts_of

STEP = 5e-4
# Fourth-order central differences.
WEIGHTS = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}
# The iteration of temperatures goes further than usual, because differences enlarge its errors. It is another
# setting, so that it compiles again.
FURTHER = rf.Quadrature(heat=178)


def smooth(problem):
    """The problem with compressible solids: Poisson's ratio 1/2 is the end of its range."""
    parts = [(path, part) for path, part in parts_of(problem.scene) if getattr(part, "poisson", None) == 0.5]
    return problem._replace(scene=problem.scene.replace({f"{path}.poisson": 0.49 for path, _ in parts}))


def values(arguments, names):
    solution = rf.solve(*arguments, quantities=names)
    return jnp.stack([getattr(solution, name) for name in names])


@functools.partial(jax.jit, static_argnames="names")
def both_modes(arguments, direction, names):
    """Jacobian by reverse mode, and its product with a direction by forward mode."""

    def of(arguments):
        return values(arguments, names)

    return jax.jacrev(of)(arguments), jax.jvp(of, (arguments,), (direction,))[1]


def differences(problem, unit, quadrature=None):
    """Differences of the values by every number, (number, quantity)."""
    numbers, rebuilt = ravel_pytree(problem.arguments)

    def at(moved):
        scene, *conditions = rebuilt(moved)
        arguments = scene, *(jnp.full(POINTS, x) for x in conditions)
        results = compiled(arguments, rf.quantities_of(problem.scene), quadrature)
        return np.array([results[name][0] for name in problem.names])

    rows = STEP * np.diag(unit)
    return np.array([sum(w / STEP * at(numbers + k * row) for k, w in WEIGHTS.items()) for row in rows])


def tolerance(problem):
    """Relative error of the differences."""
    adhesion = problem.scene.adhesion
    # Kinks of a table pass nodes. Nodes of long-range adhesion follow the load.
    rough = "tabulated" in problem.tags or (adhesion is not None and adhesion.limit == "long")
    return 1e-4 if rough else 1e-6


@each(PROBLEMS.values(), ("rubber",))
def test_both_modes_and_differences_agree(problem, monkeypatch):
    problem = smooth(problem)
    arguments = problem.arguments
    numbers = np.asarray(ravel_pytree(arguments)[0])
    # At rest a velocity that moves nothing far; correlated solids must stay at rest.
    unit = np.where(numbers == 0, 0.0 if problem.scene.correlation else 1e-5, np.abs(numbers))
    rng = np.random.default_rng(0)
    direction = unit * rng.uniform(-1.5, 1.5, unit.size)
    along = ravel_pytree(arguments)[1](direction)
    reverse, forward = both_modes(arguments, along, problem.names)
    reverse = elements(reverse)
    assert np.isfinite(reverse).all()
    size = np.abs(reverse * direction[:, None]).sum(0) + 1e-300
    assert (np.abs(reverse.T @ direction - forward) <= 1e-9 * size).all(), (reverse.T @ direction, forward)
    quadrature = None
    if problem.scene.heating is not None:
        monkeypatch.setattr(fixed_points, "_TOLERANCE", 1e-12)
        quadrature = FURTHER
    expected = differences(problem, unit, quadrature)
    scale = np.abs(expected) + 1e-2 * np.abs(expected).max(0) + 1e-300
    error = np.abs(reverse * unit[:, None] - expected) / scale
    worst = np.unravel_index(np.argmax(error), error.shape)
    assert error.max() <= tolerance(problem), (
        names_of(arguments)[worst[0]],
        problem.names[worst[1]],
        error.max(),
    )


STORED = [
    problem._replace(name=f"{file}-{problem.name}")
    for file in ("derivative", "part")
    for problem in stored(f"{file}_cases")
    if "derivatives" in problem.case
]


# Here 4e-8 is left of the steps of brute force. Differences of the library's values, extrapolated to a step
# of 0, agree with its derivatives to 1e-9.
LONG_STEPS = {"derivative-two-slabs": "solid1.nu", "derivative-wlf-hot": "solid1.shift.C1"}


@each(STORED, ("derivative-rigid-on-rubber",))
def test_differences_of_brute_force(problem):
    arguments = problem.arguments
    jacobian = elements(both_modes(arguments, arguments, problem.names)[0])
    numbers, leaves = np.asarray(ravel_pytree(arguments)[0]), names_of(arguments)

    def exact_of(case):
        return np.array(
            [case["transverse" if name == "transverse_friction" else name] for name in problem.names]
        )

    level = np.abs(exact_of(problem.case))
    # Over the velocity a table's kinks run through the panels: with 48 panels and angle=1200 3e-6 is left.
    rtol = 1e-4 if "tabulated" in problem.tags else 1e-8
    for leaf, case in problem.case["derivatives"].items():
        i, exact = leaves.index(leaf), exact_of(case)
        slope = jacobian[i] * (1.0 if leaf.endswith("angle") else numbers[i])
        error = np.abs(slope - exact) / np.maximum(level + np.abs(exact), np.finfo(float).tiny)
        bound = 5e-8 if LONG_STEPS.get(problem.name) == leaf else rtol
        assert (error <= bound).all(), (leaf, slope, exact)


@each(distinct(having(without=("correlation",))), ("rubber", "liquid"))
def test_derivative_at_rest(problem):
    """Friction is odd in v, so that its derivative at v = 0 is friction / v at small v; all else is even.

    All other derivatives are finite.
    """
    problem = problem._replace(velocity=0.0)
    arguments = problem.arguments
    still = jax.tree.map(jnp.zeros_like, arguments)
    along_velocity = still[0], jnp.ones_like(arguments[1]), *still[2:]
    reverse, forward = both_modes(arguments, along_velocity, problem.names)
    assert np.isfinite(elements(reverse)).all()
    slopes = {name: (forward[i], reverse[1][i]) for i, name in enumerate(problem.names)}
    at = problem.solved(velocity=np.array([0.0, 1e-10, 1e-30]))
    for quantity, both in slopes.items():
        rest, slow, slower = at[quantity]
        for derivative in both:
            if not quantity.endswith("friction"):
                assert abs(derivative) < 1e-9 * max(1.0, rest), quantity
                continue
            assert rest == 0.0
            if quantity == "viscoelastic_friction" or problem.scene.shear is None:
                np.testing.assert_allclose(
                    [slow / 1e-10, slower / 1e-30], derivative, rtol=1e-6, err_msg=quantity
                )
            else:  # all derivatives of the bell are 0 at rest
                assert quantity == "friction" or derivative == 0.0
