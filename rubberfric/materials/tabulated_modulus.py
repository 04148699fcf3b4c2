"""Tabulated moduli: E(omega) between and beyond the entries of a master curve."""

import functools
import math
from typing import ClassVar, Literal

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import PLAUSIBLE_STRESS, POSITIVE, check_increasing, check_lengths, is_concrete
from rubberfric.base.objects.fields import Number, Vector, child, leaf, static
from rubberfric.base.objects.physical import physical
from rubberfric.base.quadrature import typed
from rubberfric.materials.material import POISSON, Material, plane_strain_factor
from rubberfric.materials.shifts import Shift

# A table may span this much of ln omega, 26 decades: so long is the grid of its angular means.
LONGEST_TABLE = 60.0

# Where a rounded knot is straight again, in widths: what is left there is 1e-20 of the change of slope.
REACH = 9.0

# Degree of the polynomials for a rounded knot between two entries of a grid, to 1e-16 of it.
_DEGREE = 13


@physical
class TabulatedModulus(Material):
    r"""Viscoelastic solid from a master curve, its straight lines rounded at the entries.

    ln E' and ln E'' are linear between the entries in x = ln omega, and that convolved with a Gaussian
    of width d, `smoothing`: with the slopes s_j on either side of the entries

    .. math:: y(x) = y_1 + s_0 (x - x_1) + \sum_j (s_j - s_{j-1})\, d\, \psi\Big(\frac{x - x_j}{d}\Big),
              \qquad \psi(u) = u \Phi(u) + \frac{e^{-u^2/2}}{\sqrt{2\pi}}

    It has all derivatives, with respect to omega and to every entry; it nowhere leaves the range of the
    straight lines within some d, and runs through a straight stretch exactly. At an entry where the slope
    changes by s it passes 0.4 d s from it. The slopes outside, s_0 and s_n, are 0 of E', so that its
    first entry is E(0) and sets every static term, and of E'' as `outside` says.

    Parameters
    ----------
    omega : angular frequencies, strictly increasing [rad/s], shape (n,), n >= 2, over 26 decades at most
    storage, loss : E' and E'' [Pa], > 0, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
    outside : "fall", "hold" or "none" (static)
        E'' outside the table. "fall": as omega below and as 1/omega above. "hold": its end values, as
        some programs have it; then the friction does not vanish at v = 0+. "none": zero, which shows
        how much of the friction comes from outside the table: "hold" times
        Phi((x - x_1) / d) Phi((x_n - x) / d).
    smoothing : 0.02 ... 1 (static)
        d, the width in ln omega [-]. The friction of a noisy table moves with it, of R00 in the tests
        by 1e-2 between 0.1 and straight lines, that of smooth ones by 1e-3.

    Errors: the angular means are good to 1e-9 of this law, unless a modulus steps by more than a
    factor e^(3 d) or so within d, or E'' of "none" ends where it is more than 100 E'. A concrete table of
    more than 26 decades raises ValueError; under jit its friction is nan.
    """

    file_kind: ClassVar[str] = "tabulated"
    rising: ClassVar = (("omega",),)

    omega: Vector = leaf(POSITIVE, unit="rad/s", column="omega")
    storage: Vector = leaf(POSITIVE, unit="Pa", plausible=PLAUSIBLE_STRESS, column="E_stor", over="omega")
    loss: Vector = leaf(POSITIVE, unit="Pa", column="E_loss", over="omega")
    poisson: Number = leaf(POISSON, unit="-", default=0.5)
    shift: Shift | None = child(default=None)
    outside: Literal["fall", "hold", "none"] = static(default="fall")
    smoothing: float = static(default=0.1)

    def _check(self):
        check_lengths("TabulatedModulus", omega=self.omega, storage=self.storage, loss=self.loss)
        if self.omega.shape[0] < 2:
            raise ValueError(
                f"TabulatedModulus.omega has {self.omega.shape[0]} entries: must have at least 2"
            )
        check_increasing("TabulatedModulus.omega", self.omega)
        if not 0.02 <= self.smoothing <= 1:
            raise ValueError(f"TabulatedModulus.smoothing = {self.smoothing!r}: must be 0.02 to 1")
        if is_concrete(self.omega):
            ends = np.asarray(self.omega)[[0, -1]]
            decades = math.log10(ends[1]) - math.log10(ends[0])
            if decades > LONGEST_TABLE / math.log(10):
                raise ValueError(f"TabulatedModulus.omega spans {decades:.0f} decades: must be at most 26")

    @property
    def loss_beyond(self) -> str:
        """`outside`."""
        return self.outside

    @property
    def detail(self) -> float:
        """`smoothing`."""
        return self.smoothing

    def frequency_range(self) -> tuple[jax.Array, jax.Array]:
        """First and last omega of the table [rad/s]."""
        return self.omega[0], self.omega[-1]

    def static_modulus(self) -> jax.Array:
        """E(omega = 0) [Pa]."""
        return self.storage[0]

    def glassy_reduced(self) -> jax.Array:
        """The highest E_r' of the table [Pa]."""
        return jnp.max(self.storage) * plane_strain_factor(self)

    def storage_and_loss(self, log_omega: jax.Array) -> tuple[jax.Array, jax.Array]:
        """E' and E'' [Pa] at ln omega, any shape."""
        knots, lines = self._lines()
        log_omega = jnp.asarray(log_omega)
        # Every knot at every point: for the few points of a curve that is drawn.
        u = (log_omega[..., None] - knots) / self.smoothing
        curves = _straight(lines, log_omega, jnp.sum(u > 0, -1))
        curves = curves + self.smoothing * (_rounding(u) @ _bends(lines))
        return self._moduli(log_omega, curves)

    def storage_and_loss_on_grid(
        self, first: jax.Array, step: float, count: int
    ) -> tuple[jax.Array, jax.Array]:
        """E' and E'' [Pa] at ln omega = step (first + k), k = 0 ... count - 1; first is a whole number."""
        knots, lines = self._lines()
        log_omega = step * (first + jnp.arange(count, dtype=knots.dtype))
        # The last entry of the grid before every knot, or at it.
        entry = jax.lax.stop_gradient(jnp.floor(knots / step)) - first
        index = entry.astype(int)
        passed = jnp.zeros(count, knots.dtype).at[index + 1].add(1.0, mode="drop")
        curves = _straight(lines, log_omega, _running_sum(passed).astype(int))
        # A knot is round over a few steps beside it only, in a way that depends on where between two
        # entries of the grid it lies.
        half = math.ceil(REACH * self.smoothing / step)
        along = knots / step - first - entry - 0.5
        powers = jnp.stack([along**k for k in range(_DEGREE + 1)], -1)
        added = self.smoothing * (powers @ typed(_rounded(step / self.smoothing, half), knots))
        place = jax.lax.ScatterDimensionNumbers((1, 2), (), (0,))
        curves = jax.lax.scatter_add(
            curves,
            index[:, None] + (1 - half),
            added[..., None] * _bends(lines)[:, None],
            place,
            mode=jax.lax.GatherScatterMode.FILL_OR_DROP,
        )
        return self._moduli(log_omega, curves)

    def _moduli(self, log_omega, curves):
        """E' and E'' of their logarithms, the last axis of `curves`."""
        loss = jnp.exp(curves[..., 1])
        if self.outside == "none":
            first, last = jnp.log(self.omega[0]), jnp.log(self.omega[-1])
            inside = _below((log_omega - first) / self.smoothing)
            loss = loss * inside * _below((last - log_omega) / self.smoothing)
        return jnp.exp(curves[..., 0]), loss

    def _lines(self):
        """ln omega; and of the line before, those between and that after the entries a row.

        It is a point (ln omega, ln E', ln E'') of the line, and its slopes of ln E' and ln E''.
        """
        knots = jnp.log(self.omega)
        values = jnp.log(jnp.stack([self.storage, self.loss], -1))
        fall = 1.0 if self.outside == "fall" else 0.0
        slopes = jnp.diff(values, axis=0) / jnp.diff(knots)[:, None]
        ends = jnp.array([[0.0, fall], [0.0, -fall]], values.dtype)
        slopes = jnp.concatenate([ends[:1], slopes, ends[1:]])
        points = jnp.concatenate([knots[:, None], values], 1)
        return knots, jnp.concatenate([jnp.concatenate([points[:1], points]), slopes], 1)


def _straight(lines, log_omega, which):
    """ln E' and ln E'' on lines, (..., 2)."""
    # A row for every line: its derivative is one scatter.
    row = lines.at[which].get(mode="promise_in_bounds")
    return row[..., 1:3] + row[..., 3:] * (log_omega - row[..., 0])[..., None]


def _bends(lines):
    """Changes of the slopes at the entries, (n, 2)."""
    return jnp.diff(lines[:, 3:], axis=0)


def _running_sum(values):
    """Cumulative sum, by matrix products."""
    size = math.ceil(math.sqrt(values.shape[0]))
    rows = jnp.pad(values, (0, size * size - values.shape[0])).reshape(size, size)
    upper = np.triu(np.ones((size, size)))
    within = rows @ jnp.asarray(upper, values.dtype)
    before = within[:, -1] @ jnp.asarray(upper - np.eye(size), values.dtype)
    return (within + before[:, None]).reshape(-1)[: values.shape[0]]


def _rounding(u):
    """psi(u) - max(u, 0), where u > 0 the line after the entry is that of `_straight`."""
    sign = jnp.where(u > 0, -1.0, 1.0).astype(u.dtype)
    tail = sign * 0.5 * jax.scipy.special.erfc(-sign * u * math.sqrt(0.5))
    return jnp.exp(-0.5 * u * u) * (1 / math.sqrt(2 * math.pi)) + u * tail


@functools.lru_cache(maxsize=64)
def _rounded(step, half):
    """Polynomials in t for `_rounding` at (k - 1/2 - t) step, k = 1 - half ... half, (degree + 1, 2 half)."""
    t = 0.5 * np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    k = np.arange(1 - half, half + 1)
    u = (k - 0.5 - t[:, None]) * step
    sign = np.where(k > 0, -1.0, 1.0)
    tail = sign * 0.5 * np.vectorize(math.erfc)(-sign * u * math.sqrt(0.5))
    values = np.exp(-0.5 * u * u) / math.sqrt(2 * math.pi) + u * tail
    return np.linalg.solve(t[:, None] ** np.arange(_DEGREE + 1), values)


def _below(u):
    """Phi(u)."""
    return 0.5 * jax.scipy.special.erfc(-u * math.sqrt(0.5))
