"""Results, spectra and moduli to draw, and checks of pictures."""

import io

import numpy as np

import rubberfric as rf

V = np.array([10.0, -1.0, 1e-3, 0.0, 1e-1])


ROAD = rf.SelfAffine(100.0, 1000.0, 1e5, 0.8, 1e-4)


RUBBER = rf.Prony(1e6, [1e8, 1e7], [1e-6, 1e-2], shift=rf.WLF(8.0, 100.0, 293.15))


MASTER = rf.TabulatedModulus([1e-3, 1.0, 1e2], [1e6, 2e6, 3e6], [1e5, 2e5, 1e5])


def texts(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def drawn(axes):
    """The axes, after all of their figure was drawn; every label says a unit."""
    axes.figure.savefig(io.BytesIO(), format="png")
    for one in axes.figure.axes:
        for axis in (one.xaxis, one.yaxis):
            label = axis.get_label_text()
            assert not label or "[" in label or "/" in label, label
    return axes


def road(q):
    """C of ROAD, from h_rms^2 = 2 pi int q C dq."""
    q0, qr, q1, H, h = 100.0, 1000.0, 1e5, 0.8, 1e-4
    C0 = h**2 / (np.pi * qr**2 * (1 - (q0 / qr) ** 2 + (1 - (q1 / qr) ** (-2 * H)) / H))
    return C0 * np.maximum(q / qr, 1.0) ** (-2 * (1 + H))
