"""Times of functions called in turns, so that their ratios survive a noisy machine."""

import time

import jax
import numpy as np


def in_turns(functions, rounds=40):
    """Return median times of several functions [s], called one after the other in every round."""
    times = {name: [] for name in functions}
    for function in functions.values():
        jax.block_until_ready(function())
    for _ in range(rounds):
        for name, function in functions.items():
            # The textbook method leaves cold caches behind, which must not slow its successor.
            for _ in range(1 if name == "numpy" else 4):
                begin = time.perf_counter()
                jax.block_until_ready(function())
                elapsed = time.perf_counter() - begin
            times[name].append(elapsed)
    return {name: float(np.median(values)) for name, values in times.items()}


def least(functions, rounds=60, calls=1):
    """Return least times of several functions [s], called in turns, `calls` times in every round."""
    times = dict.fromkeys(functions, np.inf)
    for function in functions.values():
        jax.block_until_ready(function())
    for _ in range(rounds):
        for name, function in functions.items():
            for _ in range(calls):
                begin = time.perf_counter()
                jax.block_until_ready(function())
                times[name] = min(times[name], time.perf_counter() - begin)
    return times
