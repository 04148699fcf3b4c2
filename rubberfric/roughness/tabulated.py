"""Tabulated spectra C(q), with a first and last wavevector within the table."""

from typing import ClassVar, Self

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.base.blocks import recurring_length
from rubberfric.base.checks import PLAUSIBLE_WAVEVECTOR, POSITIVE, NumberLike, check_table, is_concrete, shown
from rubberfric.base.objects.fields import Matrix, OptionalNumber, Vector, leaf
from rubberfric.base.objects.physical import physical
from rubberfric.roughness.spectra import BrokenPowerLaw, Spectrum, doubts_of_roughness, log_ratio


class Table(Spectrum):
    """Base class of tables of C over q, and over directions in a second dimension of C."""

    q: Vector
    C: Vector | Matrix
    q0: OptionalNumber
    q1: OptionalNumber

    def power_law(self) -> BrokenPowerLaw:
        """Return a power law with one piece between any two neighbouring entries.

        It is the mean over all directions. Pieces outside q0 ... q1 have zero width and lie at q1.
        """
        return cut_law(self._whole_law(), self.q0, self.q1)

    def uncut_law(self) -> BrokenPowerLaw:
        """Return the power law from q0 to the end of the table."""
        return cut_law(self._whole_law(), self.q0, None)

    def _whole_law(self):
        mean = self.C if self.C.ndim == 1 else jnp.mean(self.C, 1)
        log_C = jnp.log(mean)
        exponent = jnp.diff(log_C) / log_ratio(self.q[1:], self.q[:-1]) + 2
        return BrokenPowerLaw(self.q, log_C + 2 * jnp.log(self.q), exponent, jnp.ones_like(self.q[0]))

    def cut(self, q1: jax.Array) -> Self:
        """Return the spectrum with a new q1 [1/m], which is limited to the last wavevector of the table."""
        return self.replace(q1=jnp.where(q1 < self.q[-1], q1, self.q[-1]))

    def entries(self) -> jax.Array:
        """Return C [m^4]."""
        return self.C

    def padded(self) -> Self:
        """Return the spectrum with a table that is extended to a standard length beyond q1.

        q0 and q1 keep the range of the original table.
        """
        at, values = np.asarray(self.q), np.asarray(self.C)
        added = recurring_length(at.size) - at.size
        beyond = at[-1] * 2.0 ** np.arange(1, added + 1, dtype=at.dtype)
        return self.replace(
            q=np.concatenate([at, beyond]),
            C=np.concatenate([values, np.repeat(values[-1:], added, 0)]),
            q0=at[0] if self.q0 is None else self.q0,
            q1=at[-1] if self.q1 is None else self.q1,
        )


@physical
class TabulatedSpectrum(Table):
    """Power spectrum from a table, where ln C is linear in ln q between the entries.

    C is 0 outside q0 ... q1. A power law is reproduced exactly. Every entry is a border of the radial
    quadrature, so values and gradients are exact integrals of this broken power law.

    Parameters
    ----------
    q : wavevectors, strictly increasing [1/m], shape (n,), n >= 2
    C : power spectrum [m^4], > 0, shape (n,)
    q0, q1 : first and last wavevector of the roughness [1/m], q[0] <= q0 < q1 <= q[-1]
        None selects the end of the table. q0 and q1 can be fitted. A change of q0 or q1 does not compile
        again.

    Limits: traced q0 and q1 are not checked. If q0 or q1 lies beyond the table, the first or last piece
    continues. If q^4 C increases by a factor of more than 1e6 between two entries, the separation has a
    relative error of 1e-4, or of 2 % if the q of these entries differ by less than 2 %. In full contact,
    separations below 1e-20 / q0 then have no correct digit. More panels reduce these errors.

    Examples
    --------
    >>> table = rf.TabulatedSpectrum(q=[1e3, 1e5], C=[1e-14, 1e-22])
    >>> f"{float(rf.roughness.rms_height(table)):.4g}"  # in m
    '0.0001772'
    >>> half = table.replace(q1=1e4)
    >>> round(float((rf.rms_slope(half) / rf.rms_slope(table)) ** 2), 6)
    0.5
    """

    file_kind: ClassVar[str] = "tabulated"
    rising: ClassVar = (("q",), ("q[0]", "q0", "q1", "q[-1]"))

    q: Vector = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, column="q")
    C: Vector = leaf(POSITIVE, unit="m^4", column="C", over="q")
    q0: OptionalNumber = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, default=None)
    q1: OptionalNumber = leaf(POSITIVE, unit="1/m", plausible=PLAUSIBLE_WAVEVECTOR, default=None)

    def _check(self):
        check_table("TabulatedSpectrum", q=self.q, C=self.C)
        check_ends("TabulatedSpectrum", self.q, self.q0, self.q1)

    def doubts(self) -> list[str]:
        """Return the warnings of `doubts_of_roughness` for this spectrum."""
        log_q, log_C = np.log(np.asarray(self.q, float)), np.log(np.asarray(self.C, float))
        low = log_q[0] if self.q0 is None else np.log(float(self.q0))
        high = log_q[-1] if self.q1 is None else np.log(float(self.q1))
        at = np.union1d(log_q[(log_q > low) & (log_q < high)], [low, high])
        return doubts_of_roughness(at, np.interp(at, log_q, log_C))


def cut_law(law: BrokenPowerLaw, q0: NumberLike | None, q1: NumberLike | None) -> BrokenPowerLaw:
    """Return a law cut to q0 ... q1 [1/m], with an unchanged number of pieces.

    If q0 or q1 is None, the law keeps its first or last wavevector. The pieces between q0 and q1 come first,
    with their exponents. Pieces that were cut off follow with zero width at q1 and the exponent of the last
    piece.
    """
    if q0 is None and q1 is None:
        return law
    law = jax.tree.map(jnp.asarray, law)  # NumPy arrays accept no traced index
    first, last = (
        jnp.asarray(end) if cutoff is None else jnp.asarray(cutoff)
        for cutoff, end in ((q0, law.q[0]), (q1, law.q[-1]))
    )
    inner, place = law.q[1:-1], np.arange(law.exponent.shape[0])
    from_piece, to_piece = jnp.sum(inner <= first), jnp.sum(inner < last)
    index = jnp.minimum(from_piece + place, to_piece)
    kept = from_piece + place <= to_piece
    left = jnp.where(place == 0, first, jnp.where(kept, law.q[index], last))
    begin, exponent = law.q[index], law.exponent[index]
    q = jnp.append(left, last)
    # The last kink also belongs to the last piece.
    whole = law.log_value[index] + exponent * log_ratio(left, begin)
    end = law.log_value[to_piece] + law.exponent[to_piece] * log_ratio(last, law.q[to_piece])
    return BrokenPowerLaw(q, jnp.append(whole, end), exponent, law.height2)


def check_ends(owner: str, q: jax.Array, q0: NumberLike | None, q1: NumberLike | None) -> None:
    """Raise ValueError if a concrete q0 or q1 is outside the table, or if q0 >= q1."""
    if not is_concrete(q):
        return
    low, high = np.asarray(q)[[0, -1]]  # q[0] of a JAX array would be traced
    # In the precision of the table, because they may equal its ends.
    ends = {
        name: np.asarray(value).astype(low.dtype)
        for name, value in (("q0", q0), ("q1", q1))
        if value is not None and is_concrete(value)
    }
    for name, value in ends.items():
        if not low <= value <= high:
            raise ValueError(
                f"{owner}.{name} = {shown(value[()])}: must lie within the table,"
                f" {shown(low)} ... {shown(high)} 1/m"
            )
    begin = low if q0 is None else ends.get("q0")
    end = high if q1 is None else ends.get("q1")
    if begin is not None and end is not None and not begin < end:
        raise ValueError(
            f"{owner}.q1 = {shown(np.asarray(end)[()])}: must be > q0 = {shown(np.asarray(begin)[()])}"
        )
