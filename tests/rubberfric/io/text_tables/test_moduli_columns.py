"""Moduli from compliances, amplitudes and shear, in three languages, with a frequency above the table."""

import math

import numpy as np
import pytest
from support.exports import put
from support.refusals import refused

import fitting
import rubberfric as rf
from rubberfric.io import stated_frequency

HZ = 2 * math.pi  # [rad/s]
ANGLE = math.degrees(math.atan2(3, 4))  # of E' = 4 MPa and E'' = 3 MPa
SHEAR = {"poisson": 0.5}


@pytest.mark.parametrize(
    ("titles", "row", "options"),
    [
        # D* = 1 / E* = (4 - 3 i) / 25 per MPa
        ("f [Hz],D' [1/MPa],D'' [1/MPa]", "1,0.16,0.12", {}),
        ("f [Hz],D' [1/Pa],tan delta", "1,1.6e-7,0.75", {}),
        ("f [Hz],|D*| [1/GPa],delta [deg]", f"1,200,{ANGLE!r}", {}),
        ("f [Hz];Speicherkomplianz [mm²/N];Verlustkomplianz [mm²/N]", "1;0,16;0,12", {}),
        ("f [Hz];Speichernachgiebigkeit in MPa⁻¹;Verlustfaktor", "1;0,16;0,75", {}),
        ("f [Hz];complaisance de conservation [1/MPa];complaisance de perte [1/MPa]", "1;0,16;0,12", {}),
        # J* = 1 / G* = 3 D*
        ("f [Hz],J' [1/MPa],J'' [1/MPa]", "1,0.48,0.36", SHEAR),
        (
            "f [Hz],Storage compliance (J') [cm²/dyn],Loss compliance (J'') [cm²/dyn]",
            "1,4.8e-8,3.6e-8",
            SHEAR,
        ),
        ("f [Hz],Storage compliance [1/MPa],Loss compliance [1/MPa]", "1,0.48,0.36", SHEAR),
        ("f [Hz],J* [1/MPa],Phase angle [rad]", f"1,0.6,{math.radians(ANGLE)!r}", SHEAR),
        ("f [Hz];|E*| [MPa];tan delta", "1;5;0.75", {}),
        ("f,E_stor,tan_del\nHz,MPa,-", "1,4,0.75", {}),
        ("f [Hz],|E*| [MPa],delta [rad]", f"1,5,{math.radians(ANGLE)!r}", {}),
        ("f [Hz],|G*| [MPa],delta [deg]", f"1,{5 / 3!r},{ANGLE!r}", SHEAR),
        ("f [Hz],E' [MPa],delta [deg]", f"1,4,{ANGLE!r}", {}),
        ("f [Hz],E'' [MPa],tan delta", "1,3,0.75", {"kind": "modulus"}),
        # phase angles that are not needed
        ("f [Hz],E' [MPa],E'' [MPa],delta [deg]", "1,4,3,-2", {}),
        ("f [Hz],E' [MPa],E'' [MPa],|E*| [MPa],delta [deg]", "1,4,3,n/a,n/a", {}),
        # moduli in other languages
        ("Frequenz [Hz];Komplexer Schubmodul [MPa];Phasenwinkel [°]", f"1;{5 / 3!r};{ANGLE!r}", SHEAR),
        ("Frequenz [Hz];Schubspeichermodul [MPa];Schubverlustmodul [MPa]", f"1;{4 / 3!r};1", SHEAR),
        ("fréquence [Hz];module complexe de cisaillement [MPa];facteur de perte", f"1;{5 / 3!r};0.75", SHEAR),
        ("fréquence [Hz];module dynamique [MPa];angle de perte [°]", f"1;5;{ANGLE!r}", {}),
        # amplitudes of 0.1 %
        (
            "f [Hz],stress amplitude [kPa],strain amplitude [%],delta [deg]",
            f"1,5,0.1,{ANGLE!r}",
            {"kind": "modulus"},
        ),
        (
            "f [Hz];Schubspannung [Pa];Scherung [%];Phasenwinkel [°]",
            f"1;{5e3 / 3!r};0.1;{ANGLE!r}",
            {"kind": "modulus"} | SHEAR,
        ),
    ],
)
def test_moduli_of_other_quantities(tmp_path, titles, row, options):
    data = fitting.read(put(tmp_path, f"{titles}\n{row}\n"), **options)
    np.testing.assert_allclose([*data.omega, *data.storage, *data.loss], [HZ, 4e6, 3e6], rtol=1e-13)


def test_shear_compliances_need_the_poisson_ratio(tmp_path):
    path = put(tmp_path, "f [Hz],J' [1/MPa],J'' [1/MPa]\n1,0.48,0.36\n")
    message = refused(path, lambda: fitting.read(path))
    assert "J_stor, J_loss are of shear: poisson must be given" in message


@pytest.mark.parametrize(
    ("line", "hertz"),
    [
        ("Frequency: 10 Hz", 10.0),
        ("Frequenz [Hz];10,5", 10.5),
        ("Frequenz;10;Hz", 10.0),
        ('"Frequency","10","Hz"', 10.0),
        ("#FREQ.:\t10 Hz", 10.0),
        ("#IDENTITY:\t2\t1\n#FREQ.:\t10 Hz", 10.0),
        ("Fréquence = 5 Hz", 5.0),
        ("Temperature ramp at 1.5 Hz, 0.1 %", 1.5),
        ("Temperaturrampe (10,0 Hz)", 10.0),
        ("Angular frequency: 10 rad/s", 10 / HZ),
        ("Frequency: 10 Hz\nramp at 10 Hz", 10.0),
        ("Frequency: 10 Hz\nramp at 1 Hz", None),
        ("Frequency: 1, 10 Hz", None),
        ("Frequency range: 1 to 100 Hz", None),
        ("Sampling rate: 100 Hz", None),
        ("Speed: 10 rpm", None),
    ],
)
def test_frequency_above_a_temperature_ramp(tmp_path, line, hertz):
    ramp = "T [°C];E' [MPa];E'' [MPa]\n20;4;3\n30;2;1\n"
    path = put(tmp_path, f"{line}\n{ramp}")
    omega = stated_frequency(path)
    if hertz is None:
        assert omega is None
        assert "or give frequency=... [Hz]" in refused(path, lambda: fitting.read(path))
        data = fitting.read(path, frequency=3.0)
        np.testing.assert_allclose(data.omega, [3 * HZ] * 2)
        return
    assert omega == pytest.approx(hertz * HZ, rel=1e-12)
    data = fitting.read(path)
    np.testing.assert_allclose(data.omega, [hertz * HZ] * 2, rtol=1e-12)
    np.testing.assert_allclose([data.storage, data.temperature], [[4e6, 2e6], [293.15, 303.15]])
    np.testing.assert_allclose(fitting.read(path, frequency=3.0).omega, [3 * HZ] * 2)


def test_scene_and_job_files_say_columns_too(tmp_path):
    put(tmp_path, "-3 6.5 5.4\n-2 6.6 5.5\n", "master.dat")
    put(tmp_path, "f,G_stor,G_loss\nHz,MPa,MPa\n1,2,0.5\n10,3,0.7\n", "shear.csv")
    titles = '["log10_f [log10(Hz)]", "log10_E_stor [log10(Pa)]", "log10_E_loss [log10(Pa)]"]'
    scene = put(
        tmp_path,
        f'lower.material = {{kind = "tabulated", file = "master.dat", columns = {titles}}}\n'
        'upper.material = {kind = "tabulated", file = "shear.csv", poisson = 0.25}\n',
        "scene.toml",
    )
    found = rf.load_scene(scene)
    np.testing.assert_allclose(found.lower.material.storage, 10 ** np.array([6.5, 6.6]), rtol=1e-14)
    np.testing.assert_allclose(found.upper.material.storage, [5e6, 7.5e6], rtol=1e-14)
    scene.write_text(scene.read_text().replace(", poisson = 0.25", ""))
    assert "poisson must be given" in refused(tmp_path / "shear.csv", lambda: rf.load_scene(scene))
