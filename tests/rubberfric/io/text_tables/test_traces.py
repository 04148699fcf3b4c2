"""Traces of profilometers: a column of positions, and one for each trace."""

import numpy as np
import pytest
from support.exports import put
from support.refusals import refused

import rubberfric as rf

TRACES = "Weg [mm];Spur 1 [µm];Spur 2 [nm]\n0,00;-60,2;522\n0,01;-54,3;-520\n"


@pytest.mark.parametrize(
    "text",
    [
        TRACES,
        TRACES.encode("utf-16"),
        "Instrument\tS100\n\nx\ttrace 1\ttrace 2\nmm\tum\tnm\n0\t-60.2\t522\n0.01\t-54.3\t-520\n",
        "# stylus\nx (m),a (m),b (m)\n0,-60.2e-6,522e-9\n1e-5,-54.3e-6,-520e-9\n",
    ],
)
def test_traces_of_a_profilometer(tmp_path, text):
    x, heights = rf.io.read_traces(put(tmp_path, text, "stylus.csv"))
    np.testing.assert_allclose(x, [0, 1e-5], atol=1e-20)
    np.testing.assert_allclose(heights, [[-60.2e-6, -54.3e-6], [522e-9, -520e-9]], rtol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[µm]", "", "column 2 'Spur 1': unit 'Spur 1': must be one of m, cm, mm, um, nm"),
        ("[nm]", "[in]", "column 3 'Spur 2 [in]': unit 'in': must be one of m"),
        ("-54,3", "x", "line 3: '0,01;x;-520': must be numbers"),
        ("-54,3", "inf", "line 3: must be finite"),
        ("-54,3", "nan", "50% of a trace are dropouts: must be at most 25%"),
        (";-520", "", "line 3: has 2 fields: must have 3"),
        ("Weg [mm];Spur 1 [µm];Spur 2 [nm]\n", "", "begins with numbers: must have titles"),
        (TRACES, "a;b\n", "must have rows with a position and at least one height"),
    ],
)
def test_faulty_traces(tmp_path, old, new, message):
    path = put(tmp_path, TRACES.replace(old, new))
    assert message in refused(path, lambda: rf.io.read_traces(path))
