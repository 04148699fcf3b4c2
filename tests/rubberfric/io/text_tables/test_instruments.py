"""Exports in the styles of fifteen instruments and of RepTate.

All files hold E' = 4 and 8 MPa, E'' = 3 and 6 MPa at 1 and 10 Hz and 20 °C, or a third of these moduli in
shear, or E(t) = 6 and 3 MPa at 1 and 2 s.
"""

import json
import math

import numpy as np
import pytest
from support.refusals import refused

import fitting

SHEAR = {"poisson": 0.5}
FILES = {
    "TA TRIOS, shear": (
        "Filename\ttread.tri\nInstrument name\tDiscovery HR-3\n[step]\nFrequency - 1\n"
        "Angular frequency\tStorage modulus\tLoss modulus\tTan(delta)\tComplex viscosity\tTorque\t"
        "Step time\tTemperature\tRaw phase\tDisplacement\tOscillation strain\tOscillation stress\n"
        "rad/s\tPa\tPa\t\tPa.s\tN.m\ts\t°C\trad\trad\t%\tPa\n"
        "6.283185307\t1333333.333\t1e6\t0.75\t265258\t1e-3\t10\t20\t0.6\t1e-4\t0.1\t1666.7\n"
        "62.83185307\t2666666.667\t2e6\t0.75\t53051\t2e-3\t20\t20\t0.6\t1e-4\t0.1\t3333.3\n",
        SHEAR,
    ),
    "TA RSA, Orchestrator": (
        "RSA III\nTest: Frequency Sweep\n"
        "Freq\tE'\tE\"\ttan_delta\tE*\tTemp\tStrain\tTime\n"
        "[Hz]\t[dyn/cm²]\t[dyn/cm²]\t[]\t[dyn/cm²]\t[°C]\t[%]\t[s]\n"
        "1\t4e7\t3e7\t0.75\t5e7\t20\t0.1\t10\n10\t8e7\t6e7\t0.75\t1e8\t20\t0.1\t20\n",
        {},
    ),
    "NETZSCH DMA 242": (
        "#EXPORTTYPE:;DATA ALL\n#INSTRUMENT:;NETZSCH DMA 242 E Artemis\n#DECIMAL:;COMMA\n"
        "##Temp./°C;Time/min;f/Hz;E'/MPa;E''/MPa;tan(d)\n20,0;0,1;1,000;4,0;3,0;0,75\n20,0;0,2;10,000;8,0;6,0;0,75\n",
        {},
    ),
    "Gabo Eplexor": (
        "EPLEXOR 500 N;;;;;;;\n"
        "Nr.;T [°C];f [Hz];dyn. Dehnung [%];stat. Dehnung [%];|E*| [MPa];delta [°];t [s]\n"
        "1;20,0;1,0;0,1;1,0;5,0;36,86989765;10\n2;20,0;10,0;0,1;1,0;10,0;36,86989765;20\n",
        {},
    ),
    "Metravib DMA+": (
        "Fichier;tread.dma\nFréquence (Hz);Température (°C);Module de conservation E' (Pa);"
        "Module de perte E'' (Pa);Tan delta;Déplacement dyn. (m);Force dyn. (N)\n"
        "1;20;4,0e6;3,0e6;0,75;1e-5;2\n10;20;8,0e6;6,0e6;0,75;1e-5;4\n",
        {},
    ),
    "Anton Paar RheoCompass": (
        "Project:\ttread\nInterval data:\tPoint No.\tAngular Frequency\tStorage Modulus\tLoss Modulus\t"
        "Damping Factor\tShear Strain\tShear Stress\tTorque\tTemperature\n"
        "\t\t[rad/s]\t[Pa]\t[Pa]\t[1]\t[%]\t[Pa]\t[mN·m]\t[°C]\n"
        "\t1\t6.283185307\t1333333.333\t1000000\t0.75\t0.1\t1666.7\t1\t20\n"
        "\t2\t62.83185307\t2666666.667\t2000000\t0.75\t0.1\t3333.3\t2\t20\n",
        SHEAR,
    ),
    "Mettler STARe": (
        "Curve Name:\n  !$ tread, DMA1\nCurve Values:\n"
        "  Index        t       Ts        f       M'      M''    Tan Delta\n"
        "              [s]     [°C]     [Hz]    [MPa]    [MPa]        []\n"
        "      0       10     20.0      1.0      4.0      3.0      0.75\n"
        "      1       20     20.0     10.0      8.0      6.0      0.75\n",
        {},
    ),
    "PerkinElmer Pyris": (
        "Filename:\ttread.dmd\nInstrument:\tDMA 8000\n"
        "Time (min)\tSample Temperature (°C)\tFrequency (Hz)\tStorage Modulus (Pa)\t"
        "Loss Modulus (Pa)\tTan Delta\n"
        "0.1\t20\t1\t4.0e6\t3.0e6\t0.75\n0.2\t20\t10\t8.0e6\t6.0e6\t0.75\n",
        {},
    ),
    "Alpha RPA 2000": (
        "Test Name,Frequency sweep\n"
        "Frequency (CPM),Temperature (°C),Strain (%),G' (kPa),G'' (kPa),Tan Delta,S' (dNm)\n"
        "60,20,7,1333.333333,1000,0.75,2.0\n600,20,7,2666.666667,2000,0.75,4.0\n",
        SHEAR,
    ),
    "Bohlin": (
        "Bohlin Instruments - Gemini\nTime,Temperature,Frequency,Phase Angle,Complex Modulus,Elastic Modulus,"
        "Viscous Modulus,Complex Viscosity,Shear Stress,Strain\ns,°C,Hz,°,Pa,Pa,Pa,Pas,Pa,\n"
        "10,20,1,36.87,1666667,1333333.333,1000000,265258,1667,0.001\n"
        "20,20,10,36.87,3333333,2666666.667,2000000,53051,3333,0.001\n",
        SHEAR,
    ),
    "HAAKE RheoWin": (
        "RheoWin Data Manager\nf in Hz;omega in rad/s;T in °C;G' in Pa;G'' in Pa;|G*| in Pa;delta in °;"
        "tan(delta) in -;t in s;t_seg in s\n"
        "1,0;6,283185307;20,0;1333333,333;1000000,0;1666667;36,87;0,75;10;10\n"
        "10,0;62,83185307;20,0;2666666,667;2000000,0;3333333;36,87;0,75;20;20\n",
        SHEAR,
    ),
    "Malvern rSpace": (
        "Action Name,Sequence time(s),Frequency(Hz),Temperature(°C),"
        "Complex shear modulus(Pa),Phase angle(°)\n"
        "Frequency table,10,1,20,1666666.667,36.86989765\nFrequency table,20,10,20,3333333.333,36.86989765\n",
        SHEAR,
    ),
    "Göttfert": (
        "Visco-Elastograph;;;;;\nPrüffrequenz [Hz];Temperatur [°C];Deformation [%];G' [kPa];G\" [kPa];tan δ\n"
        "1,0;20,0;7,0;1333,333333;1000,0;0,75\n10,0;20,0;7,0;2666,666667;2000,0;0,75\n",
        SHEAR,
    ),
    "Hitachi": (
        "Module:\tDMS6100\nTime\tTemp\tFreq\tE'\tE''\ttanD\nmin\tCel\tHz\tPa\tPa\t\n"
        "0.1\t20\t1\t4.0e6\t3.0e6\t0.75\n0.2\t20\t10\t8.0e6\t6.0e6\t0.75\n",
        {},
    ),
}


def put(folder, text):
    (folder / "export.txt").write_text(text, encoding="utf-8")
    return folder / "export.txt"


@pytest.mark.parametrize("instrument", FILES)
def test_sweeps_that_are_read_at_once(tmp_path, instrument):
    text, options = FILES[instrument]
    data = fitting.read(put(tmp_path, text), **options)
    found = [data.omega / (2 * math.pi), data.storage / 1e6, data.loss / 1e6, data.temperature - 273.15]
    np.testing.assert_allclose(found, [[1, 10], [4, 8], [3, 6], [20, 20]], rtol=1e-6)


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


RELAXATIONS = {
    "TA TRIOS": ("Step time\tRelaxation modulus\tTemperature\ns\tPa\t°C\n1\t2e6\t20\n2\t1e6\t20\n", SHEAR),
    "Anton Paar RheoCompass": (
        "Interval data:\tPoint No.\tInterval Time\tRelaxation Modulus\tShear Strain\n\t\t[s]\t[Pa]\t[%]\n"
        "\t1\t1\t2000000\t1\n\t2\t2\t1000000\t1\n",
        SHEAR,
    ),
    "Instron": (
        "Time (s),Extension (mm),Load (N),Tensile stress (MPa),Tensile strain (%)\n"
        "1,5,60,0.6,10\n2,5,30,0.3,10\n",
        {"kind": "relaxation"},
    ),
    "TA TRIOS, stress and strain": (
        "[step]\nStress relaxation - 1\nTime\tStep time\tStress\tStrain\tTemperature\ns\ts\tPa\t%\t°C\n"
        "101\t1\t20000\t1\t20\n102\t2\t10000\t1\t20\n",
        SHEAR | {"kind": "relaxation"},
    ),
    "Malvern rSpace": (
        "Action Name;Time (sequence)(s);Time (action)(s);Shear stress(Pa);Shear strain(%);Temperature(°C)\n"
        "Relaxation;101,0;1,000;20000;1,0;20,0\nRelaxation;102,0;2,000;10000;1,0;20,0\n",
        SHEAR | {"kind": "relaxation"},
    ),
    "HAAKE RheoWin, French": ("t en s;t_seg en s;G(t) en Pa\n11;1;2000000\n12;2;1000000\n", SHEAR),
    "HAAKE RheoWin": ("t in s;t_seg in s;G(t) in Pa\n11;1;2000000\n12;2;1000000\n", SHEAR),
}


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


@pytest.mark.parametrize("instrument", RELAXATIONS)
def test_relaxation_that_is_read_at_once(tmp_path, instrument):
    text, options = RELAXATIONS[instrument]
    data = fitting.read(put(tmp_path, text), **options)
    np.testing.assert_allclose([data.time, data.modulus], [[1, 2], [6e6, 3e6]], rtol=1e-9)


@pytest.mark.parametrize("column", ["Torque", "Complex viscosity", "Oscillation shear strain"])
def test_a_storage_modulus_beside_a_quantity_of_shear(tmp_path, column):
    """E' would be a third of the modulus."""
    path = tmp_path / "sweep.txt"
    rows = (
        f"Frequency\tStorage modulus\tLoss modulus\t{column}\nHz\tPa\tPa\t\n1\t2e6\t1e6\t1\n10\t3e6\t2e6\t1\n"
    )
    path.write_text(rows)
    with pytest.raises(ValueError, match=r"'Storage modulus' may be G'.* pass poisson=0.5") as error:
        fitting.read(path)
    assert "\n" not in str(error.value) and repr(column) in str(error.value)
    np.testing.assert_allclose(fitting.read(path, poisson=0.5).storage, [6e6, 9e6])
    named = ["f [Hz]", "E_stor [Pa]", "E_loss [Pa]", "-"]
    np.testing.assert_allclose(fitting.read(path, columns=named).storage, [2e6, 3e6])
    path.write_text(rows.replace("Storage modulus", "E'").replace("Loss modulus", 'E"'))
    np.testing.assert_allclose(fitting.read(path).storage, [2e6, 3e6])
