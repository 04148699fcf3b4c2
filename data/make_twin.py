"""Make the twin measurements: friction of a known scene, with noise, for trying fits.

python data/make_twin.py            # writes data/twin_friction.csv
"""

from pathlib import Path

import jax
import numpy as np

import fitting
import rubberfric as rf
from rubberfric.io.files import read_scene_file

FOLDER = Path(__file__).parent
NOISE = 0.03  # standard deviation of ln mu
SEED = 3


def conditions():
    """Velocity, pressure and temperature of every point: 2 pressures, 3 temperatures, 40 velocities."""
    run = read_scene_file(FOLDER / "twin_truth.toml").conditions
    grid = np.meshgrid(run.pressure, run.temperature, run.velocity, indexing="ij")
    pressure, temperature, velocity = (axis.ravel() for axis in grid)
    return velocity, pressure, temperature


def twin(seed=SEED, noise=NOISE):
    """The measurements, drawn with a seed."""
    velocity, pressure, temperature = conditions()
    truth = rf.friction(rf.load_scene(FOLDER / "twin_truth.toml"), velocity, pressure, temperature)
    drawn = np.exp(noise * np.random.default_rng(seed).standard_normal(velocity.size))
    return fitting.FrictionData(
        velocity, truth * drawn, pressure=pressure, temperature=temperature, relative=NOISE, name="twin"
    )


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    twin().write(FOLDER / "twin_friction.csv")
