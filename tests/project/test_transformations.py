"""Every class in every transformation: closed over, as an argument, vmapped, differentiated, in float32.

`tests/properties/test_transformations_of_calls.py` and `test_derivatives.py` do this for scenes.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import PROBLEMS, ROAD
from support.cases.stored import slow_if
from support.scenes.examples import EXAMPLES

import rubberfric as rf
from rubberfric.base.objects.physical import PhysicalObject, parts_of
from rubberfric.scene.heating import diffusion, heat_kernel, rise_below_surface, rise_inside
from rubberfric.scene.interface import shear_friction
from rubberfric.scene.scene import cast
from rubberfric.scene.softening import Softened, softening_factors

OMEGA = np.array([3e-4, 0.2, 3.0, 70.0])
T = np.array([281.0, 291.5, 303.0, 318.0])
# Heights so small that adhesion matters.
FINE = rf.SelfAffine(1e4, 3e4, 1e6, 0.8, 2e-7)
# Few nodes, because the transformations of results are tested, not their accuracy.
COARSE = rf.Quadrature(order=8, panels=6, graded=3, ratio=6.0)
PRESSURES = ("Parabolic", "Uniform", "Trapezoid", "MeasuredPressure")
# Shares of the length of a patch, at no kink of the pressure.
SHARES = np.array([0.03, 0.31, 0.66, 0.97])
Q = np.array([250.0, 9e2, 7e3, 2e4])  # within the cut-offs of the examples


def _modulus(material, omega):
    found = rf.complex_modulus(material, omega, None if getattr(material, "shift", None) is None else 303.0)
    return jnp.stack([found.real, found.imag])


def _roughness(spectrum, q):
    return jnp.stack([jnp.log(rf.power_spectrum(spectrum, q)), rf.rms_slope(spectrum, q)])


def _directions(spectrum, q):
    shares = [jnp.ravel(share) for share in spectrum.harmonics_at(q)]
    return jnp.concatenate([*shares, jnp.ravel(_roughness(spectrum, q))])


def _softening(softening, q):
    return jnp.stack(softening_factors(Softened(softening, (ROAD.power_law(),)), q))


def _heating(heating, speed):
    q = jnp.asarray(Q, speed.dtype)
    ready = heat_kernel(heating, diffusion(q, q, (q[0], q[-1]), 40), speed, surface=True)
    power = jnp.ones((len(speed), len(Q)), q.dtype)
    rises = rise_inside(ready, 1e3 * power), rise_below_surface(ready, 1e6 * power[:, 0])
    return jnp.moveaxis(jnp.stack(rises), 1, -1) * heating.shear_share


def _pulled(adhesion, speed):
    """Force on a rough sphere after contact at these loads."""
    scene = rf.Scene(rf.Body(rf.Rigid(), FINE), rf.Body(rf.Elastic(1e7, 0.5)), adhesion=adhesion)
    return rf.analysis.pull_off_force(scene, 1e-2, 1e4 * (1 + speed), quadrature=COARSE)


def _resting(correlation, load):
    return rf.contact_area(_replica(correlation), 0.0, 1e6 * (1 + load))


def _replica(correlation):
    bodies = rf.Body(rf.Elastic(1e7, 0.3), ROAD), rf.Body(rf.Elastic(3e6, 0.5), ROAD.replace(hurst=0.7))
    return rf.Scene(*bodies, correlation=correlation)


def _area(scene, speed):
    return rf.contact_area(scene, speed, 3e5, 303.0)


def _layered(layer, q):
    return layer.E_r_S_bar(0.4, q, jnp.ones_like(q), 0.3 * jnp.ones_like(q))


def _slipping(patch, speed):
    """Side force at slip angles of which most elements stick, some, and few."""
    scene, angle = cast(PROBLEMS["rubber"].scene, speed.dtype), 0.3 * speed / (1 + speed)
    return rf.grip(scene, patch, angle, 1e-2, 3e3, quadrature=rf.Quadrature()).force


# Return results of an object of each class at four arguments.
ANSWERS = {
    **dict.fromkeys(("Elastic", "Prony", "PronyShear", "TabulatedModulus"), (_modulus, OMEGA)),
    **dict.fromkeys(("WLF", "Arrhenius", "TabulatedShift"), (lambda shift, T: shift.log_factor(T), T)),
    **dict.fromkeys(("Entropic", "TabulatedVertical"), (lambda law, T: law.log_factor(T, 293.0), T)),
    **dict.fromkeys(("SelfAffine", "TabulatedSpectrum"), (_roughness, Q)),
    **dict.fromkeys(("Anisotropic", "TabulatedAnisotropic"), (_directions, Q)),
    **dict.fromkeys(("Slab", "Coating"), (_layered, Q)),
    "ContactShear": (lambda shear, v: shear_friction(shear, 0.1, v, 1e5, 303.0), 1e-2 * OMEGA),
    "Softening": (_softening, Q),
    "Heating": (_heating, OMEGA),
    "Adhesion": (_pulled, OMEGA),
    "Correlation": (_resting, OMEGA),
    **dict.fromkeys(PRESSURES, (lambda shape, s: shape.relative(s), SHARES)),
    "Patch": (_slipping, OMEGA),
    "Body": (lambda body, v: _area(rf.Scene(rf.Body(rf.Rigid(), ROAD), body), v), OMEGA),
    "Scene": (_area, OMEGA),
}


CASES = {name: (given, *ANSWERS[name]) for name, given in EXAMPLES.items() if name in ANSWERS}
LONG = ("Body", "Scene", "ContactShear", "Heating", "SelfAffine", "TabulatedAnisotropic", "Adhesion")
LONG += ("Anisotropic", "Coating", "Correlation", "Softening", "TabulatedSpectrum", "TabulatedModulus")
LONG += ("TabulatedShift", "TabulatedVertical", "Patch")
PARAMETERS = slow_if(lambda name: name in LONG, {name: name for name in CASES})


def test_no_class_is_left_out():
    """Every class of scenes that `rubberfric` exports has an example, an answer and a problem."""
    parts = {cls.__name__ for cls in _below(PhysicalObject) if cls.__module__.startswith("rubberfric.")}
    exported = {name for name in parts if hasattr(rf, name)}
    silent = {"Rigid", "ThermalProperties"}  # which answer nothing by themselves
    parts_of_problems = [part for one in PROBLEMS.values() for _, part in parts_of(one.scene)]
    of_problems = {type(part).__name__ for part in parts_of_problems}
    # The pressure of a patch changes no result of `solve`: `a patch` of tests/properties/test_limits.py.
    tables = {
        "_objects() of tests/support/scenes/examples.py": set(EXAMPLES),
        "ANSWERS of this file": set(ANSWERS) | silent,
        "PROBLEMS of tests/problems/scenes.py": of_problems | set(PRESSURES) | {"Patch"},
    }
    for name, table in tables.items():
        assert not exported - table, f"add {exported - table} to {name}"
        assert not table - exported, f"export {table - exported} from rubberfric/__init__.py, see {name}"


def _below(cls):
    return {below for sub in cls.__subclasses__() for below in (sub, *_below(sub))}


def _scaled(given, x, direction):
    """The object, its leaves moved along a direction relative to themselves."""
    leaves, structure = jax.tree.flatten(given)
    moved = [leaf + x * scale * jnp.abs(leaf) for leaf, scale in zip(leaves, direction, strict=True)]
    return jax.tree.unflatten(structure, moved)


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_class_in_every_transformation(name):
    given, function, at = CASES[name]
    given = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), given)
    at = jnp.asarray(at)
    rng = np.random.default_rng(len(name))
    direction = [rng.uniform(-1, 1, leaf.shape) for leaf in jax.tree.leaves(given)]
    weight = rng.uniform(0.5, 1.0, jax.eval_shape(function, given, at).shape)

    compiled = jax.jit(function)
    expected = np.asarray(compiled(given, at))  # as an argument
    scale = np.abs(expected).max(axis=-1, keepdims=True)
    scale[scale == 0] = 1  # nothing is lost in an elastic solid
    assert np.all(np.isfinite(expected))

    def equals(found, wanted=expected, rtol=1e-12):
        np.testing.assert_allclose(found / scale, wanted / scale, rtol=rtol, atol=rtol)

    equals(function(given, at))
    equals(jax.jit(lambda at: function(given, at))(at))  # closed over
    equals(
        jax.jit(jax.vmap(lambda x: function(given, x[None])[..., 0], out_axes=-1))(at)
        if expected.ndim and (expected.shape[-1] == len(at))
        else expected
    )

    if not jax.tree.leaves(given):
        return
    # Many objects at once.
    many = jax.jit(jax.vmap(lambda x: _scaled(given, x, direction)))(np.array([-1e-3, 0.0, 2e-3]))
    many = jax.tree.map(np.asarray, many)
    for i, row in enumerate(np.asarray(jax.jit(jax.vmap(function, (0, None)))(many, at))):
        one = jax.tree.map(lambda leaf, i=i: leaf[i], many)
        equals(row, np.asarray(compiled(one, at)), 1e-11)

    def along(x, given=given):
        return jnp.sum(weight / scale * function(_scaled(given, x, direction), at))

    def total(given):
        return jnp.sum(weight / scale * function(given, at))

    h = 1e-4
    steps = np.array([-2 * h, -h, 0.0, h, 2 * h])
    both = jax.jit(jax.vmap(lambda x: (along(x), jax.jacfwd(along)(x))))(steps)
    values, slopes = map(np.asarray, both)
    slope = slopes[2]
    gradient = jax.jit(jax.grad(total))(given)
    parts = [
        float(np.sum(np.asarray(turn) * np.abs(leaf) * d))
        for d, leaf, turn in zip(jax.tree.leaves(gradient), jax.tree.leaves(given), direction, strict=True)
    ]
    size = sum(map(abs, parts)) + 1e-12
    assert np.isfinite(size)
    assert sum(parts) == pytest.approx(slope, abs=1e-10 * size)
    difference = (8 * (values[3] - values[1]) - (values[4] - values[0])) / (12 * h)
    rounding = 64 * np.finfo(float).eps * np.max(np.abs(values)) / h
    assert float(difference) == pytest.approx(slope, abs=1e-7 * size + rounding)

    # Second derivatives: forward over reverse, reverse twice, and differences of the slope.
    curvature = (8 * (slopes[3] - slopes[1]) - (slopes[4] - slopes[0])) / (12 * h)
    second = float(jax.jit(jax.hessian(along))(0.0))
    largest = abs(second) + size
    assert np.isfinite(second)
    assert float(jax.jit(jax.jacrev(jax.jacrev(along)))(0.0)) == pytest.approx(second, abs=1e-9 * largest)
    assert float(curvature) == pytest.approx(second, abs=1e-6 * largest)

    low = jax.jit(function)(cast(given, "float32"), at.astype("float32"))
    assert low.dtype == jnp.float32
    equals(np.asarray(low, float), rtol=2e-5)
