"""Tabulated moduli: E(omega) between and beyond the entries of a master curve."""

import functools
import math
from typing import ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.checks import PLAUSIBLE_STRESS, POSITIVE, check_table, is_concrete
from rubberfric.base.logarithms import floored_log
from rubberfric.base.objects.fields import Number, Vector, child, leaf, static
from rubberfric.base.objects.physical import physical
from rubberfric.base.quadrature import typed
from rubberfric.base.splines import BEFORE, BESIDE, MARGIN, at, splines
from rubberfric.materials.in_series import times
from rubberfric.materials.material import POISSON, Material, plane_strain_factor
from rubberfric.materials.shifts import Shift

# Largest span of a table in ln omega, 26 decades, which is the length of the grid of angular means.
LONGEST_TABLE = 60.0

# Extent of a rounded knot in widths. The deviation beyond it is 1e-20 of the change of slope.
REACH = 9.0

# Steps of the grid of `OnGrid` per smoothing width.
_PER_DETAIL = 6

# Degree of the polynomials for a rounded knot between two entries of a grid. The error is 1e-16.
_DEGREE = 13


@physical
class TabulatedModulus(Material):
    r"""Viscoelastic solid from a master curve: straight log-log lines, rounded at the entries.

    ln E' and ln E'' are linear in x = ln omega between the entries, convolved with a Gaussian of width d
    (`smoothing`). With the slopes s_j between the entries,

    .. math:: y(x) = y_1 + s_0 (x - x_1) + \sum_j (s_j - s_{j-1})\, d\, \psi\Big(\frac{x - x_j}{d}\Big),
              \qquad \psi(u) = u \Phi(u) + \frac{e^{-u^2/2}}{\sqrt{2\pi}}

    All derivatives with respect to omega and the entries exist. At every x the curve lies within the range of
    the straight lines up to a few d from x. It reproduces straight parts exactly. At an entry where the slope
    changes by s, the curve deviates from the lines by 0.4 d s. The outer slopes s_0 and s_n are 0 for E', so
    the first entry is E(0) and determines every static term. For E'', `outside` determines the outer slopes.

    Parameters
    ----------
    omega : angular frequencies, strictly increasing [rad/s], shape (n,), n >= 2, over 26 decades at most
    storage, loss : E' and E'' [Pa], > 0, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
    outside : "fall", "hold" or "none" (static)
        E'' outside the table. "fall": proportional to omega below and 1/omega above. "hold": constant, as in
        some programs; friction then does not vanish at v = 0+. "none": zero ("hold" times
        Phi((x - x_1) / d) Phi((x_n - x) / d)), which shows the share of friction from outside the table.
    smoothing : 0.02 ... 1 (static)
        d, the width in ln omega [-]. If straight lines replace a width of 0.1, the friction changes by 1e-2
        for a noisy table (R00 in the tests), and by 1e-3 for smooth tables.

    Errors: the angular means have errors of 1e-9, unless a modulus changes by a factor of more than e^(3 d)
    within d, or E'' with "none" ends where E'' exceeds 100 E'. A concrete table of more than 26 decades
    raises ValueError; under jit its friction is nan.

    Examples
    --------
    >>> omega = np.array([1e0, 1e1, 1e2, 1e3, 1e4])
    >>> rubber = rf.TabulatedModulus(omega, storage=1e6 * omega**0.2, loss=2e5 * omega**0.2)
    >>> f"{float(rf.complex_modulus(rubber, 10**1.5).real):.4g}"  # 1e6 10^0.3
    '1.995e+06'
    >>> E = np.asarray(rf.complex_modulus(rubber, np.array([1e5, 1e6])))
    >>> round(float(E.real[1] / E.real[0]), 6), round(float(E.imag[1] / E.imag[0]), 6)
    (1.0, 0.1)
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
        check_table("TabulatedModulus", omega=self.omega, storage=self.storage, loss=self.loss)
        if not 0.02 <= self.smoothing <= 1:
            raise ValueError(f"TabulatedModulus.smoothing = {self.smoothing!r}: must be 0.02 to 1")
        if is_concrete(self.omega):
            ends = np.asarray(self.omega)[[0, -1]]
            decades = math.log10(ends[1]) - math.log10(ends[0])
            if decades > LONGEST_TABLE / math.log(10):
                raise ValueError(f"TabulatedModulus.omega spans {decades:.0f} decades: must be at most 26")

    @property
    def loss_beyond(self) -> str:
        """Return `outside`, the form of E'' beyond the table."""
        return self.outside

    @property
    def detail(self) -> float:
        """Return `smoothing`, the width of the finest detail in ln omega [-]."""
        return self.smoothing

    def frequency_range(self) -> tuple[jax.Array, jax.Array]:
        """Return the first and last omega of the table [rad/s]."""
        return self.omega[0], self.omega[-1]

    def static_modulus(self) -> jax.Array:
        """Return E(omega = 0) [Pa]."""
        return self.storage[0]

    def glassy_reduced(self) -> jax.Array:
        """Return the largest real part of E_r in the table [Pa]."""
        return jnp.max(self.storage) * plane_strain_factor(self)

    def modulus(self, omega: jax.Array) -> jax.Array:
        """Return E(omega) [Pa], complex. omega [rad/s] must be > 0."""
        log_omega = floored_log(omega)
        knots, lines = self._lines()
        # Every knot at every point, for few points; `quick` and `modulus_on_grid` serve many.
        u = (log_omega[..., None] - knots) / self.smoothing
        curves = _straight(lines, log_omega, jnp.sum(u > 0, -1))
        curves = curves + self.smoothing * (_rounding(u) @ _bends(lines))
        return self._modulus(log_omega, curves)

    def reduced_on_grid(self, first: jax.Array, step: float, count: int) -> jax.Array:
        """Return E_r [Pa], complex, at ln omega = step (first + k) for k = 0 ... count - 1."""
        knots, lines = self._lines()
        log_omega = step * (first + jnp.arange(count, dtype=knots.dtype))
        # Last entry of the grid at or before every knot.
        entry = jax.lax.stop_gradient(jnp.floor(knots / step)) - first
        index = entry.astype(int)
        passed = jnp.zeros(count, knots.dtype).at[index + 1].add(1.0, mode="drop")
        curves = _straight(lines, log_omega, _running_sum(passed).astype(int))
        # A knot is round only within a few steps. Its shape depends on its position between two grid entries.
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
        return times(plane_strain_factor(self), self._modulus(log_omega, curves))

    def quick(self) -> "OnGrid":  # pyright: ignore[reportIncompatibleMethodOverride]
        """Return splines of ln E_r' and ln E_r''."""
        step, reach = self.smoothing / _PER_DETAIL, REACH * self.smoothing
        low, high = (jnp.log(end) for end in self.frequency_range())
        ends = jax.lax.stop_gradient(jnp.stack([low - reach, high + reach]))
        first = jnp.floor(ends[0] / step) - BEFORE
        count = math.ceil((LONGEST_TABLE + 2 * reach) / step) + 12 + 2 * MARGIN
        reduced = self.reduced_on_grid(first, step, count)
        logarithms = log_floored(jnp.stack([jnp.real(reduced), jnp.imag(reduced)]))
        logarithms = jnp.where(high - low <= LONGEST_TABLE, logarithms, jnp.nan)
        return OnGrid(self, first + MARGIN + BESIDE, ends, splines(logarithms))

    def _modulus(self, log_omega, curves):
        """Return E [Pa], where the last axis of `curves` holds ln E' and ln E''."""
        loss = jnp.exp(curves[..., 1])
        if self.outside == "none":
            first, last = jnp.log(self.omega[0]), jnp.log(self.omega[-1])
            inside = _below((log_omega - first) / self.smoothing)
            loss = loss * inside * _below((last - log_omega) / self.smoothing)
        return jax.lax.complex(jnp.exp(curves[..., 0]), loss)

    def _lines(self):
        """Return ln omega of the entries, and the lines before, between and after them, of shape (n + 1, 5).

        A row holds a point (ln omega, ln E', ln E'') on a line, and the slopes of ln E' and ln E''.
        """
        knots = jnp.log(self.omega)
        values = jnp.log(jnp.stack([self.storage, self.loss], -1))
        fall = 1.0 if self.outside == "fall" else 0.0
        slopes = jnp.diff(values, axis=0) / jnp.diff(knots)[:, None]
        ends = jnp.array([[0.0, fall], [0.0, -fall]], values.dtype)
        slopes = jnp.concatenate([ends[:1], slopes, ends[1:]])
        points = jnp.concatenate([knots[:, None], values], 1)
        return knots, jnp.concatenate([jnp.concatenate([points[:1], points]), slopes], 1)


class OnGrid(NamedTuple):
    """A tabulated modulus as splines of the logarithms of E_r over a uniform grid of ln omega."""

    table: TabulatedModulus
    first: jax.Array  # the first cell begins at step * first
    ends: jax.Array  # ln omega where the moduli become powers, below and above
    cells: jax.Array

    deforms = True
    has_series = False

    @property
    def loss_at_rest(self) -> bool:
        """Return True if E'' stays above 0 for omega -> 0."""
        return self.table.loss_at_rest

    @property
    def poisson(self) -> jax.Array:
        """Return Poisson's ratio of the table [-]."""
        return self.table.poisson

    @property
    def shift(self) -> Shift | None:
        """Return the shift of the table."""
        return self.table.shift

    def reduced_modulus(self, omega: jax.Array) -> jax.Array:
        """Return E_r(omega) [Pa], complex. omega [rad/s] must be >= 0."""
        log_omega = floored_log(omega)
        inside = jnp.clip(log_omega, *self.ends)
        position = inside * (_PER_DETAIL / self.table.smoothing) - self.first
        storage, loss = jnp.exp(at(self.cells, position))
        if self.table.outside == "fall":
            loss = loss * jnp.exp(-jnp.abs(log_omega - inside))
        elif self.table.outside == "none":
            loss = jnp.where(log_omega == inside, loss, 0.0)
        return jax.lax.complex(storage, loss)

    def static_reduced(self) -> jax.Array:
        """Return E_r(omega = 0) [Pa]."""
        return self.table.static_reduced()


def log_floored(values: jax.Array) -> jax.Array:
    """Return the logarithm of values >= 0, with a floor."""
    return floored_log(values, 0.8)


def _straight(lines, log_omega, which):
    """Return ln E' and ln E'' on the lines with the indices `which`, as an array of shape (..., 2)."""
    # One row per line, so that its derivative is a single scatter.
    row = lines.at[which].get(mode="promise_in_bounds")
    return row[..., 1:3] + row[..., 3:] * (log_omega - row[..., 0])[..., None]


def _bends(lines):
    """Return the changes of slope of ln E' and ln E'' at the entries, as an array of shape (n, 2)."""
    return jnp.diff(lines[:, 3:], axis=0)


def _running_sum(values):
    """Return the cumulative sum of `values`, computed by matrix products."""
    size = math.ceil(math.sqrt(values.shape[0]))
    rows = jnp.pad(values, (0, size * size - values.shape[0])).reshape(size, size)
    upper = np.triu(np.ones((size, size)))
    within = rows @ jnp.asarray(upper, values.dtype)
    before = within[:, -1] @ jnp.asarray(upper - np.eye(size), values.dtype)
    return (within + before[:, None]).reshape(-1)[: values.shape[0]]


def _rounding(u):
    """Return psi(u) - max(u, 0), because `_straight` already follows the line after the entry for u > 0."""
    sign = jnp.where(u > 0, -1.0, 1.0).astype(u.dtype)
    tail = sign * 0.5 * jax.scipy.special.erfc(-sign * u * math.sqrt(0.5))
    return jnp.exp(-0.5 * u * u) * (1 / math.sqrt(2 * math.pi)) + u * tail


@functools.lru_cache(maxsize=64)
def _rounded(step, half):
    """Return the coefficients of polynomials in t that interpolate `_rounding` at (k - 1/2 - t) step.

    The result has the shape (_DEGREE + 1, 2 half), with a column for each k = 1 - half ... half.
    """
    t = 0.5 * np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
    k = np.arange(1 - half, half + 1)
    u = (k - 0.5 - t[:, None]) * step
    sign = np.where(k > 0, -1.0, 1.0)
    tail = sign * 0.5 * np.vectorize(math.erfc)(-sign * u * math.sqrt(0.5))
    values = np.exp(-0.5 * u * u) / math.sqrt(2 * math.pi) + u * tail
    return np.linalg.solve(t[:, None] ** np.arange(_DEGREE + 1), values)


def _below(u):
    """Return the normal distribution function Phi(u)."""
    return 0.5 * jax.scipy.special.erfc(-u * math.sqrt(0.5))
