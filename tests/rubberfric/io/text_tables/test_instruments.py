"""Exports in the styles of fifteen instruments and of RepTate, from tests/reference/exports."""

import json

import numpy as np
import pytest
from support.exports import put
from support.folders import REFERENCE
from support.refusals import refused

import fitting

EXPORTS = REFERENCE / "exports"
SHEAR = {"poisson": 0.5}


def names(folder):
    return sorted(f"{folder}/{path.name}" for path in (EXPORTS / folder).iterdir())


def holds(name, options, expected):
    """Assert f [Hz], E' [MPa], E'' [MPa] and T [°C], in the order of temperatures and frequencies."""
    data = fitting.read(EXPORTS / name, **options)
    order = np.lexsort((data.omega, data.temperature))
    found = [data.omega / (2 * np.pi), data.storage / 1e6, data.loss / 1e6, data.temperature - 273.15]
    np.testing.assert_allclose(np.array(found)[:, order], expected, rtol=1e-6)


@pytest.mark.parametrize("name", names("tension") + names("shear"))
def test_sweeps_that_are_read_at_once(name):
    """The moduli of the files in `shear` are a third."""
    options = SHEAR if name.startswith("shear") else {}
    holds(name, options, [[1, 10], [4, 8], [3, 6], [20, 20]])


@pytest.mark.parametrize("name", names("steps"))
def test_steps_at_several_temperatures(name):
    options = SHEAR if "rheocompass" in name else {}
    holds(name, options, [[1, 10, 1, 10], [4, 8, 2.5, 5], [3, 6, 1, 2.25], [20, 20, 40.5, 40.5]])


def test_sweep_with_the_columns_of_the_message(tmp_path):
    """Instron WaveMatrix states amplitudes and a phase, and no modulus, so the names must be given."""
    path = put(
        tmp_path,
        "Cycle,Frequency (Hz),Peak-peak stress (MPa),Strain amplitude (%),Phase (deg),Temp (°C)\n"
        "1,1,0.01,0.1,36.86989765,20\n2,10,0.02,0.1,36.86989765,20\n",
    )
    columns = json.loads(refused(path, lambda: fitting.read(path)).rpartition("columns=")[2])
    assert columns == ["?", "f [Hz]", "?", "strain [%]", "delta [deg]", "T [°C]"]
    path = put(tmp_path, path.read_text().replace("0.01,", "0.005,").replace("0.02,", "0.01,"))
    given = ["-", "f [Hz]", "E_stress [MPa]", "strain [%]", "delta [deg]", "T [°C]"]
    data = fitting.read(path, columns=given, kind="modulus")
    np.testing.assert_allclose([data.storage, data.loss], [[4e6, 8e6], [3e6, 6e6]], rtol=1e-6)


# Options of `read` for E(t) = 6 and 3 MPa at 1 and 2 s.
RELAXATIONS = {
    "ta_trios": SHEAR,
    "anton_paar_rheocompass": SHEAR,
    "haake_rheowin": SHEAR,
    "haake_rheowin_french": SHEAR,
    # Stresses and strains
    "instron": {"kind": "relaxation"},
    "ta_trios_stress": SHEAR | {"kind": "relaxation"},
    "malvern_rspace_stress": SHEAR | {"kind": "relaxation"},
}


@pytest.mark.parametrize("name", RELAXATIONS)
def test_relaxation_that_is_read_at_once(name):
    data = fitting.read(EXPORTS / "relaxation" / f"{name}.txt", **RELAXATIONS[name])
    np.testing.assert_allclose([data.time, data.modulus], [[1, 2], [6e6, 3e6]], rtol=1e-9)


REPTATE_SWEEP = """T=20;Mw=94.9;chem=PI;label=PI88k;PDI=1.03;
Freq\t    G'\t        G"\t        Temp\t    Strain
rad/s\t    Pa\t        Pa\t        °C\t        %\t
100       3.4801E5    70871       20.0     0.96734
68.129    3.328E5     70723       20.0     0.96362
"""
REPTATE_CREEP = """stress=10;chem=PE;label=CM3;T=150;
t\t    strain\t    stress\tT
s\t    -\t        Pa\t    C
1\t1.5E-5\t10\t    149.9
10\t3E-5\t10\t    149.9
"""


def test_files_of_reptate(tmp_path):
    """The examples of its manual: frequencies in rad/s, and creep as strain and stress in shear."""
    data = fitting.read(put(tmp_path, REPTATE_SWEEP), poisson=0.5)
    np.testing.assert_allclose([data.omega, data.storage], [[100, 68.129], [3 * 3.4801e5, 3 * 3.328e5]])
    data = fitting.read(put(tmp_path, REPTATE_CREEP), poisson=0.5, kind="creep")
    np.testing.assert_allclose([data.time, data.compliance], [[1, 10], [5e-7, 1e-6]], rtol=1e-12)


def test_a_frequency_in_rad_per_second_is_angular(tmp_path):
    data = fitting.read(put(tmp_path, "Frequency [rad/s];E' [MPa];E'' [MPa]\n2;4;3\n"))
    np.testing.assert_allclose(data.omega, [2.0])
    path = put(tmp_path, "Angular frequency [Hz];E' [MPa];E'' [MPa]\n2;4;3\n")
    assert "unit 'Hz': must be one of rad/s" in refused(path, lambda: fitting.read(path))


@pytest.mark.parametrize("column", ["Torque", "Complex viscosity", "Oscillation shear strain"])
def test_a_storage_modulus_beside_a_quantity_of_shear(tmp_path, column):
    """E' would be a third of the modulus."""
    titles = f"Frequency\tStorage modulus\tLoss modulus\t{column}\n"
    rows = "Hz\tPa\tPa\t\n1\t2e6\t1e6\t1\n10\t3e6\t2e6\t1\n"
    path = put(tmp_path, titles + rows)
    with pytest.raises(ValueError, match=r"'Storage modulus' may be G'.* pass poisson=0.5") as error:
        fitting.read(path)
    assert "\n" not in str(error.value) and repr(column) in str(error.value)
    np.testing.assert_allclose(fitting.read(path, poisson=0.5).storage, [6e6, 9e6])
    named = ["f [Hz]", "E_stor [Pa]", "E_loss [Pa]", "-"]
    np.testing.assert_allclose(fitting.read(path, columns=named).storage, [2e6, 3e6])
    path = put(tmp_path, titles.replace("Storage modulus", "E'").replace("Loss modulus", 'E"') + rows)
    np.testing.assert_allclose(fitting.read(path).storage, [2e6, 3e6])
