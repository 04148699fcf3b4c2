"""Exports in the styles of DMA, rheometers and tribometers, for one rubber and one friction curve.

Each function writes a file and returns its path. Numbers are rounded as instruments do.
"""

import numpy as np
import pytest

F = np.array([0.1, 1.0, 10.0])  # Hz
T = np.array([-20.0, 0.0, 25.0])  # °C
V = np.array([0.5, 5.0, 50.0])  # mm/s
P = np.array([0.2, 0.4])  # MPa


def storage(f, T):
    """E' [MPa]."""
    return np.round(8 * f**0.1 * np.exp(-0.01 * T), 4)


def loss(f, T):
    """E'' [MPa]."""
    return np.round(0.9 * f**0.15 * np.exp(-0.02 * T), 4)


def mu(v, p):
    """Friction coefficient at a velocity [mm/s] and a pressure [MPa]."""
    return np.round(0.6 * v**0.1 * p**-0.1, 4)


def sweep(scale=1.0):
    """Return rows (f, E', E'', T) over all frequencies of one temperature after the other."""
    return [(f, scale * storage(f, at), scale * loss(f, at), at) for at in T for f in F]


def german(text):
    return text.replace(".", ",")


def trios(folder):
    """TA Instruments TRIOS: text with tabs, a preamble, and a step for each temperature."""
    lines = ["Filename\ttread.tri", "Instrument serial number\t4010-0420", "Operator\tA. B.", ""]
    for at in T:
        lines += ["[step]", f"Frequency sweep at {at} °C", "Number of points\t3"]
        lines += [
            "Angular frequency\tStorage modulus\tLoss modulus\tTan(delta)\tFrequency\tTemperature\tStep time"
        ]
        lines += ["rad/s\tMPa\tMPa\t\tHz\t°C\ts"]
        for f in F:
            E, E2 = storage(f, at), loss(f, at)
            lines += [f"{2 * np.pi * f:.9g}\t{E}\t{E2}\t{E2 / E:.5f}\t{f}\t{at}\t12.5"]
    return put(folder, ("\r\n".join(lines) + "\n").encode("utf-16"), "trios.txt")


def trios_workbook(folder):
    """TRIOS: a workbook with details and a sheet for each step."""
    head = ["Oscillation frequency", "Storage modulus", "Loss modulus", "Tan(delta)", "Temperature"]
    units = ["Hz", "Pa", "Pa", None, "°C"]
    sheets = {"Details": [["Sample", "tread"], ["Length", 17.5, "mm"], ["Width", 6.1, "mm"]]}
    for at in T:
        rows = [[f, 1e6 * storage(f, at), 1e6 * loss(f, at), 0.1, at] for f in F]
        sheets[f"Frequency {at}"] = [[f"Frequency sweep - {at}"], head, units, *rows]
    return book(folder, "trios.xlsx", sheets)


def rheocompass(folder):
    """Anton Paar RheoCompass: tabs, units in brackets below, an empty first column, and shear moduli."""
    lines = ["Project:\ttread", "Test:\tFrequency sweep"]
    for number, at in enumerate(T, start=1):
        lines += ["", f"Result:\tInterval {number}", f"Interval and data points:\t{number}\t{F.size}"]
        titles = (
            "Point No.\tAngular Frequency\tStorage Modulus\tLoss Modulus\tLoss Factor\tTemperature\tStatus"
        )
        lines += [f"Interval data:\t{titles}", "\t\t\t\t\t\t\t", "\t\t[rad/s]\t[Pa]\t[Pa]\t[1]\t[°C]\t"]
        for k, f in enumerate(F, start=1):
            G, G2 = 1e6 * storage(f, at) / 3, 1e6 * loss(f, at) / 3
            lines += [f"\t{k}\t{2 * np.pi * f:.9g}\t{G:.9g}\t{G2:.9g}\t{G2 / G:.4f}\t{at}\tDSO"]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-16"), "rheocompass.csv")


def rheoplus(folder):
    """Anton Paar in German: semicolons, decimal commas, the logarithm of the frequency."""
    lines = ["Messung:;Laufflaeche", "lg(f/Hz);Speichermodul in MPa;Verlustmodul in MPa;Temperatur in °C"]
    lines += [german(f"{np.log10(f)};{E};{E2};{at}") for f, E, E2, at in sweep()]
    return put(folder, ("\n".join(lines) + "\n").encode("latin-1"), "rheoplus.csv")


def proteus(folder):
    """Netzsch Proteus: header lines with #, titles with ##, and a block of columns for each frequency."""
    lines = ["#EXPORTTYPE:\tDATA ALL", "#INSTRUMENT:\tNETZSCH DMA 242E", "#SAMPLE:\ttread"]
    lines += [
        "##Temp./°C;" + ";".join(f"E'({f:.3f} Hz)/MPa;E''({f:.3f} Hz)/MPa;tan d({f:.3f} Hz)" for f in F)
    ]
    for at in T:
        cells = [(storage(f, at), loss(f, at), np.round(loss(f, at) / storage(f, at), 5)) for f in F]
        lines += [f"{at};" + ";".join(str(x) for cell in cells for x in cell)]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-8"), "proteus.csv")


def eplexor(folder):
    """Gabo Eplexor in German: many columns, absolute modulus, an E'' with a double quote."""
    titles = (
        "Nr.;Zeit [s];Temperatur [°C];Frequenz [Hz];Stat. Dehnung [%];|E*| [MPa];E' [MPa];E\" [MPa];tan d [-]"
    )
    lines = ["Eplexor 500 N;;;;;;;;", titles]
    for k, (f, E, E2, at) in enumerate(sweep(), start=1):
        lines += [german(f"{k};{10 * k};{at};{f};1.0;{np.hypot(E, E2):.4f};{E};{E2};{E2 / E:.5f}")]
    return put(folder, ("\n".join(lines) + "\n").encode("latin-1"), "eplexor.csv")


def stare(folder):
    """Mettler Toledo STARe: columns of a fixed width, units in brackets below, sample temperature Ts."""
    lines = ["Curve Name:", "  !$ tread", "Curve Values:"]
    lines += ["  Index           f          Ts          M'         M''   tan delta"]
    lines += ["               [Hz]        [°C]       [MPa]       [MPa]          []"]
    for k, (f, E, E2, at) in enumerate(sweep()):
        lines += [f"{k:7d}{f:12.4f}{at:12.2f}{E:12.4f}{E2:12.4f}{E2 / E:12.5f}"]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-8"), "stare.txt")


def rspace(folder):
    """Malvern rSpace: commas, long titles, shear moduli."""
    titles = "Action Name,Frequency (Hz),Temperature (°C),Complex shear modulus (Pa)"
    titles += ",Shear modulus (elastic component) (Pa),Shear modulus (viscous component) (Pa),Phase angle (°)"
    lines = [titles]
    for f, E, E2, at in sweep(1e6 / 3):
        numbers = f"{np.hypot(E, E2):.9g},{E:.9g},{E2:.9g},{np.degrees(np.arctan(E2 / E)):.4f}"
        lines += [f"Frequency table,{f},{at},{numbers}"]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-8"), "rspace.csv")


def american(folder):
    """A DMA in American units: °F and psi, titles without brackets."""
    lines = ["Freq Hz,Temp °F,E' psi,E'' psi"]
    lines += [
        f"{f},{at * 1.8 + 32:.4f},{E / 6.894757293168361e-3:.9g},{E2 / 6.894757293168361e-3:.9g}"
        for f, E, E2, at in sweep()
    ]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-8"), "american.csv")


def wide_workbook(folder):
    """A spreadsheet of a laboratory: one block for each temperature below merged cells."""
    above = [cell for at in T for cell in (f"T = {at} °C", None, None)]
    rows = [[x for at in T for x in (f, storage(f, at), loss(f, at))] for f in F]
    return book(folder, "wide.xlsx", {"DMA": [["Tread"], above, ["f/Hz", "E'/MPa", "E''/MPa"] * 3, *rows]})


def linear_tester(folder):
    """A linear friction tester in German: a column of the friction coefficient for each pressure."""
    lines = [
        "Gleitgeschwindigkeit [mm/s];" + ";".join(german(f"Reibwert bei {p} MPa") for p in P) + ";Bemerkung"
    ]
    lines += [german(f"{v};" + ";".join(str(mu(v, p)) for p in P) + ";") for v in V]
    return put(folder, ("\n".join(lines) + "\n").encode("latin-1"), "linear.csv")


def wheel_tester(folder):
    """A LAT 100 wheel tester: no sliding velocity under a known title, so the titles must be given."""
    lines = ["LAT 100", "Track;v slip;Load;p;Coeff", ";mm/s;N;MPa;"]
    lines += [
        f"{k};{v};75;{p};{mu(v, p)}" for k, (p, v) in enumerate(((p, v) for p in P for v in V), start=1)
    ]
    return put(folder, ("\n".join(lines) + "\n").encode("utf-8"), "wheel.csv")


def put(folder, text, name="table.csv"):
    """Write text or bytes to a file; the path."""
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def book(folder, name, sheets):
    """Write a workbook: rows by the title of their sheet; the path."""
    openpyxl = pytest.importorskip("openpyxl", reason="writes .xlsx")
    whole = openpyxl.Workbook()
    whole.remove(whole.active)
    for title, rows in sheets.items():
        sheet = whole.create_sheet(title)
        for row in rows:
            sheet.append(row)
    whole.save(folder / name)
    return folder / name
