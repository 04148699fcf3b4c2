"""How long the curves take to follow a slider: at the server, there and back, and in a browser."""

import http.client
import json
import re
import threading
import time

import numpy as np
import pytest
from support.folders import DATA

from rubberfric.commands.explorer.command import page, routes
from rubberfric.commands.explorer.curves import Explorer
from rubberfric.commands.explorer.points import read_points
from rubberfric.commands.explorer.server import Server
from rubberfric.io.files import read_computable

MOVES = 40
SCENES = {
    "tread_on_asphalt": None,
    "sheared_tread_on_asphalt": None,
    "twin_truth": "twin_friction.csv",
    "two_rubbers": None,
    "grooved_road": None,
    "tabulated_tread": None,
    "heated_tread_on_asphalt": None,
    "rubber_seal": None,
}


@pytest.mark.benchmark
@pytest.mark.parametrize("name", SCENES)
def test_round_trip(name):
    scene, conditions, title = read_computable(DATA / f"{name}.toml")
    data = SCENES[name] and read_points(DATA / SCENES[name], scene, conditions)
    explorer = Explorer(scene, conditions, title, data)
    begin = time.perf_counter()
    explorer.compile()
    compiling = time.perf_counter() - begin
    inside, whole = [], []
    with Server(0, page, routes(explorer)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        headers = {"Content-Type": "application/json", "Origin": f"http://{server.hosts[0]}"}
        for part in np.linspace(-0.1, 0.1, MOVES):
            moved = {one.name: one.at(part) for one in explorer.sliders if one.logarithmic and part}
            moved = {
                key: x for key, x in moved.items() if key.endswith(("h_rms", "moduli", "heights", "work"))
            }
            begin = time.perf_counter()
            connection = http.client.HTTPConnection(*server.server_address)
            connection.request("POST", f"/{server.token}/curves", json.dumps(moved), headers)
            answer = connection.getresponse()
            found = json.loads(answer.read())
            whole.append(1e3 * (time.perf_counter() - begin))
            assert found["curves"]["area"]
            inside.append(float(re.search(r"dur=([\d.]+)", answer.headers["Server-Timing"])[1]))
        server.shutdown()
    for what, times in (("server", inside), ("there and back", whole)):
        least, middle = np.min(times), np.median(times)
        print(f"{name:26} {explorer.count:4} points {what:15} {least:7.1f} ms, median {middle:7.1f} ms")
    print(f"{name:26} compiled in {compiling:.1f} s")
