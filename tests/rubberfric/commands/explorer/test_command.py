"""The command `rubberfric explore`: arguments, output and exit."""

import re

import pytest
from support.folders import DATA

from rubberfric.commands.explorer import command as explore
from rubberfric.commands.explorer.command import page

SCENE = DATA / "twin_truth.toml"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "the following arguments are required: SCENE"),
        (("no.toml",), "no.toml: cannot be read: No such file"),
        ((SCENE, "--port", "80"), "--port 80: must be 1024 ... 65535, or 0 for any free port"),
        ((SCENE, "--port", "65536"), "--port 65536: must be 1024 ... 65535"),
        ((SCENE, "--port", "x"), "invalid int value: 'x'"),
        ((SCENE, "--data", "no.csv"), "no.csv: cannot be read: No such file"),
        ((SCENE, "--data", SCENE), "suffix '.toml': must be .csv or .txt or .tsv"),
        ((SCENE, "--host", "0.0.0.0"), "unrecognized arguments: --host 0.0.0.0"),
    ],
)
def test_bad_arguments_without_jax(refused, monkeypatch, arguments, message):
    monkeypatch.setattr("rubberfric.commands.ending.begin_jax", None)
    assert message in refused("explore", *arguments)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("v,mu\nm/s,-\n0,0.5\n1,0.5\n", "v = 0.0: must be > 0 on a logarithmic axis"),
        ("v,mu,T\nm/s,-,K\n1,0.5,100\n2,0.5,300\n", "temperature[0] = 100.0: must be > 143.15 K"),
        ("v,mu,T\nm/s,-,K\n1,0.5,900\n2,0.5,1200\n", "must be 100 ... 1000 K"),
        ("v,nu\nm/s,-\n1,0.5\n2,0.5\n", "column 'nu'"),
        ("v,mu\nm/s,-\n" + "1,0.5\n" * 2001, "has 2001 points: must have at most 2000"),
    ],
)
def test_bad_points(refused, tmp_path, text, message):
    path = tmp_path / "points.csv"
    path.write_text(text)
    complaint = refused("explore", SCENE, "--data", path, "--no-browser")
    assert message in complaint and str(path) in complaint


def test_points_over_velocity_and_curves_over_pressure(refused):
    arguments = DATA / "rubber_seal.toml", "--data", DATA / "twin_friction.csv", "--no-browser"
    message = "[run] of the scene has no velocity range: give it two velocities > 0"
    assert message in refused("explore", *arguments)


def test_a_port_that_is_taken_and_the_browser_that_is_opened(call, monkeypatch):
    opened, served = [], []
    monkeypatch.setattr(explore.webbrowser, "open", opened.append)
    monkeypatch.setattr(explore.Explorer, "compile", lambda _: None)
    monkeypatch.setattr(explore.Explorer, "compile_sensitivities", lambda _: None)
    monkeypatch.setattr(explore.Server, "serve_forever", lambda server: served.append(server))
    status, printed, complaint = call("explore", SCENE)
    assert (status, complaint) == (0, "") and len(served) == 1
    url = printed.splitlines()[0]
    port = served[0].server_port
    assert url == f"http://127.0.0.1:{port}/{served[0].token}/" and opened[0].startswith(url[:18])
    assert served[0].token not in opened[0]
    with explore.Server(0, page, {}) as other:
        taken = call("explore", SCENE, "--port", other.server_port)
    assert taken[0] == 1 and f"--port {other.server_port}: Address already in use" in taken[2]


def test_the_page_needs_nothing_else():
    text = page("N0nce")
    assert text.count('nonce="N0nce"') == 2 and "{{" not in text
    assert len(re.findall(r"<(?:script|style)\b", text)) == 2
    # The only address is a namespace.
    assert set(re.findall(r"https?://[^\s\"'`]*", text)) == {"http://www.w3.org/2000/svg"}
    for word in ("@import", "src=", "url(h", "innerHTML", "eval(", "document.write", "onclick="):
        assert word not in text, word
