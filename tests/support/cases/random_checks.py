"""Check what holds for every scene: bounds, signs, growth with the load, scaling and derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import scipy.special
from support.cases.stored import paths, quantities

import rubberfric as rf

EPS = np.finfo(float).eps


# Tolerance of forward minus reverse mode, for all leaves except the wavevectors, and for these: the contact
# begins within t = ln(q/q0) ~ 1e-10 at light loads, and a derivative with respect to where t = 0
# is, d/dt ~ 1/t, has the rounding of t in it.
TOLERANCE = np.array([[1e-6], [1e-5]])


# Floors of area, friction and separation: a separation underflows, ~ e^(-x^2), in full
# contact, its derivatives 1e-60 before it, and zero weights stand for 1e-30 of the solid, which may relax.
FLOOR = np.array([1e-280, 1e-12, 1e-200])


# Tolerances of Euler's identities for stress, time and height.
SCALING_TOLERANCE = np.array([[1e-9], [1e-9], [1e-9]])


# Tolerances of these identities for tabulated moduli. They are integrated across their kinks over nodes of
# q v that stay fixed, with errors of 1e-5 ... 1e-3 in the identity for time.
TABULATED_TOLERANCE = np.array([[1e-9], [3e-3], [1e-9]])


WAVEVECTORS = ("q", "q0", "qr", "q1")


def own_size(name, x, body, first):
    """Relative to a change of a leaf by its own size; zeros count as 1."""
    size = np.where(x != 0, x, 1.0)
    layer = None if body is None else body.layer
    if layer is None or layer.base != "bonded" or name not in ("poisson", "E", "E_inf", "young"):
        return size
    # A film sees Poisson's ratio once 1 - 2 nu exceeds (q d)^2: d ln Sbar / d nu is 1 over the two, 1e18 of
    # films 1e-9 wavelengths thick, and 1e-16 of that is rounding. A modulus it makes Sbar times as stiff.
    if name == "poisson":
        return np.minimum(size, 1 - 2 * x + (first * layer.thickness) ** 2)
    stiffening = np.asarray(layer.stiffening(body.material.poisson, jnp.asarray(first)))
    return np.where(x != 0, x, 1 / np.maximum(stiffening, 1.0))


def first_of(spectrum):
    """The first wavevector of a spectrum."""
    return float(spectrum.q[0] if isinstance(spectrum, rf.TabulatedSpectrum) else spectrum.q0)


def first_wavevector(scene):
    """The first of all roughness."""
    return min(first_of(body.spectrum) for body in (scene.lower, scene.upper) if body.spectrum is not None)


def directions(call):
    """How fast every leaf moves along two directions: all but the wavevectors, and the wavevectors.

    Each at about its own size.
    """
    rng = np.random.default_rng(0)
    scene = call[0]
    first = first_wavevector(scene)

    def velocities(path, x):
        name = getattr(path[-1], "name", None)
        body = getattr(scene, path[1].name) if len(path) > 2 and path[1].name in ("lower", "upper") else None
        size = rng.uniform(0.5, 1.5, np.shape(x)) * own_size(name, x, body, first)
        one = name in WAVEVECTORS
        return np.stack([size * (not one), size * one]).astype(x.dtype)

    return jax.tree.map_with_path(velocities, call)


@jax.jit
def everything(call, heavier, directions):
    """Values at (v, p), (-v, p) and (v, heavier); derivatives of the first along directions, and all."""

    def at_three_points(call):
        scene, velocity, pressure, *temperature = call
        velocities = jnp.stack([velocity, -velocity, velocity])
        return quantities((scene, velocities, jnp.stack([pressure, pressure, heavier]), *temperature))

    values, pull = jax.vjp(at_three_points, call)
    pick = jnp.zeros((3, 3, 3), values.dtype).at[jnp.arange(3), jnp.arange(3), 0].set(1)
    reverse = jax.vmap(pull)(pick)[0]
    if directions is None:
        return values, None, reverse
    return values, jax.vmap(lambda d: jax.jvp(at_three_points, (call,), (d,))[1][:, 0])(directions), reverse


# How the leaves scale with the units of stress and time, and with the height of the roughness at a pressure
# larger by the factor; other numbers do not scale. For lengths see `test_identities.py`.
SCALING = {
    **dict.fromkeys(("E_inf", "E", "young", "storage", "loss"), (1, 0, 0)),
    **dict.fromkeys(("v", "v0", "omega"), (0, -1, 0)),
    "p": (1, 0, 1),
    "tau_f0": (1, 0, 2),
    "tau": (0, 1, 0),
    "h_rms": (0, 0, 1),
    "C": (0, 0, 2),
}


QUANTITY_SCALING = np.array([[0, 0, 0], [0, 0, 1], [0, 0, 1]])  # area, friction, separation


def scaling_error(call, values, reverse):
    """Return the error of Euler's identity, sum of exponent x dQ/d ln theta = exponent of Q x Q, its
    measured against, both of shape (3, 3)."""
    total, scale = -QUANTITY_SCALING.T * values[:, 0], np.zeros((3, 3))
    leaves = jax.tree.leaves_with_path(reverse)
    for (path, slope), leaf in zip(leaves, jax.tree.leaves(call), strict=True):
        name = getattr(path[-1], "name", None) or {1: "v", 2: "p"}.get(path[-1].idx)
        exponent = np.array(SCALING.get(name, (0, 0, 0)))[:, None]
        change = np.reshape(slope, (3, -1)) * np.ravel(leaf)
        total += exponent * change.sum(-1)
        scale += np.abs(change).sum(-1)
    return np.abs(total), scale + np.abs(values[:, 0]) + FLOOR


def tolerance(scene):
    """Tolerances of Euler's identities for area, friction and separation, (3, 1)."""
    materials = scene.lower.material, scene.upper.material
    tables = [material for material in materials if isinstance(material, rf.TabulatedModulus)]
    found = (TABULATED_TOLERANCE if tables else SCALING_TOLERANCE).copy()
    # Differences of rates that differ by 1e-6 have lost six digits.
    for material in materials:
        if isinstance(material, rf.Prony):
            gaps = np.diff(np.sort(np.log(material.tau)))
            found[1] += 16 * EPS / min([1.0, *gaps[gaps > 0]])
    return found


def has_zero_moduli(scene):
    return any(
        isinstance(body.material, rf.Prony) and (body.material.E_inf == 0 or not np.all(body.material.E))
        for body in (scene.lower, scene.upper)
    )


def as_numbers(call, dtype=float):
    return jax.tree.map(lambda x: np.asarray(x, dtype), call)


def rounding_of_area(scene, area, eps):
    """Relative error of A/A0: an erf, and with S in G also a polynomial in ln g.

    The logarithm and its position in the table are rounded by eps |ln g|; half of it is in ln G (the
    slopes of ln(G/g) are -1/2 ... 0) and half of that in x. At light loads A ~ G^-1/2 and g ~ G^2 at most.
    """
    if not scene.area_correction:
        return 4 * eps
    return (4 + 4 * np.log(1 / max(area, np.finfo(float).tiny)) + 4) * eps


def least_growth(scene, area, log_ratio, eps):
    """By which ln(A/A0) has grown to `area` at least as the pressure did by `log_ratio`.

    d ln P / d ln x = 2 x e^(-x^2) / (sqrt(pi) P) falls with x = p / (2 p sqrt G), and with S in G
    1/2 <= d ln x / d ln p <= 1, for d ln S / d ln G >= -1.
    """
    x = scipy.special.erfinv(min(area * (1 + 4 * eps), 1.0))
    if not np.isfinite(x) or x == 0:
        return 0.0
    slope = 2 / np.sqrt(np.pi) * x * np.exp(-x * x) / scipy.special.erf(x)
    return (0.5 if scene.area_correction else 1.0) * slope * log_ratio


def least_friction(scene):
    """0; between its nodes an interpolant of E'' that ends swings about 0 where it has gone."""
    bodies = scene.lower, scene.upper
    return -1e-15 if any(getattr(body.material, "outside", None) == "none" for body in bodies) else 0.0


def check_values(call, heavier, values, eps):
    velocity, pressure = call[1:3]
    area, friction, separation = values
    assert np.isfinite(values).all()
    assert (area >= 0).all() and (area <= 1).all()
    assert (separation >= 0).all()
    assert (friction * np.sign(velocity) * [1, -1, 1] >= least_friction(call[0])).all()
    if velocity == 0:
        assert (friction == 0).all()
    assert friction[1] == -friction[0]
    assert (area[1], separation[1]) == (area[0], separation[0])
    if area[0] > 0:
        # Loads that differ by 1e-15 say nothing but rounding.
        log_ratio = np.log1p(float((heavier - pressure) / pressure))
        rounding = rounding_of_area(call[0], area[0], eps)
        growth = np.log1p(float((area[2] - area[0]) / area[0]))
        assert growth >= (1 - 4 * EPS) * least_growth(call[0], float(area[2]), log_ratio, eps) - rounding


def not_finite(slopes):
    """Names of the leaves whose derivatives are not finite."""
    return [
        p for p, s in zip(paths(slopes), jax.tree.leaves(slopes), strict=True) if not np.isfinite(s).all()
    ]


def forward_less_reverse(values, forward, reverse, directions):
    """Return |forward - reverse| along every direction, and its scale; shape (2, 3)."""
    slopes, moves = jax.tree.leaves(reverse), jax.tree.leaves(directions)
    moved = [
        np.reshape(move, (2, 1, -1)) * np.reshape(slope, (3, -1))
        for slope, move in zip(slopes, moves, strict=True)
    ]
    moved = np.concatenate(moved, -1)
    # Single derivatives may cancel to nothing; rounding is relative to the largest.
    scale = np.abs(values[:, 0]) + np.abs(moved).sum((0, -1)) + FLOOR
    return np.abs(forward - moved.sum(-1)), scale


def check(call, heavier):
    call = as_numbers(call)
    along = directions(call)
    heavier = call[2] * (1 + heavier)
    values, forward, reverse = jax.tree.map(np.asarray, everything(call, heavier, along))
    check_values(call, heavier, values, EPS)
    assert not not_finite(reverse)
    error, scale = scaling_error(call, values, reverse)
    # The floor of a zero modulus does not scale, so the identity for stress does not apply.
    begin = 1 if has_zero_moduli(call[0]) else 0
    assert (error <= tolerance(call[0]) * scale)[begin:].all()
    assert np.isfinite(forward).all()
    difference, scale = forward_less_reverse(values, forward, reverse, along)
    assert (difference <= TOLERANCE * scale).all()
