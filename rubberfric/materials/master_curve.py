"""Tabulated moduli: E(omega) between and beyond the entries of a master curve."""

import jax.numpy as jnp


def interpolated_modulus(material, log_omega):
    """E' and E'' [Pa] at ln omega, by the rules in TabulatedModulus's docstring."""
    knots = jnp.log(material.omega)
    inside = jnp.clip(log_omega, knots[0], knots[-1])
    piece = jnp.clip(jnp.searchsorted(knots, inside, side="right") - 1, 0, knots.shape[0] - 2)
    share = (inside - knots[piece]) / (knots[piece + 1] - knots[piece])

    def between(values):
        log = jnp.log(values)
        return log[piece] + share * (log[piece + 1] - log[piece])

    log_loss = between(material.loss)
    beyond = jnp.abs(log_omega - inside)
    if material.outside == "fall":
        log_loss = log_loss - beyond
    loss = jnp.exp(log_loss)
    if material.outside == "none":
        loss = jnp.where(beyond > 0, 0.0, loss)
    return jnp.exp(between(material.storage)), loss
