"""The report in a real browser without a network: it draws, asks nobody, and complains about nothing."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path

import made_report
import made_tables
import numpy as np
import pytest
from matplotlib import image

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
OFFLINE = "--host-resolver-rules=MAP * ~NOTFOUND"
PROBE = """<script>
window.addEventListener("load", function () { setTimeout(function () {
  var sources = 0, plots = 0;
  Bokeh.documents.forEach(function (d) { d._all_models.forEach(function (m) {
    sources += m.type === "ColumnDataSource"; plots += m.type === "Figure"; }); });
  var canvases = 0;
  (function walk(n) { n.querySelectorAll("*").forEach(function (e) {
    canvases += e.tagName === "CANVAS" && e.width > 100; if (e.shadowRoot) { walk(e.shadowRoot); } }); })(document);
  var asked = performance.getEntriesByType("resource").filter(function (r) { return !/^(data|blob|file):/.test(r.name); });
  var pictures = Array.from(document.images).every(function (i) { return i.complete && i.naturalWidth > 0; });
  document.title = ["PROBE", sources, plots, canvases > 0, asked.length, pictures,
    document.documentElement.scrollWidth <= window.innerWidth].join(" ");
}, 1500); });
</script></body>"""

BRUSH = """<script>
window.addEventListener("load", function () { setTimeout(function () {
  function find(root, name) { var out = []; (function walk(n) { n.querySelectorAll("*").forEach(function (e) {
    if (e.classList.contains(name)) { out.push(e); } if (e.shadowRoot) { walk(e.shadowRoot); } }); })(root); return out; }
  function painted() { return find(document, "bk-Canvas").map(function (c) {
    return Array.from((c.shadowRoot || c).querySelectorAll("canvas")).map(function (e) { return e.toDataURL(); }).join(); }); }
  var choice = document.querySelector("details.views select");
  choice.value = "after0"; choice.dispatchEvent(new Event("change"));
  setTimeout(function () {
    var before = painted(), layer = find(document.getElementById("linked-lateral-phase"), "bk-events")[0];
    layer.scrollIntoView({block: "center"});
    var box = layer.getBoundingClientRect();
    function send(type, at) { layer.dispatchEvent(new PointerEvent(type, {bubbles: true, composed: true, cancelable: true, pointerId: 1,
      pointerType: "mouse", isPrimary: true, button: type === "pointermove" ? -1 : 0, buttons: type === "pointerup" ? 0 : 1,
      clientX: box.left + at * box.width, clientY: box.top + at * box.height})); }
    send("pointerdown", 0.3); for (var i = 1; i <= 10; i++) { send("pointermove", 0.3 + 0.03 * i); } send("pointerup", 0.6);
    setTimeout(function () {
      var loaded = performance.getEntriesByType("resource");
      var said = {asked: loaded.filter(function (r) { return !/^(data|blob|file):/.test(r.name); }).length};
      var after = painted();
      said.changed = after.map(function (picture, i) { return picture !== before[i]; });
      said.coloured = [];
      Bokeh.documents[0]._all_models.forEach(function (m) {
        if (m.type === "ColumnDataSource") { said.selected = Array.from(m.selected.indices); said.samples = m.get_length();
          said.columns = Array.from(m.data.keys ? m.data.keys() : Object.keys(m.data)); }
        if (m.name === "coloured") { said.coloured.push(m.glyph.fill_color.field); }
      });
      document.title = "PROBE" + JSON.stringify(said);
    }, 1000);
  }, 800);
}, 1500); });
</script></body>"""


@pytest.fixture(scope="module")
def browser() -> str:
    found = next((path for b in BROWSERS if (path := shutil.which(b))), None)
    if not found:
        pytest.skip(f"no browser ({', '.join(BROWSERS)}) on PATH: install chromium to run this test")
    return found


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = made_report.criticised(made_tables.study(trials=3))
    results = made_report.drawn(made, tmp_path_factory.mktemp("study") / "results")
    text = made_report.page(made, results)
    (results / "brush.html").write_text(text.replace("</body>", BRUSH), encoding="utf-8")
    file = results / "report.html"
    file.write_text(text.replace("</body>", PROBE), encoding="utf-8")
    return file


def run(browser: str, file: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    usual = ("--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--enable-logging=stderr", "--virtual-time-budget=10000")
    command = [browser, *usual, OFFLINE, f"--user-data-dir={file.parent / 'profile'}", *arguments, file.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize("width", [1280, 800])
def test_draws_alone(browser: str, page: Path, width: int) -> None:
    """The linked views and every picture are drawn with all hosts blocked, nothing is asked for, and nothing sticks out sideways."""
    done = run(browser, page, f"--window-size={width},1000", "--dump-dom")
    probe = re.search(r"<title>PROBE ([^<]*)</title>", done.stdout)
    assert probe, done.stderr[-2000:]
    assert probe.group(1) == "1 9 true 0 true true"


def test_brush(browser: str, page: Path) -> None:
    """A box drawn in the phase plane lights its samples in every view, each rung's error and each effect among them; asks nobody."""
    done = run(browser, page.with_name("brush.html"), "--window-size=1280,1000", "--dump-dom")
    probe = re.search(r"<title>PROBE(.*?)</title>", done.stdout)
    assert probe, done.stderr[-2000:]
    said = json.loads(html.unescape(probe.group(1)))
    assert 0.02 < len(said["selected"]) / said["samples"] < 0.6
    assert {"error", "after0", "effect0", "effect1", "row", "within"} <= set(said["columns"])
    assert said["changed"] == [True] * 9
    assert said["coloured"] == ["after0", "after0"]
    assert said["asked"] == 0
    assert page.stat().st_size < 20e6


def test_no_complaint(browser: str, page: Path) -> None:
    """The console holds no error: no script fails, nothing was refused by the page's own rules."""
    done = run(browser, page, "--window-size=1280,1000", "--dump-dom")
    lines = [ln for ln in done.stderr.splitlines() if "CONSOLE" in ln and "setting log level" not in ln]
    assert not lines


def test_screenshot(browser: str, page: Path, tmp_path: Path) -> None:
    """The page is not blank: it holds dark letters on white and the residual's orange."""
    shot = tmp_path / "page.png"
    run(browser, page, "--window-size=1280,2400", f"--screenshot={shot}")
    pixels = image.imread(shot)[..., :3]
    assert pixels.shape[:2] == (2400, 1280)
    assert 0.5 < np.mean(pixels.min(axis=2) > 0.95) < 0.995
    assert np.mean(pixels.max(axis=2) < 0.3) > 0.003
    assert ((pixels[..., 0] > 0.65) & (pixels[..., 1] < 0.5) & (pixels[..., 2] < 0.15)).sum() > 500
