"""A real browser, headless, and what the page computes."""

import shutil

import pytest
from support.folders import DATA

from rubberfric.commands.explorer.curves import Explorer, read_points
from rubberfric.io.files import read_computable

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
DRIVER = shutil.which("chromedriver")


@pytest.fixture(scope="session")
def explorer_of():
    """Return the function to the curves of a scene of the data, with measured points of a file."""

    def made(name, points=None):
        scene, conditions, title = read_computable(DATA / f"{name}.toml")
        return Explorer(scene, conditions, title, points and read_points(points, scene, conditions))

    return made


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """Chromium, by selenium; tests are skipped where one of them is missing."""
    for found, package in ((BROWSER, "chromium"), (DRIVER, "chromium-driver")):
        if found is None:
            pytest.skip(f"needs a browser: apt-get install {package}")
    webdriver = pytest.importorskip("selenium.webdriver", reason="needs selenium: pip install selenium")
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    # Root users and containers have no sandbox and little shared memory.
    for flag in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
        options.add_argument(flag)
    options.add_argument("--window-size=1500,900")
    folder = tmp_path_factory.mktemp("downloads")
    options.add_experimental_option("prefs", {"download.default_directory": str(folder)})
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    # With the path given, nothing is looked for on the network.
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.downloads = folder
    yield driver
    driver.quit()
