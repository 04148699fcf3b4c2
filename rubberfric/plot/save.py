"""Pictures to files, whole or not at all."""

from collections.abc import Sequence

import numpy as np

from rubberfric.analysis.error_and_time.report import Accuracy
from rubberfric.base.atomic import StrPath, replacing
from rubberfric.io.results import Result
from rubberfric.plot.accuracy import plot_accuracy
from rubberfric.plot.curves import plot_result
from rubberfric.plot.map import figure_of_map
from rubberfric.plot.style import Axes, FigureBase, Panels


def save_figure(path: StrPath, figure: FigureBase | Axes | Panels) -> None:
    """Write a figure to a file, whole or not at all; of axes, or a sequence of them, that they are in."""
    if isinstance(figure, Sequence | np.ndarray):
        figure = figure[0]
    figure = getattr(figure, "figure", None) or figure  # of axes; that of a figure is itself
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)  # pyright: ignore[reportAttributeAccessIssue]: of no SubFigure


def save_plot(path: StrPath, result: Result) -> None:
    """Draw a result to a file."""
    save_figure(path, plot_result(result)[0].figure)


def save_map_plot(path: StrPath, result: Result) -> None:
    """Draw all quantities of a map to a file, a row of panels for each."""
    save_figure(path, figure_of_map(result))


def save_accuracy_plot(path: StrPath, accuracy: Accuracy, title: str = "") -> None:
    """Draw a sweep to a file."""
    ax = plot_accuracy(accuracy)
    ax.set_title(title, fontsize="medium", wrap=True)
    save_figure(path, ax.figure)
