r"""Complex stiffnesses: two in series, 1 / (1/a + 1/b), by sums of positive terms, and multiples.

.. math:: \mathrm{Re}\frac{ab}{a+b} = \frac{a'|b|^2 + b'|a|^2}{|a+b|^2},\qquad
          \mathrm{Im}\frac{ab}{a+b} = \frac{a''|b|^2 + b''|a|^2}{|a+b|^2}

The quotient of the complex numbers would lose the digits of a small loss: if a' exceeds |b| by 1e12, four
digits of the loss remain. The derivatives are

.. math:: dF = \Big(\frac{b}{a+b}\Big)^2 da + \Big(\frac{a}{a+b}\Big)^2 db
"""

import jax
import jax.numpy as jnp


@jax.custom_jvp
def in_series(a: jax.Array, b: jax.Array) -> jax.Array:
    """Return F = 1 / (1/a + 1/b), which is 0 if a and b are 0.

    Parameters
    ----------
    a, b : real or complex, in the same unit, shapes that broadcast
        The real parts are >= 0. The imaginary parts have the same sign.

    Returns
    -------
    array, complex if a or b is complex
    """
    larger, a, b, below = _scaled(a, b)
    share, a2, b2 = larger / below, _abs2(a), _abs2(b)
    real = share * (jnp.real(a) * b2 + jnp.real(b) * a2)
    if not (jnp.iscomplexobj(a) or jnp.iscomplexobj(b)):
        return real
    return jax.lax.complex(real, share * (jnp.imag(a) * b2 + jnp.imag(b) * a2))


@in_series.defjvp
def _in_series_jvp(primals, tangents):
    # The derivatives of the two sums would lose the digits of the stiffer solid's small share.
    _, a, b, below = _scaled(*primals)
    by_a, by_b = _share(b, a, below) ** 2, _share(a, b, below) ** 2
    # Real and complex terms have different dtypes.
    changes = [times(*x) for x in ((by_a, tangents[0]), (by_b, tangents[1]))]
    dtype = jnp.result_type(*(x.dtype for x in changes))
    return in_series(*primals), changes[0].astype(dtype) + changes[1].astype(dtype)


def times(x: jax.Array, y: jax.Array) -> jax.Array:
    """Return x y, where a factor may be real and the other complex, without a promotion of dtypes."""
    if jnp.iscomplexobj(x) == jnp.iscomplexobj(y):
        return x * y
    factor, z = (y, x) if jnp.iscomplexobj(x) else (x, y)
    return jax.lax.complex(*jnp.broadcast_arrays(factor * jnp.real(z), factor * jnp.imag(z)))


def _scaled(a, b):
    """Return the larger of a and b, both divided by it, and |a + b|^2, which is 1 if both are 0."""
    larger = jax.lax.stop_gradient(jnp.maximum(*map(_size, (a, b))))
    larger = jnp.where(larger > 0, larger, 1.0)
    a, b = times(1 / larger, a), times(1 / larger, b)
    below = (jnp.real(a) + jnp.real(b)) ** 2 + (jnp.imag(a) + jnp.imag(b)) ** 2
    return larger, a, b, jnp.where(below > 0, below, 1.0)


def _share(x, y, below):
    """Return x / (x + y), where `below` is |x + y|^2."""
    real = jnp.real(x) * (jnp.real(x) + jnp.real(y)) + jnp.imag(x) * (jnp.imag(x) + jnp.imag(y))
    if not (jnp.iscomplexobj(x) or jnp.iscomplexobj(y)):
        return real / below
    return jax.lax.complex(real / below, (jnp.imag(x) * jnp.real(y) - jnp.real(x) * jnp.imag(y)) / below)


def _abs2(x):
    return jnp.real(x) ** 2 + jnp.imag(x) ** 2 if jnp.iscomplexobj(x) else x**2


def _size(x):
    return jnp.real(x) + jnp.abs(jnp.imag(x)) if jnp.iscomplexobj(x) else x
