"""Solids and roughness of the cases with references, as dictionaries: plain data."""

RIGID = {"kind": "rigid"}
SOFT = {"kind": "prony", "E_inf": 8.0e5, "E": [2.5e7, 4.0e6, 3.0e5], "tau": [3e-7, 2e-4, 0.7], "nu": 0.48}
HARD = {"kind": "prony", "E_inf": 3.6e6, "E": [1.4e8, 6.5e6], "tau": [1e-8, 1e-5], "nu": 0.5}
ROAD = {"q0": 100.0, "qr": 1000.0, "q1": 3.1e4, "H": 0.8, "h_rms": 5e-4}
TREAD = {"q0": 300.0, "qr": 2000.0, "q1": 4.0e5, "H": 0.7, "h_rms": 4e-5}
WORN = {"q0": 300.0, "qr": 2000.0, "q1": 1e5, "H": 0.7, "h_rms": 4e-5}
MEASURED_ROAD = {
    "q": [60.0, 150.0, 420.0, 2.0e3, 9.0e3, 7.0e4, 8.0e5],
    "C": [4.0e-13, 9.0e-13, 7.0e-13, 1.2e-14, 7.0e-17, 5.0e-20, 2.0e-24],
}
WLF = {"kind": "wlf", "C1": 8.86, "C2": 101.6, "T_ref": 293.15}
ARRHENIUS = {"kind": "arrhenius", "energy": 0.97, "T_ref": 293.15}
