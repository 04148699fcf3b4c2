"""Double precision for every test, a bound on the memory of the run, and no files outside the project."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile

# Threads of OpenBLAS that wait for each other take several times the processor time of one.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
# As the commands do: on some processors every compiled function that is read from a file logs two lines.
os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")

import jax
import pytest

jax.config.update("jax_enable_x64", True)

pytest.register_assert_rewrite("support", "problems")

from support.folders import DATA  # noqa: E402
from support.processes import memory, outside  # noqa: E402

PEAKS = pytest.StashKey[list]()
CACHES = pytest.StashKey[str]()


# Make XLA compile in a third of the time what then runs more slowly.
QUICK = (
    "--xla_backend_optimization_level=0",
    "--xla_cpu_use_fusion_emitters=false",
    "--xla_cpu_parallel_codegen_split_count=1",
)


def pytest_configure(config):
    """Let XLA compile the ordinary run quickly: compilation is most of it.

    Slow sets use the options of users.
    """
    memory.collect_rarely()
    sys.addaudithook(outside.refuse)
    config.stash[PEAKS] = []
    # Commands that are tested find no compiled functions of other runs.
    config.stash[CACHES] = caches = _folder_of_caches(config)
    os.environ["XDG_CACHE_HOME"] = caches
    os.environ.pop("JAX_COMPILATION_CACHE_DIR", None)
    # A script's shell has it ignored in the background, and so would the commands that are tested.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if "not slow" in config.getoption("markexpr") and "XLA_FLAGS" not in os.environ:
        os.environ["XLA_FLAGS"] = " ".join(QUICK if _known(QUICK) else QUICK[:1])
    # Several tests compile the same functions: a quarter of all.
    jax.config.update("jax_compilation_cache_dir", f"{caches}/tests")
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node):
    """Give a worker of pytest-xdist the folder of the run."""
    node.workerinput["caches"] = node.config.stash[CACHES]


def _folder_of_caches(config):
    """Return the folder of compiled functions, which all processes of a run share."""
    if hasattr(config, "workerinput"):
        return config.workerinput["caches"]
    folder = tempfile.TemporaryDirectory(prefix="rubberfric-caches-")
    config.add_cleanup(folder.cleanup)
    return folder.name


def _known(flags):
    """Return True if this version of XLA has the flags; it aborts on unknown flags."""
    environment = os.environ | {"XLA_FLAGS": " ".join(flags), "JAX_PLATFORMS": "cpu"}
    begin = [sys.executable, "-c", "import jax; jax.devices()"]
    return subprocess.run(begin, env=environment, capture_output=True, check=False).returncode == 0


# Files that count compilations drop all compiled functions first, which takes 1 s per 3000 memory maps. They
# begin first, while there are few.
COUNTING = (
    *("test_spectra", "test_cuts", "test_maps", "test_sensitivity", "test_ensemble", "test_joint_fit"),
    *("test_fit_twin", "test_padding"),
)

# Files that take longest follow, so that the workers of a parallel run end together.
LONG = (
    *("test_values", "test_derivatives", "test_limits", "test_transformations_of_calls", "test_scaling"),
    *("test_readme", "test_extremes", "test_boundary_elements_law"),
    *("test_fit_solvers", "test_tabulated_means", "test_accuracy", "test_series", "test_notebooks"),
    *("test_shear", "test_fit_uncertainty", "test_command", "test_constant_area", "test_least_squares"),
    *("test_branches", "test_moments", "test_random_scenes", "test_vertical_shifts", "test_paper"),
    *("test_heated_scenes", "test_identities", "test_anisotropy", "test_softening"),
    *("test_numbers_of_calls", "test_laboratory_commands", "test_grip", "test_leak", "test_means"),
    *("test_single", "test_discrepancy", "test_spectrum_command", "test_browser", "test_plots", "test_types"),
)


def pytest_collection_modifyitems(items):
    """Move the files that count compilations and the longest files to the front."""
    order = {name: i for i, name in enumerate(COUNTING + LONG)}
    items.sort(key=lambda item: order.get(item.path.stem, len(order)))


@pytest.fixture(autouse=True)
def little_memory():
    """Drop compiled functions when they hold much memory."""
    yield
    memory.drop_if_much()


def pytest_sessionfinish(session):
    """Report the largest memory of this process; fail the ordinary run if a process held too much."""
    config = session.config
    if hasattr(config, "workeroutput"):
        config.workeroutput["peak"] = memory.peak()
        return
    peaks = config.stash[PEAKS]
    peaks += [] if peaks else [memory.peak()]
    if "not slow" in config.getoption("markexpr") and max(peaks) > memory.MOST and not session.exitstatus:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Keep the largest memory of a worker of pytest-xdist."""
    node.config.stash[PEAKS].append(getattr(node, "workeroutput", {}).get("peak", 0))


def pytest_terminal_summary(terminalreporter, config):
    """Print the largest memory of each process."""
    if line := memory.line_of(config.stash[PEAKS]):
        terminalreporter.write_line(line)


@pytest.fixture
def job(tmp_path, monkeypatch):
    """A job file of rubberfric-fit, with its scene and data in the working directory."""
    from support.scenes.fits import write_job

    monkeypatch.chdir(tmp_path)
    return write_job(tmp_path)


@pytest.fixture
def in_a_copy(tmp_path, monkeypatch):
    """A working folder with a copy of the data, in which commands may write."""
    shutil.copytree(DATA, tmp_path / "data")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def call_main(capsys):
    """Run a command's `main` in this process: exit status, stdout, stderr."""

    def call(main, *arguments):
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = stop.code
        return status, *capsys.readouterr()

    return call
