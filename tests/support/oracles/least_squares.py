"""Standard problems of least squares: starts and minima.

The problems are from Moré, Garbow and Hillstrom, "Testing unconstrained optimization software", ACM
Transactions on Mathematical Software 7 (1981) 17, who give them.
"""

import jax.numpy as jnp

BARD = jnp.array([0.14, 0.18, 0.22, 0.25, 0.29, 0.32, 0.35, 0.39, 0.37, 0.58, 0.73, 0.96, 1.34, 2.10, 4.39])
KOWALIK = jnp.array([0.1957, 0.1947, 0.1735, 0.16, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246])
AT = jnp.array([4, 2, 1, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625])
MEYER = jnp.array(
    [34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820, 3307, 2872]
)


def rosenbrock(x):
    return jnp.stack([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def powell_singular(x):
    a, b, c, d = x
    return jnp.stack([a + 10 * b, jnp.sqrt(5) * (c - d), (b - 2 * c) ** 2, jnp.sqrt(10) * (a - d) ** 2])


def helical_valley(x):
    a, b, c = x
    angle = jnp.arctan2(b, a) / (2 * jnp.pi)
    return jnp.stack([10 * (c - 10 * angle), 10 * (jnp.hypot(a, b) - 1), c])


def wood(x):
    a, b, c, d = x
    root = jnp.sqrt(10.0)
    rows = [10 * (b - a**2), 1 - a, 3 * root * (d - c**2), 1 - c, root * (b + d - 2), (b - d) / root]
    return jnp.stack(rows)


def beale(x):
    power = jnp.arange(1, 4)
    return jnp.array([1.5, 2.25, 2.625]) - x[0] * (1 - x[1] ** power)


def brown_dennis(x):
    t = jnp.arange(1, 21) / 5
    return (x[0] + t * x[1] - jnp.exp(t)) ** 2 + (x[2] + x[3] * jnp.sin(t) - jnp.cos(t)) ** 2


def freudenstein_roth(x):
    a, b = x
    return jnp.stack([-13 + a + ((5 - b) * b - 2) * b, -29 + a + ((b + 1) * b - 14) * b])


def jennrich_sampson(x):
    i = jnp.arange(1, 11)
    return 2 + 2 * i - (jnp.exp(i * x[0]) + jnp.exp(i * x[1]))


def bard(x):
    u = jnp.arange(1.0, 16)
    return BARD - (x[0] + u / ((16 - u) * x[1] + jnp.minimum(u, 16 - u) * x[2]))


def kowalik_osborne(x):
    return KOWALIK - x[0] * (AT**2 + AT * x[1]) / (AT**2 + AT * x[2] + x[3])


def meyer(x):
    """In units of the start, as a fit has its parameters."""
    x = x * jnp.array([0.02, 4000.0, 250.0])
    return x[0] * jnp.exp(x[1] / (45 + 5 * jnp.arange(1, 17) + x[2])) - MEYER


# At these minima the Jacobian is singular, so that the linear model goes on promising a little.
STALLING = (freudenstein_roth, jennrich_sampson)
# Start, sum of squares at the minimum, and most Jacobians on the way to it.
PROBLEMS = {
    rosenbrock: ([-1.2, 1.0], 0.0, 8),
    powell_singular: ([3.0, -1.0, 0.0, 1.0], 0.0, 30),
    helical_valley: ([-1.0, 0.0, 0.0], 0.0, 12),
    wood: ([-3.0, -1.0, -3.0, -1.0], 0.0, 60),
    beale: ([1.0, 1.0], 0.0, 12),
    brown_dennis: ([25.0, 5.0, -5.0, -1.0], 85822.2016263, 35),
    freudenstein_roth: ([0.5, -2.0], 48.9842536792, 30),
    # The last steps, at the rounding of its cost, depend on compiler options.
    jennrich_sampson: ([0.3, 0.4], 124.362182355, 25),
    bard: ([1.0, 1.0, 1.0], 8.21487730658e-3, 8),
    kowalik_osborne: ([0.25, 0.39, 0.415, 0.39], 3.07505603849e-4, 15),
    meyer: ([1.0, 1.0, 1.0], 87.9458551708, 20),
}
