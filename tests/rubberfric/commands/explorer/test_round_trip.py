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
    "silicone_on_glass": None,
}
# A slider is moved, and when the page has drawn the answer and a frame is due, the time is taken.
FOLLOW = """
const [name, part, done] = arguments, page = document.documentElement;
const range = document.querySelector(`.slider[data-name="${name}"] input[type=range]`);
const watch = new MutationObserver(() => {
  watch.disconnect();
  const begin = state.moved;
  requestAnimationFrame(() => done([performance.now() - begin, page.dataset.draft]));
});
watch.observe(page, { attributes: true, attributeFilter: ["data-answers"] });
range.value = part;
range.dispatchEvent(new Event("input"));
"""


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


@pytest.mark.benchmark
@pytest.mark.parametrize("name", SCENES)
def test_from_slider_to_curve_in_the_browser(name, browser):
    """Waiting time of a user; the aim is 50 ms."""
    from selenium.webdriver.support.ui import WebDriverWait

    scene, conditions, title = read_computable(DATA / f"{name}.toml")
    data = SCENES[name] and read_points(DATA / SCENES[name], scene, conditions)
    explorer = Explorer(scene, conditions, title, data)
    explorer.compile()
    with Server(0, page, routes(explorer)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser.get(server.url)
        ready = "return document.documentElement.dataset.answers >= 1 && !state.busy"
        WebDriverWait(browser, 60, 0.05).until(lambda _: browser.execute_script(ready))
        slider = next(one.name for one in explorer.sliders if one.name.endswith(("h_rms", "heights")))
        times, drafts = [], 0
        for part in np.linspace(450, 550, MOVES).round().astype(int).tolist():
            time.sleep(0.02)
            spent, draft = browser.execute_async_script(FOLLOW, slider, part)
            times.append(spent)
            drafts += draft == "yes"
        status = browser.execute_script("return document.getElementById('status').textContent")
        if drafts:
            at_rest = "return document.documentElement.dataset.draft === 'no'"
            WebDriverWait(browser, 60, 0.05).until(lambda _: browser.execute_script(at_rest))
            off = browser.execute_script("return state.off")
            status = f"draft {100 * (off or 0):.2g} % off"
        server.shutdown()
    what = f"{drafts} drafts, {status}" if drafts else "all nodes"
    print(f"{name:26} browser: least {np.min(times):6.1f} ms, median {np.median(times):6.1f} ms ({what})")
