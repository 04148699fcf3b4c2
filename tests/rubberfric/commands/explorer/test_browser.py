"""The page in a real browser, headless: it loads, a slider moves, the curve changes, nothing complains."""

import functools
import threading
import zipfile

import pytest
from support.folders import DATA

from rubberfric.commands.explorer.command import page, routes
from rubberfric.commands.explorer.server import Server

MOVE = """
const range = document.querySelector(`.slider[data-name="${arguments[0]}"] input[type=range]`);
range.value = arguments[1];
range.dispatchEvent(new Event("input"));
"""
LINE = """
const found = document.querySelector(`svg[data-panel=${arguments[0]}] path[data-role=now]`);
return found && found.getAttribute("d");
"""
ANSWERS = "return Number(document.documentElement.dataset.answers || 0)"


@pytest.fixture(scope="module")
def server(explorer_of):
    explorer = explorer_of("twin_truth", DATA / "twin_friction.csv")
    with Server(0, page, routes(explorer)) as server, pytest.MonkeyPatch.context() as patch:
        patch.setattr("rubberfric.commands.explorer.curves.PATIENCE", 60.0)  # no drafts on a busy machine
        server.explorer = explorer
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        explorer.compile()
        yield server
        server.shutdown()


@pytest.fixture
def wait(browser):
    """Until a script of the page returns something."""
    from selenium.webdriver.support.ui import WebDriverWait

    def until(script, *arguments):
        run = functools.partial(browser.execute_script, script, *arguments)
        return WebDriverWait(browser, 60, 0.05).until(lambda _: run())

    return until


@pytest.fixture
def opened(server, browser, wait):
    browser.get(server.url)
    wait(f"{ANSWERS} >= 1")
    return browser


def test_panels_have_names_for_screen_readers(opened):
    script = (
        "return [...document.querySelectorAll('#panels svg')].map((svg) => svg.getAttribute('aria-label'))"
    )
    names = opened.execute_script(script)
    assert names[0] == "friction coefficient μ over velocity v [m/s]"
    assert names[-1].startswith("sensitivity d ln μ") and all(names)


def complaints(browser):
    error = "return document.getElementById('error').textContent"
    return browser.get_log("browser"), browser.execute_script(error)


def test_a_slider_moves_the_curves(opened, wait):
    assert complaints(opened) == ([], "")
    assert opened.title.startswith("Truth behind the twin measurements")
    panels = ("friction", "area", "separation", "moduli", "spectra")
    before = {name: opened.execute_script(LINE, name) for name in panels}
    assert all(line and line.count("L") > 1 for line in before.values())
    measured = "return document.querySelectorAll('path[data-role=measured]').length"
    assert opened.execute_script(measured) == 6
    answers = opened.execute_script(ANSWERS)
    opened.execute_script(MOVE, "lower.spectrum.h_rms", 800)
    wait(f"{ANSWERS} > arguments[0]", answers)
    after = {name: opened.execute_script(LINE, name) for name in panels}
    moved = {name for name in panels if after[name] != before[name]}
    assert moved == set(panels) - {"moduli"}
    start = "return document.querySelector('svg[data-panel=friction] path[data-role=start]') !== null"
    assert opened.execute_script(start)
    opened.execute_script("document.getElementById('reset').click()")
    wait("return document.querySelector('path[data-role=start]') === null")
    assert complaints(opened) == ([], "")


def test_many_moves_are_few_questions(opened, wait):
    """Requests that are outdated when an answer arrives are skipped, except the last."""
    answers = opened.execute_script(ANSWERS)
    opened.execute_script(f"for (let k = 500; k <= 700; k++) {{ (function() {{ {MOVE} }})('gamma', k); }}")
    wait(f"{ANSWERS} > arguments[0] + 1", answers)
    box = "return document.querySelector('.slider[data-name=gamma] input[type=text]').value"
    assert opened.execute_script(box) == "0.7"
    assert opened.execute_script(ANSWERS) - answers < 20
    assert opened.execute_script("return state.busy || state.values.gamma") in (True, 0.7)
    assert complaints(opened) == ([], "")


def test_what_goes_not_together_is_said_and_taken_back(opened, wait):
    error = "return document.getElementById('error').textContent"
    opened.execute_script(MOVE, "lower.spectrum.qr", 900)
    opened.execute_script(MOVE, "lower.spectrum.q1", 0)
    assert "must be >= qr" in wait(error)
    opened.get_log("browser")  # that an answer was 400 stands there
    opened.execute_script("document.getElementById('reset').click()")
    wait("return document.getElementById('error').textContent === ''")
    assert complaints(opened) == ([], "")


@pytest.mark.slow
def test_sensitivities_come_when_they_are_compiled(server, opened, wait):
    # Differences are shown until the derivatives are compiled.
    wait("return Number(document.documentElement.dataset.slopes) >= 5")
    assert opened.execute_script("return document.documentElement.dataset.exact") == "no"
    server.explorer.compile_sensitivities()
    wait("return document.documentElement.dataset.exact === 'yes'")
    bars = "return document.querySelector('svg[data-panel=sensitivities]').textContent"
    before = opened.execute_script(bars)
    assert "sensitivity d ln μ / d ln θ" in before
    click = """
    const plot = document.querySelector("svg[data-panel=friction]"), box = plot.getBoundingClientRect();
    const place = { clientX: box.left + 0.9 * box.width, clientY: box.top + 50 };
    plot.dispatchEvent(new MouseEvent("click", place));
    """
    opened.execute_script(click)
    assert opened.execute_script(bars) != before
    assert complaints(opened) == ([], "")


def test_drafts_while_a_slider_moves_and_curves_when_it_rests(server, opened, wait, monkeypatch):
    """For slow scenes; this one is forced to be slow, and its drafts have small errors."""
    asked, curves = [], server.explorer.curves

    def noted(values, draft=False):
        asked.append(draft)
        found = curves(values)
        off = found["curves"] | {"friction": 1.01 * found["curves"]["friction"]}
        return found | {"curves": off} if draft else found

    monkeypatch.setattr(server.explorer, "curves", noted)
    monkeypatch.setattr(server.explorer, "has_drafts", True)
    opened.execute_script("state.start.drafts = true")
    opened.execute_script(MOVE, "gamma", 600)
    status = "return document.getElementById('status').textContent"
    wait("return document.documentElement.dataset.draft === 'yes'")
    assert asked == [True] and opened.execute_script(status).startswith("off the measured points")
    assert "preview; " in opened.execute_script(status)
    draft = opened.execute_script(LINE, "friction")
    wait("return document.documentElement.dataset.draft === 'no'")
    assert asked == [True, False] and "full accuracy; " in opened.execute_script(status)
    assert opened.execute_script(LINE, "friction") != draft
    assert abs(opened.execute_script("return state.off") - 0.01) < 1e-6
    assert complaints(opened) == ([], "")


def resized(browser, width, height):
    """Give the page a window of this size."""
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)


def test_curves_and_sliders_on_narrow_and_wide_screens(opened):
    rectangles = """
    return [...document.querySelectorAll("#panels figure")].map((one) => {
      const box = one.getBoundingClientRect();
      return [box.left, box.top, box.right, box.bottom];
    })"""
    last = "[...document.querySelectorAll('.slider')].at(-1)"
    try:
        resized(opened, 420, 800)
        opened.execute_script("document.querySelectorAll('details').forEach((one) => { one.open = true; })")
        opened.execute_script(f"{last}.scrollIntoView()")
        left, top, right, bottom = opened.execute_script(rectangles)[0]
        assert 0 <= left < right <= 420 and 0 <= top < bottom <= 500
        box = opened.execute_script(f"return {last}.getBoundingClientRect().bottom")
        assert bottom < box <= 800
        resized(opened, 2560, 1300)
        columns = {round(one[0]) for one in opened.execute_script(rectangles)}
        assert len(columns) == 3
    finally:
        opened.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_sliders_state_their_values_and_axes_return(opened, wait):
    text = "return document.querySelector('.slider[data-name=\"{}\"] input[type=range]').ariaValueText"
    assert opened.execute_script(text.format("lower.spectrum.h_rms")).endswith(" m")
    assert "K (" in opened.execute_script(text.format("temperature"))
    limits, answers = "return panels.friction.limits.high", opened.execute_script(ANSWERS)
    before = opened.execute_script(limits)
    opened.execute_script(MOVE, "lower.spectrum.h_rms", 1000)
    wait(f"{ANSWERS} > arguments[0]", answers)
    assert opened.execute_script(limits) > before
    opened.execute_script("document.getElementById('reset').click()")
    wait("return document.querySelector('path[data-role=start]') === null")
    assert opened.execute_script(limits) == before


def test_a_job_is_downloaded(opened, wait):
    opened.execute_script(MOVE, "gamma", 600)
    opened.execute_script("document.getElementById('fit').click()")
    assert "rubberfric-fit explored/job.toml" in wait("return document.getElementById('note').textContent")
    path = opened.downloads / "explored.zip"
    for _ in range(200):
        if path.exists() and zipfile.is_zipfile(path):
            break
        threading.Event().wait(0.05)
    assert "explored/job.toml" in zipfile.ZipFile(path).namelist()
    assert complaints(opened) == ([], "")
