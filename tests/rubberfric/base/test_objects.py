"""Every physical object survives JAX's transformations and refuses wrong values."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.scenes.examples import EXAMPLES, examples, same

import rubberfric as rf
from rubberfric.base.objects.fields import Child, Static
from rubberfric.base.objects.physical import fields_of, leaves_of

WITH_LEAVES = [name for name, example in EXAMPLES.items() if jax.tree.leaves(example)]


def every(names=tuple(EXAMPLES)):
    return pytest.mark.parametrize("obj", [EXAMPLES[name] for name in names], ids=names)


def fields(obj):
    return {field.name: getattr(obj, field.name) for field in dataclasses.fields(obj)}


def total(obj):
    return sum((jnp.sum(leaf) for leaf in jax.tree.leaves(obj)), jnp.array(0.0))


def test_examples_hold_every_class():
    public = {name for name in rf.__all__ if dataclasses.is_dataclass(getattr(rf, name))}
    assert public - {"Quadrature"} == set(EXAMPLES)


@every()
def test_flattening_keeps_everything(obj):
    leaves, structure = jax.tree.flatten(obj)
    again = jax.tree.unflatten(structure, leaves)
    assert type(again) is type(obj)
    same(obj, again)
    for name, value in fields(obj).items():
        if isinstance(value, str | bool):
            assert getattr(again, name) == value
    assert hash(structure) == hash(jax.tree.structure(again))


@every(WITH_LEAVES)
def test_key_paths_are_field_names(obj):
    for path, leaf in jax.tree_util.tree_leaves_with_path(obj):
        found = obj
        for key in path:
            found = getattr(found, key.name)
        assert found is leaf or (isinstance(found, float) and leaf.weak_type and found == leaf)


@every(WITH_LEAVES)
def test_gradients_are_not_checked(obj):
    """A gradient is an object too, with values that no constructor would take."""
    for derivative in (jax.grad, jax.jacfwd):
        gradient = jax.jit(derivative(lambda x: -total(x)))(obj)
        assert type(gradient) is type(obj)
        assert all(np.all(np.asarray(leaf) == -1) for leaf in jax.tree.leaves(gradient))


@pytest.mark.parametrize("name", EXAMPLES)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_dtype_is_kept(name, dtype):
    obj = examples(lambda x: jnp.asarray(x, dtype), lambda x: np.array(x, dtype))[name]
    for x in (obj, jax.jit(lambda x: x)(obj)):
        assert all(leaf.dtype == dtype for leaf in jax.tree.leaves(x))


def test_python_numbers_yield_to_arrays():
    """A default of 0.5 must not turn a float32 scene into float64."""
    single = np.array([1.0], np.float32)
    prony = rf.Prony(1e6, single, single)
    assert jnp.result_type(*jax.tree.leaves(prony)) == np.float32
    assert rf.Elastic(1, 0).young == 1.0
    assert isinstance(rf.Elastic(1, 0).young, float)
    assert rf.Prony(1, [1, 2], [1, 2]).E.dtype == np.float64


@every(WITH_LEAVES)
def test_fields_cannot_be_assigned(obj):
    name = dataclasses.fields(obj)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(obj, name, 1.0)


def test_static_fields_are_structure():
    bonded, sliding = rf.Slab(1e-3), rf.Slab(1e-3, "frictionless")
    assert jax.tree.structure(bonded) != jax.tree.structure(sliding)
    assert jax.jit(lambda x: x.base == "bonded")(bonded)
    assert not jax.jit(lambda x: x.base == "bonded")(sliding)


def test_constructors_work_on_traced_values():
    """Values are unknown while tracing, and not checked; structure is."""

    def energy(E, h):
        scene = rf.Scene(
            rf.Body(rf.Rigid(), rf.SelfAffine.from_C0(1e2, 1e3, 1e5, 0.8, h)),
            rf.Body(rf.Prony(-E[0], E, E, shift=rf.TabulatedShift(E, E, E[0])), None, rf.Slab(h)),
            gamma=h,
        )
        return total(scene)

    E, h = jnp.array([1.0, 2.0]), jnp.array(0.5)
    assert np.isfinite(jax.jit(energy)(E, h))
    assert np.all(np.isfinite(jax.grad(energy)(E, h)))
    with pytest.raises(ValueError, match="lengths differ"):
        jax.jit(lambda E: rf.Prony(1.0, E, E[:1]))(E)


def wrong_matrices(good):
    for bad in (np.nan, np.inf, -1.0, 0.0):
        wrong = np.array(good)
        wrong[1, 2] = bad
        yield wrong
    yield from (1.0, np.asarray(good)[0], np.asarray(good)[None], np.asarray(good)[:2])
    yield from (np.asarray(good)[:, :3], "nonsense", None, True, [[1.0], [1.0, 2.0]], 1j * good, [], {})


def wrong_vectors(good, field):
    """Values that a vector must refuse."""
    for bad in (np.nan, np.inf, -np.inf):
        yield [float(good[0]), bad, float(good[2])]
    yield from (1.0, np.ones((3, 1)), [[1.0], [1.0, 2.0]], "nonsense", ["a", "b", "c"], [1.0, None, 2.0])
    yield from (None, True, [True, True, True], 1j * np.ones(3), [], {})
    if not field.rule[1](-1.0):
        yield [float(good[0]), -1.0, float(good[2])]


def wrong_values(obj, name):
    """Values that the field must refuse."""
    field, good = fields_of(type(obj))[name], getattr(obj, name)
    if isinstance(field, Static):
        numbers = (1, 1.5) if field.choices else (True, -1.0, np.nan, 1e3)
        yield from ("nonsense", None, [], np.ones(2), *numbers)
    elif isinstance(field, Child):
        yield from ("nonsense", 1.0, True, rf.Rigid, type(obj), obj, [], {}, np.ones(2))
        if not field.optional:
            yield None
    elif field.ndim == 2:
        yield from (*wrong_matrices(good), obj)
    elif field.ndim == 0:
        if not field.optional:
            yield None
        yield from (np.nan, np.inf, -np.inf, jnp.nan * jnp.ones(()), np.float32("nan"))
        yield from ([1.0], np.ones(2), jnp.ones((1, 1)), "1.0", b"1", True, np.True_, 1j, {}, obj)
        if not field.rule[1](-1.0):
            yield from (-1, -1.0, -1e-300, np.array(-1.0), jnp.array(-1.0))
    else:
        yield from (*wrong_vectors(good, field), obj)
        if sum(field.ndim == 1 for field in leaves_of(type(obj)).values()) > 1:  # of other lengths
            yield from (np.asarray(good)[:2], np.append(good, 2 * good[-1]))


BAD = [(name, field) for name in EXAMPLES for field in fields_of(type(EXAMPLES[name]))]


@pytest.mark.parametrize(("name", "field"), BAD, ids=[".".join(bad) for bad in BAD])
def test_every_field_refuses_wrong_values(name, field):
    obj = EXAMPLES[name]
    count = 0
    for value in wrong_values(obj, field):
        count += 1
        with pytest.raises(ValueError, match=r"^\w") as caught:
            type(obj)(**(fields(obj) | {field: value}))
        line = str(caught.value)
        assert line.startswith(name), line
        assert field in line, line
        assert "\n" not in line, line
        assert any(word in line for word in ("must be", "must have", "must increase")), line
    assert count >= 6


def test_message_says_element_value_and_rule():
    with pytest.raises(ValueError, match=r"^Prony\.E\[1\] = -1\.0: must be >= 0$"):
        rf.Prony(1e6, [1.0, -1.0], [1.0, 2.0])
    with pytest.raises(ValueError, match=r"^Elastic\.poisson = 0\.51: must be between 0\.0 and 0\.5$"):
        rf.Elastic(1e6, 0.51)


def tread(**changes):
    return rf.Prony(**({"E_inf": 1e6, "E": [1e6], "tau": [1.0]} | changes))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: rf.SelfAffine(1e2, 1e3, 9e2, 0.8, 1e-4), r"SelfAffine\.q1 = 900.0: must be >= qr = 1000.0"),
        (lambda: rf.SelfAffine(1e2, 99.0, 1e5, 0.8, 1e-4), r"SelfAffine\.qr = 99.0: must be >= q0 = 100.0"),
        (lambda: rf.SelfAffine(1e2, 1e2, 1e2, 0.8, 1e-4), r"SelfAffine\.q1 = 100.0: must be > q0 = 100.0"),
        (lambda: rf.SelfAffine(1e2, 1e3, 1e5, 1.01, 1e-4), r"SelfAffine\.hurst = 1\.01: must be between"),
        (lambda: rf.SelfAffine.from_C0(1e2, 1e3, 1e5, 0.8, -1.0), r"SelfAffine\.C0 = -1\.0: must be >= 0"),
        (lambda: rf.SelfAffine.from_C0(1e2, 1e3, 1e5, 0.8, np.nan), r"SelfAffine\.C0 = nan: must be"),
        (lambda: rf.TabulatedSpectrum([2.0, 1.0], [1.0, 1.0]), r"TabulatedSpectrum\.q\[1\] = 1\.0 after"),
        (lambda: rf.TabulatedSpectrum([1.0, 1.0], [1.0, 1.0]), r"must increase strictly"),
        (lambda: rf.TabulatedSpectrum([1.0], [1.0]), r"TabulatedSpectrum\.q has 1 entries"),
        (lambda: rf.TabulatedSpectrum([1.0, 2.0], [1.0, 0.0]), r"TabulatedSpectrum\.C\[1\] = 0\.0: must be"),
        (lambda: rf.TabulatedModulus([2.0, 1.0], [1.0, 1.0], [1.0, 1.0]), r"TabulatedModulus\.omega\[1\]"),
        (lambda: rf.TabulatedModulus([1.0], [1.0], [1.0]), r"TabulatedModulus\.omega has 1 entries"),
        (lambda: rf.TabulatedModulus([1.0, 2.0], [1.0, 1.0], [1.0, 0.0]), r"TabulatedModulus\.loss\[1\]"),
        (lambda: rf.TabulatedShift([2.0, 1.0], [1.0, 1.0], 1.5), r"TabulatedShift\.T\[1\] = 1\.0 after 2\.0"),
        (lambda: rf.TabulatedShift([1.0, 2.0], [1.0, 1.0], 2.5), r"TabulatedShift\.T_ref = 2\.5: must be"),
        (lambda: rf.TabulatedShift([1.0], [1.0], 1.0), r"TabulatedShift\.T has 1 entries"),
        (lambda: rf.ContactShear(6.5e6, 0.1, 0.0), r"ContactShear\.v0 = 0\.0: must be > 0"),
        (lambda: tread(tau=[0.0]), r"Prony\.tau\[0\] = 0\.0: must be > 0"),
        (lambda: tread(tau=[1.0, 2.0]), r"Prony: lengths differ \(E has 1, tau has 2\)"),
        (lambda: tread(E=[], tau=[]), r"Prony\.E is empty"),
        (lambda: tread(E_inf=0.0, E=[0.0]), r"Prony\.E_inf = 0\.0: must be > 0 if all E are 0"),
        (
            lambda: rf.Body(rf.PronyShear(1.0, [1.0], [1.0], 1.0), layer=rf.Slab(1e-3)),
            r"Body\.layer: a body of PronyShear .*; must be None",
        ),
        (lambda: rf.PronyShear(0.0, [0.0], [1.0], 1.0), r"PronyShear\.G_inf = 0\.0: must be > 0 if all G"),
        (lambda: rf.PronyShear(0.0, [], [], 1.0), r"PronyShear\.G is empty"),
        (lambda: rf.PronyShear(0.0, [1.0], [1.0], 0.0), r"PronyShear\.bulk = 0\.0: must be > 0"),
        (lambda: rf.Body(rf.Rigid(), layer=rf.Slab(1e-3)), r"Body\.layer: a rigid body has no layer"),
        (lambda: rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Rigid())), r"both Rigid; one of the solids must"),
        (
            lambda: rf.Scene(rf.Body(tread()), rf.Body(tread()), area_correction=1),
            r"must be one of False, True",
        ),
    ],
)
def test_rules_between_fields(make, message):
    with pytest.raises(ValueError, match=message) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(rf.Quadrature)])
@pytest.mark.parametrize("value", [-1, 0.5, 10**9, np.nan, "8", None, True, [8], np.inf])
def test_quadrature_refuses_wrong_values(field, value):
    with pytest.raises(ValueError, match=rf"^Quadrature\.{field} = .*must be.*$"):
        rf.Quadrature(**{field: value})


def test_quadrature_is_static():
    assert jax.tree.leaves(rf.Quadrature()) == []
    assert rf.Quadrature() == rf.Quadrature()
    assert hash(rf.Quadrature(order=20)) == hash(rf.Quadrature(order=20))
    assert rf.Quadrature(order=20) != rf.Quadrature()
    assert jax.jit(lambda x, quadrature: quadrature.order * x)(1, rf.Quadrature(order=20)) == 20
