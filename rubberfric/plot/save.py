"""Pictures to files, whole or not at all."""

import importlib.util

from rubberfric.base.atomic import check_writable, replacing
from rubberfric.plot.accuracy import plot_accuracy
from rubberfric.plot.curves import plot_result


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
