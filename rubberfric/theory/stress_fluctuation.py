"""State of contact: G(q) and what follows from it, at points and for given temperatures."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from rubberfric.theory.area_correction import correct_argument
from rubberfric.theory.contributions import parts, to_contact, total
from rubberfric.theory.partial_contact import contact_argument, contact_fraction, friction_weight


class Contact(NamedTuple):
    """What the roughness does at points; axes (panels, points, order) where there are three."""

    parts: list  # `channels.Parts` of every channel
    stiffness: jax.Array  # modulus scale over pressure, (points,)
    panels: jax.Array  # g of every panel, (panels, points); of all together, (1, points), if not graded
    x: jax.Array | None  # 1 / (2 sqrt G), plain; None if the mesh is not graded


def contact(prepared, velocity, pressure, warm):
    """`Contact` of a `radial.Prepared` scene.

    Parameters
    ----------
    prepared : radial.Prepared
    velocity, pressure : shape (points,) [m/s], [Pa]
    warm : for each channel the temperature of the solid it excites [K]: None, (points,), or
        (angular panels, points, angular order)
    """
    mesh = prepared.mesh
    found = [
        parts(channel, mesh, _speed(channel, mesh, velocity, T), prepared.wanted, prepared.quadrature)
        for channel, T in zip(prepared.channels, warm, strict=True)
    ]
    stiffness = prepared.scale / pressure
    if found[0].within is None:
        # Channels have panels of their own where nothing but the whole integral is wanted.
        whole = jnp.pi / 4 * total(jnp.sum(part.panels, 0, keepdims=True) for part in found)
        return Contact(found, stiffness, whole, None)
    panels = jnp.pi / 4 * total(part.panels for part in found)
    g = _sum_before(panels)[..., None] + jnp.pi / 4 * total(part.within for part in found)
    return Contact(found, stiffness, panels, contact_argument(g, stiffness[:, None]))


def contact_area(prepared, state, panels=None):
    """P after the first `panels` panels (None: after all, A/A0), (points,)."""
    whole = state.panels
    if panels is not None:
        whole = jnp.where(np.arange(whole.shape[0])[:, None] < panels, whole, 0.0)
    return contact_fraction(corrected(prepared, contact_argument(jnp.sum(whole, 0), state.stiffness)))


def friction_terms(prepared, state, kind="dissipation"):
    """Viscoelastic friction of every channel that dissipates, by contact nodes: (panels, points, order).

    kind : "dissipation", or "transverse" for the friction across the direction of sliding
    """
    weight = friction_weight(corrected(prepared, state.x), prepared.gamma)
    weight = jnp.pi * state.stiffness[:, None] * weight
    found = {j: getattr(part, kind) for j, part in enumerate(state.parts)}
    return {j: weight * density for j, density in found.items() if density is not None}


def _speed(channel, mesh, velocity, temperature):
    """v a_T [m/s]."""
    if temperature is None or channel.shift is None:
        return velocity
    if temperature.ndim > 1 and channel.modes.at_contact:
        temperature = to_contact(mesh, temperature)
    factor = jnp.exp(channel.shift.log_factor(temperature))
    return velocity * factor if temperature.ndim == 1 else velocity[:, None] * factor


def corrected(prepared, x):
    """S in G, where the scene asks for it."""
    return x if prepared.correction is None else correct_argument(prepared.correction, x)


def _sum_before(panels):
    """Sum over the panels before each one, without subtracting: a panel 1e20 times larger loses nothing."""
    return np.tril(np.ones((panels.shape[0],) * 2, panels.dtype), -1) @ panels
