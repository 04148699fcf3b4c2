"""Pictures of scenes and results. They need matplotlib: pip install 'rubberfric[plot]'.

Every function `plot_...` draws into the axes that it is given, or into a new figure of its own that
pyplot does not know, and returns the axes: `plot_friction(result).figure` shows in a notebook.
"""

import importlib.util

from rubberfric._atomic import check_writable, replacing
from rubberfric.plot_accuracy import plot_accuracy
from rubberfric.plot_curves import (
    curve_labels,
    plot_area,
    plot_curve,
    plot_friction,
    plot_result,
    plot_separation,
)
from rubberfric.plot_map import plot_map
from rubberfric.plot_modulus import plot_modulus
from rubberfric.plot_profile import plot_profile
from rubberfric.plot_sensitivity import plot_sensitivity
from rubberfric.plot_spectrum import plot_spectrum
from rubberfric.plot_style import PANELS

__all__ = [
    "PANELS",
    "check_plot",
    "curve_labels",
    "plot_accuracy",
    "plot_area",
    "plot_curve",
    "plot_friction",
    "plot_map",
    "plot_modulus",
    "plot_profile",
    "plot_result",
    "plot_sensitivity",
    "plot_separation",
    "plot_spectrum",
    "save_accuracy_plot",
    "save_plot",
]


def save_plot(path, result):
    """Draw a result to a file, whole or not at all."""
    figure = plot_result(result)[0].figure
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


def save_accuracy_plot(path, accuracy, title=""):
    """Draw a sweep to a file, whole or not at all."""
    ax = plot_accuracy(accuracy)
    ax.set_title(title, fontsize="medium", wrap=True)
    with replacing(path) as temporary:
        ax.figure.savefig(temporary, dpi=150)


def check_plot(path):
    """ValueError unless a plot could be drawn to `path`."""
    check_writable(path, (".png", ".pdf", ".svg"))
    if importlib.util.find_spec("matplotlib") is None:
        raise ValueError("--plot needs matplotlib; install it with: pip install 'rubberfric[plot]'")
