"""Tabulated moduli: E(omega) between and beyond the entries of a master curve."""

from typing import ClassVar, Literal

import jax
import jax.numpy as jnp

from rubberfric.base.checks import PLAUSIBLE_STRESS, POSITIVE, check_increasing, check_lengths
from rubberfric.base.objects.fields import Number, Vector, child, leaf, static
from rubberfric.base.objects.physical import physical
from rubberfric.materials.material import POISSON, Material, plane_strain
from rubberfric.materials.shifts import Shift


@physical
class TabulatedModulus(Material):
    r"""Viscoelastic solid from a master curve.

    Between the entries ln E' and ln E'' are linear in ln omega. Below the table E'
    holds its first value, which is E(0) and sets every static term, and E'' falls like
    omega; above it E' holds its last value and E'' falls like 1/omega.

    Parameters
    ----------
    omega : angular frequencies, strictly increasing [rad/s], shape (n,), n >= 2
    storage, loss : E' and E'' [Pa], > 0, shape (n,)
    poisson : Poisson's ratio [-], 0 ... 0.5
    shift : WLF, Arrhenius, TabulatedShift or None
    outside : "fall", "hold" or "none" (static)
        E'' outside the table. "fall": as above. "hold": its end values, as some programs
        have it; then the friction does not vanish at v = 0+. "none": zero, which shows
        how much of the friction comes from outside the table.

    Limits: the angular integrals are done by quadrature (no closed form), which is slower,
    and the kinks at the entries leave errors of 1e-5 ... 1e-3 (a smooth ... a noisy
    table); `Quadrature.angle` lowers them.
    """

    file_kind: ClassVar[str] = "tabulated"

    omega: Vector = leaf(POSITIVE, unit="rad/s", column="omega")
    storage: Vector = leaf(POSITIVE, unit="Pa", plausible=PLAUSIBLE_STRESS, column="E_stor")
    loss: Vector = leaf(POSITIVE, unit="Pa", column="E_loss")
    poisson: Number = leaf(POISSON, unit="-", default=0.5)
    shift: Shift | None = child(default=None)
    outside: Literal["fall", "hold", "none"] = static(default="fall")

    def _check(self):
        check_lengths("TabulatedModulus", omega=self.omega, storage=self.storage, loss=self.loss)
        if self.omega.shape[0] < 2:
            raise ValueError(
                f"TabulatedModulus.omega has {self.omega.shape[0]} entries: must have at least 2"
            )
        check_increasing("TabulatedModulus.omega", self.omega)

    @property
    def loss_beyond(self) -> str:
        """`outside`."""
        return self.outside

    def frequency_range(self) -> tuple[jax.Array, jax.Array]:
        """First and last omega of the table [rad/s]."""
        return self.omega[0], self.omega[-1]

    def static_modulus(self) -> jax.Array:
        """E(omega = 0) [Pa]."""
        return self.storage[0]

    def glassy_reduced(self) -> jax.Array:
        """The highest E_r' of the table [Pa]."""
        return jnp.max(self.storage) * plane_strain(self)

    def storage_and_loss(self, log_omega: jax.Array) -> tuple[jax.Array, jax.Array]:
        """E' and E'' [Pa] at ln omega, any shape."""
        knots = jnp.log(self.omega)
        inside = jnp.clip(log_omega, knots[0], knots[-1])
        piece = jnp.clip(jnp.searchsorted(knots, inside, side="right") - 1, 0, knots.shape[0] - 2)
        share = (inside - knots[piece]) / (knots[piece + 1] - knots[piece])

        def between(values):
            log = jnp.log(values)
            return log[piece] + share * (log[piece + 1] - log[piece])

        log_loss = between(self.loss)
        beyond = jnp.abs(log_omega - inside)
        if self.outside == "fall":
            log_loss = log_loss - beyond
        loss = jnp.exp(log_loss)
        if self.outside == "none":
            loss = jnp.where(beyond > 0, 0.0, loss)
        return jnp.exp(between(self.storage)), loss
