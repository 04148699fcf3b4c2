"""Moduli of torsion whose titles do not say so: the lines above the table tell, or the user is asked."""

import re

import numpy as np
import pytest
from support.exports import put

import fitting

HEAD = ["Filename\ttread.tri", "Operator\tA. B."]
TITLES = "Angular frequency\tStorage modulus\tLoss modulus\tTemperature\nrad/s\tMPa\tMPa\t°C"
OF_SHEAR = [
    "Geometry name\tTorsion rectangular",
    "Geometry\t25 mm parallel plate, Peltier plate",
    "Geometry name: shear sandwich",
    "proceduresegments\tTorsion frequency sweep",
    "Messsystem\tPP25, Platte-Platte",
]
OF_TENSION = ["Geometry name\tTension film/fiber", "Clamp\tDual cantilever", "Test mode\tAxial"]
RHEOMETERS = ["Instrument type\tAresG2", "Instrument name\tDiscovery HR-2", "Instrument\tMCR 302"]
OTHERS = ["Instrument type\tRSA-G2", "Instrument name\tDMA 850"]


def export(folder, *lines):
    return put(folder, "\n".join([*HEAD, *lines, "", "[step]", TITLES, "1\t3\t0.3\t20", "10\t4\t0.5\t20"]))


@pytest.mark.parametrize("line", [*OF_SHEAR, *RHEOMETERS])
def test_a_storage_modulus_of_shear_is_not_read_as_of_tension(tmp_path, line):
    path = export(tmp_path, line)
    message = f"'Storage modulus' may be G', because {' '.join(line.split())!r} is of shear: pass"
    with pytest.raises(ValueError, match=re.escape(message)):
        fitting.read(path)
    data = fitting.read(path, poisson=0.5)
    np.testing.assert_allclose([data.storage, data.loss], [[9e6, 12e6], [0.9e6, 1.5e6]], rtol=1e-14)
    with pytest.raises(ValueError, match=re.escape(message)):
        fitting.read(export(tmp_path, OTHERS[0], line))


@pytest.mark.parametrize(
    "lines", [[], *([line] for line in (*OF_TENSION, *OTHERS)), [RHEOMETERS[0], OF_TENSION[0]]]
)
def test_a_storage_modulus_of_tension(tmp_path, lines):
    np.testing.assert_allclose(fitting.read(export(tmp_path, *lines)).storage, [3e6, 4e6], rtol=1e-14)
