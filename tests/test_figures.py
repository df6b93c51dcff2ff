"""Figures show what the tables hold, in one colour per meaning, and say why where there is nothing to show."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_tables
import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.axes import Axes
from matplotlib.cbook import is_math_text
from matplotlib.colors import same_color
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text

from plumbline import tables
from plumbline.figures import _style, clusters, fit, ladder, loci, residuals, signals, trust, where

Tables = dict[str, Any]

DRAW: dict[str, Callable[[Tables], Figure]] = {
    "signals": lambda t: signals.draw(t["signals"], t["pushes"], t["coverage"]),
    "loci": lambda t: loci.draw(t["signals"], t["loci"], t["fit"]),
    "trust": lambda t: trust.draw(**{k: t[k] for k in ("trust", "rls", "signals", "loci", "clusters", "controller")}),
    "clusters": lambda t: clusters.draw(**{k: t[k] for k in ("clusters", "choice", "controller")}),
    "fit": lambda t: fit.draw(t["fit"]),
    "residuals": lambda t: residuals.draw(t["residuals"]),
    "where": lambda t: where.draw(t["where"]),
    "ladder": lambda t: ladder.draw(t["ladder"]),
}


@pytest.fixture(scope="module")
def pushed() -> Tables:
    return made_tables.study(subjects=1, trials=3)


@pytest.fixture(scope="module")
def quiet() -> Tables:
    return made_tables.study(subjects=2, trials=2, pushes=False)


def texts(figure: Figure) -> str:
    return "\n".join(t.get_text() for t in figure.findobj(Text))


@pytest.fixture(scope="module")
def files(pushed: Tables, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("figures")
    return {name: drawn(draw(pushed), folder / f"{name}.svg") for name, draw in DRAW.items()}


def drawn(figure: Figure, path: Path) -> bytes:
    _style.save(figure, path)
    return path.read_bytes()


# -- files ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", DRAW)
def test_file(name: str, files: dict[str, bytes]) -> None:
    """Each figure is a well-formed vector file below 1 MB that carries no date and no address to load from."""
    data = files[name]
    root = ET.fromstring(data)
    assert root.tag.endswith("svg")
    assert len(data) < 1_000_000
    assert b"dc:date" not in data
    assert not [v for e in root.iter() for k, v in e.attrib.items() if k.endswith("href") and not v.startswith(("#", "data:image/png"))]


@pytest.mark.parametrize("name", DRAW)
def test_same_bytes(name: str, pushed: Tables, files: dict[str, bytes], tmp_path: Path) -> None:
    """Drawing the same table twice gives the same bytes."""
    assert drawn(DRAW[name](pushed), tmp_path / "b.svg") == files[name]


def test_style_does_not_depend_on_the_caller(pushed: Tables, files: dict[str, bytes], tmp_path: Path) -> None:
    """Another style in the caller's process changes nothing."""
    from matplotlib import rc_context

    with rc_context({"font.size": 20, "svg.hashsalt": "other", "svg.fonttype": "none"}):
        assert drawn(fit.draw(pushed["fit"]), tmp_path / "b.svg") == files["fit"]


def test_dense_layers_become_pixels(pushed: Tables, files: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Only where the file would be too large do dense lines become pixels; axes and letters stay vectors."""
    monkeypatch.setattr(_style, "MAX_BYTES", 1000)
    mixed = drawn(DRAW["signals"](pushed), tmp_path / "b.svg")
    assert b"<image" not in files["signals"]
    assert b"<image" in mixed
    assert b"xtick" in mixed


def test_figures_beside_tables(pushed: Tables, files: dict[str, bytes], tmp_path: Path) -> None:
    """A figure in a table's folder does not disturb reading the folder as a whole table."""
    tables.write("loci", pushed["loci"], tmp_path / "loci" / "part-0001.parquet")
    (tmp_path / "loci" / "_part-0001.svg").write_bytes(files["loci"])
    assert len(pd.read_parquet(tmp_path / "loci")) == len(pushed["loci"])


# -- nothing to show --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("signals", "no trial of this part could be used"),
        ("loci", "no locus in the 0 trials"),
        ("trust", "no loci in the 0 trials"),
        ("clusters", "no loci, so no controller"),
        ("fit", "both a CoM and a ZMP"),
        ("residuals", "no trial could be left out"),
        ("where", "no trial could be left out"),
        ("ladder", "no held-out error"),
    ],
)
def test_empty_tables(name: str, reason: str, tmp_path: Path) -> None:
    """A study whose every trial was excluded still gets each figure, with the reason in it."""
    figure = DRAW[name]({n: tables.empty(n) for n in tables.TABLES})
    assert reason in texts(figure)
    assert drawn(figure, tmp_path / "a.svg")


def test_quiet_standing(quiet: Tables) -> None:
    """Without pushes the phase portrait and the time since the push say so; the rest is drawn."""
    assert "nobody was pushed" in texts(DRAW["loci"](quiet))
    assert "no loci" in texts(DRAW["where"](quiet))
    assert "no controller" in texts(DRAW["trust"](quiet))
    assert "No push was marked or found" in texts(DRAW["signals"](quiet))
    assert "rms" in texts(DRAW["residuals"](quiet))


def test_forces_only() -> None:
    """Without any CoM the overview draws the forces and says what is absent."""
    made = made_tables.study(trials=1, pushes=False)
    made["signals"][[c for c in made["signals"] if c.startswith("com")]] = np.nan
    made["coverage"] = made["coverage"].assign(com_method="none", limitation="no CoM: forces alone", mass=np.nan)
    said = texts(DRAW["signals"](made_tables.finish(made)))
    assert "no CoM: forces alone" in said
    assert "no height of the CoM" in said
    assert "no vertical force" not in said


def test_without_shear() -> None:
    """A plate without horizontal forces leaves an empty panel that says so."""
    made = made_tables.study(trials=1, pushes=False)
    made["signals"][["grf_x", "grf_y"]] = np.nan
    assert "no horizontal force" in texts(DRAW["signals"](made))


def test_one_trial() -> None:
    """One trial cannot be left out: omega is drawn, errors are explained away by nobody."""
    made = made_tables.study(trials=1)
    assert made["heldout"].empty
    assert "sub-01" in texts(DRAW["fit"](made))
    for name in ("residuals", "where", "ladder"):
        assert "no " in texts(DRAW[name](made))


def test_axis_that_does_not_fall() -> None:
    """Where w2 is not positive the panel says so instead of drawing a frequency."""
    made = made_tables.study(trials=3)
    table = made["fit"].copy()
    table.loc[table["axis"] == "forward", ["omega", "omega_low", "omega_high"]] = np.nan
    assert "not positive" in texts(fit.draw(table))


def test_odd_names(tmp_path: Path) -> None:
    """Dollar signs, underscores and angle brackets in file names start no formula and break no file: they are drawn as they are."""
    odd = "$x_{1$<b>&"
    made = made_tables.study(trials=3, names=odd)
    for name in ("signals", "trust", "residuals"):
        figure = DRAW[name](made)
        said = [t.get_text() for t in figure.findobj(Text) if "x_{1" in t.get_text()]
        assert said
        assert all(odd in s.replace(r"\$", "$") for s in said)
        assert not any(is_math_text(s) for s in said)
        assert ET.fromstring(drawn(figure, tmp_path / f"{name}.svg")).tag.endswith("svg")


# -- what is shown ----------------------------------------------------------------------------------------------------


def test_colours(pushed: Tables) -> None:
    """Measured is black, the model blue, the residual orange."""
    figure = residuals.draw(pushed["residuals"])
    zmp, error, acceleration, rest, com = figure.axes[:5]
    assert "ZMP" in zmp.get_ylabel()
    for axes in (zmp, acceleration, com):
        measured, model = axes.lines[:2]
        assert same_color(measured.get_color(), _style.MEASURED)
        assert same_color(model.get_color(), _style.MODEL)
    for axes in (error, rest):
        assert same_color(axes.lines[0].get_color(), _style.RESIDUAL)


def test_residuals_draw_the_table(pushed: Tables) -> None:
    """The orange line holds the errors of the median trial, in mm, and nothing else."""
    table = pushed["residuals"]
    trial, count = residuals.median_trial(table[(table["axis"] == "lateral") & np.isfinite(table["error"])])
    shown = residuals.draw(table).axes[1].lines[0].get_ydata()
    errors = 1e3 * table.loc[(table["trial"] == trial) & (table["axis"] == "lateral"), "error"].to_numpy()
    assert count == 3
    assert np.isfinite(shown).sum() > 100
    assert set(shown[np.isfinite(shown)]) <= set(errors[np.isfinite(errors)])


def test_median_trial() -> None:
    """Drawn is the trial in the middle, neither the best nor the worst."""
    table = pd.DataFrame({"trial": ["a", "b", "c"], "error": [3.0, 1.0, 2.0]})
    assert residuals.median_trial(table) == ("c", 3)


def test_limits_of_the_phase_portrait(pushed: Tables) -> None:
    """On the blue lines the extrapolated CoM x + x'/w stands over the border of the support."""
    figure = loci.draw(pushed["signals"], pushed["loci"], pushed["fit"])
    w = loci.omega(pushed["fit"])
    blue = [ln for ln in figure.axes[0].lines if same_color(ln.get_color(), _style.MODEL)]
    limits = [np.unique(np.round(ln.get_xdata() + ln.get_ydata() / w, 9)) for ln in blue]
    np.testing.assert_allclose(sorted(v.item() for v in limits), [-0.2, 0.2], atol=1e-6)


def test_phase_portrait_lies_in_the_loci(pushed: Tables) -> None:
    """The measured lines hold positions of the table, counted from the reference, of the frames of their locus."""
    figure = loci.draw(pushed["signals"], pushed["loci"].iloc[:1], pushed["fit"])
    line = max((ln for ln in figure.axes[0].lines if same_color(ln.get_color(), _style.MEASURED)), key=lambda ln: len(ln.get_xdata()))
    first = pushed["loci"].iloc[0]
    frames = pushed["signals"][pushed["signals"]["trial"] == first["trial"]]
    inside = frames[(frames["frame"] >= first["start_frame"]) & (frames["frame"] <= first["end_frame"])]
    assert set(line.get_xdata()) <= set(inside["com_x"] - first["reference"])


def test_kinds_are_told_apart(pushed: Tables) -> None:
    """Each kind of locus is named with its number; the end of a fall is marked."""
    figure = loci.draw(pushed["signals"], pushed["loci"], pushed["fit"])
    assert "recovering (3)" in texts(figure)
    assert "falling (3)" in texts(figure)
    assert sum(ln.get_marker() == "x" for ln in figure.axes[0].lines) == 3


@pytest.mark.parametrize(("name", "most"), [("loci", loci.MOST), ("trust", trust.MOST), ("fit", fit.MOST), ("residuals", residuals.MOST)])
def test_what_is_not_drawn_is_named(name: str, most: int) -> None:
    """A part with more subjects than a page holds names those left out and where their rows are."""
    made = made_tables.study(subjects=most + 1, trials=2)
    said = texts(DRAW[name](made))
    assert f"Not drawn: sub-{most + 1:02d}; their rows are in results/{name}." in said


def test_where_adds_up(pushed: Tables) -> None:
    """Maps from the sums of bins are those of the frames themselves; parts add up to the whole."""
    errors = pushed["residuals"].dropna(subset="error").query("axis == 'lateral'")
    table = pushed["where"][pushed["where"]["axis"] == "lateral"]
    by_trial = where.pooled(table, "trial", ["trial"]).set_index("trial")["rms"]
    direct = np.sqrt((errors["error"] ** 2).groupby(errors["trial"]).mean())
    np.testing.assert_allclose(by_trial.to_numpy(), direct.loc[by_trial.index].to_numpy(), rtol=1e-9)
    twice = where.pooled(pd.concat([table, table]), "phase", ["a", "b"])
    np.testing.assert_allclose(twice["mean"], where.pooled(table, "phase", ["a", "b"])["mean"], rtol=1e-12)


def test_map_places_bins() -> None:
    """A bin stands between its edges; bins with too few frames stay blank and blank borders are cut off."""
    places = {"a": [-0.005, 0.005, 0.025, 0.035], "b": [0.025, 0.025, 0.075, 0.125], "count": [10, 2, 99, 9]}
    bins = pd.DataFrame({**places, "mean": [1e-3, 5.0, -2e-3, 5.0]})
    a, b, z = where.grid(bins, "mean")
    np.testing.assert_allclose(a, [-0.01, 0.0, 0.01, 0.02, 0.03], atol=1e-12)
    np.testing.assert_allclose(b, [0.0, 0.05, 0.1], atol=1e-12)
    np.testing.assert_array_equal(z, [[1.0, np.nan, np.nan, np.nan], [np.nan, np.nan, np.nan, -2.0]])


def test_ladder_of_many_subjects() -> None:
    """More subjects than panels fit share one panel with a dot each; nobody is lost."""
    one = {"ledger": "plant", "axis": "lateral", "task": "all", "condition": "all", "kind": "weak", "model": "base", "effects": ""}
    values = {"ci_low_mm": 0.9, "ci_high_mm": 1.2, "noise_floor_mm": 0.5}
    rows = [{**one, "subject": s, "error_mm": 1.0 + i / 100, **values} for i, s in enumerate(["all", *(f"sub-{k}" for k in range(40))])]
    figure = ladder.draw(pd.DataFrame(rows))
    assert "40 subjects" in texts(figure)
    assert max(len(ln.get_xdata()) for axes in figure.axes for ln in axes.lines) == 40


def test_floor_and_interval(pushed: Tables) -> None:
    """The ladder draws error and interval in orange and the noise floor in black."""
    table = pushed["ladder"]
    row = table[(table["axis"] == "lateral") & (table["kind"] == "weak") & (table["subject"] == "all")].iloc[0]
    lines = ladder.draw(table).axes[0].lines
    black = [ln for ln in lines if same_color(ln.get_color(), _style.MEASURED)]
    orange = [ln for ln in lines if same_color(ln.get_color(), _style.RESIDUAL)]
    assert set(black[0].get_xdata()) == {row["noise_floor_mm"]}
    assert list(orange[0].get_xdata()) == [row["ci_low_mm"], row["ci_high_mm"]]


# -- controller -------------------------------------------------------------------------------------------------------


def blue(axes: Axes) -> list[Line2D]:
    """Lines in the model's colour."""
    return [ln for ln in axes.lines if same_color(ln.get_color(), _style.MODEL)]


def test_law_is_clipped_at_its_limits_alone() -> None:
    """The law drawn is d + k1 (x - d) + k2 x', held at the limits that were ever reached and at no other."""
    row = pd.Series({"reference": 0.01, "k1": 4.0, "k2": 0.5, "limit_left": -0.05, "limit_right": np.nan})
    x, v = np.array([0.01, 0.03, -0.5, 0.5]), np.array([0.0, -0.1, 0.0, 0.0])
    np.testing.assert_allclose(trust.law(x, v, row), [0.01, 0.04, -0.05, 1.97], atol=1e-12)


def test_motion_of_a_parabola() -> None:
    """A parabola's position and velocity are found exactly, up to both ends; a gap leaves NaN where a window meets it."""
    t = np.arange(0, 1, 0.01)
    x, v = trust.motion(0.1 - 0.3 * t + 0.7 * t**2, t)
    np.testing.assert_allclose(x, 0.1 - 0.3 * t + 0.7 * t**2, atol=1e-12)
    np.testing.assert_allclose(v, -0.3 + 1.4 * t, atol=1e-11)
    holed = t.copy()
    holed[50] = np.nan
    assert set(np.flatnonzero(np.isnan(trust.motion(holed, t)[1]))) == set(range(40, 61))
    assert np.isnan(trust.motion(t[:5], t[:5])[0]).all()


def test_trust_draws_the_tables(pushed: Tables) -> None:
    """Measured ZMP and CoM are those of the frames in mm, the blue line is the law, black and blue lines stand at the switches."""
    axes = DRAW["trust"](pushed).axes[0]
    parts = pushed["trust"]
    part = parts[parts["part"] == 2].iloc[1]  # the median of three loci alike
    frames = pushed["signals"][pushed["signals"]["trial"] == part["trial"]]
    assert part["trial"] in axes.get_title(loc="left")
    assert set(axes.lines[0].get_ydata()) <= set(1e3 * frames["zmp_x"])
    assert set(axes.lines[1].get_ydata()) <= set(1e3 * frames["com_x"])
    mine = frames[(frames["time"] >= part["start"] - 0.3 - 1e-9) & (frames["time"] <= part["start"] + 2.0)]
    row = pushed["controller"].iloc[0]
    expected = 1e3 * trust.law(*trust.motion(mine["com_x"].to_numpy(), mine["time"].to_numpy()), row)
    drawn = blue(axes)[0]
    at = np.searchsorted(mine["time"].to_numpy(), drawn.get_xdata()[:100] - 1e-9)
    np.testing.assert_allclose(drawn.get_ydata()[:100], expected[at], atol=1e-9)
    upright = {(round(ln.get_xdata()[0], 6), ln.get_linestyle()) for ln in axes.lines if len(set(ln.get_xdata())) == 1}
    assert upright == {(round(part["found"], 6), "-"), (round(part["rls"], 6), "--")}
    assert "RLS -12 ms" in axes.get_title(loc="left")


def test_wild_estimates_run_off_the_axis(pushed: Tables) -> None:
    """The axis of a pass is centred on the identified value; what is far from it stays in the line, beyond the axis."""
    axes = DRAW["trust"](pushed).axes[1]
    low, high = axes.get_ylim()
    assert (low + high) / 2 == pytest.approx(4.0)
    forward, backward = (next(ln for ln in blue(axes) if ln.get_linestyle() == style and len(ln.get_xdata()) > 2) for style in (":", "-"))
    assert np.isfinite(forward.get_ydata()).all()
    assert forward.get_ydata().min() < low
    assert np.isfinite(backward.get_ydata()).all()


def test_a_person_s_mark_is_drawn_with_its_distance(pushed: Tables) -> None:
    """A locus with a person's mark is preferred; the mark is a dotted line, its distance from the change point in words."""
    table = pushed["trust"].copy()
    last = table.index[(table["part"] == 2)][-1]
    table.loc[last, ["mark", "mark_distance"]] = table.loc[last, "found"] + 0.03, -0.03
    figure = DRAW["trust"]({**pushed, "trust": table})
    assert table.loc[last, "trial"] in figure.axes[0].get_title(loc="left")
    assert "person +30 ms" in figure.axes[0].get_title(loc="left")
    assert "switch by a person" in texts(figure)
    assert "switch by a person" not in texts(DRAW["trust"](pushed))


def test_law_of_the_locus_s_own_cluster(pushed: Tables) -> None:
    """Where loci form clusters a locus is held against its own; where that has no gains, against the law behind most loci."""
    plain = pushed["controller"].iloc[:1]
    few, most = plain.assign(cluster=1, omega=2.5, k1=3.0, loci=3), plain.assign(cluster=2, k1=5.0, loci=9)
    locus = pd.concat([pushed["loci"].iloc[0], pd.Series({"cluster": 1})])
    for rows, k1 in (([most, few], 3.0), ([most, few.assign(k1=np.nan)], 5.0)):
        row, omega = trust.identified(pd.concat(rows), locus)
        assert row is not None
        assert (row["k1"], omega) == (k1, 2.5)
    assert trust.identified(plain.assign(subject="sub-77"), locus)[0] is None


def test_without_gains(pushed: Tables) -> None:
    """A group whose gains cannot be told has its reason in the panel; the regimes are drawn without a law."""
    reason = "2 loci do not fall; 3 are needed"
    none = pushed["controller"].iloc[:1].assign(k1=np.nan, k2=np.nan, warning=reason)
    assert reason in texts(clusters.draw(pushed["clusters"], pushed["choice"], none))
    assert "no gains, so no law" in texts(DRAW["trust"]({**pushed, "controller": none}))
    said = texts(DRAW["trust"]({**pushed, "trust": tables.empty("trust"), "rls": tables.empty("rls")}))
    assert "no gains can be told from the 6 loci" in said


def test_clusters_draw_the_tables(pushed: Tables) -> None:
    """Loci stand at their reach in mm and their omega; the batch omega is a line; loci without one are counted."""
    figure = DRAW["clusters"](pushed)
    known = pushed["clusters"].dropna(subset="omega")
    points = {(round(float(ln.get_xdata()[0]), 9), float(ln.get_ydata()[0])) for ln in figure.axes[0].lines if ln.get_marker() == "o"}
    assert points == set(zip((1e3 * known["reach"]).round(9), known["omega"], strict=True))
    assert "3 loci, 3 without" in figure.axes[0].get_title(loc="left")
    assert "1 chosen" in texts(figure)
    gains = {ln.get_marker(): ln.get_xdata()[0] for ln in figure.axes[2].lines if len(ln.get_xdata()) == 1}
    assert gains == {"o": 4.0, "^": 4.0, "s": 4.0, "x": 3.6}


def test_clusters_are_told_apart(pushed: Tables) -> None:
    """Each cluster has its own mark and shade, and its own omega behind it; a score far below the best is a triangle."""
    members, controller = pushed["clusters"].copy(), pushed["controller"]
    known = members.index[members["cluster"] == 1]
    members.loc[known[0], ["cluster", "omega"]] = 2, 3.6
    own = [controller.assign(cluster=k, omega=w, loci=n) for k, w, n in ((1, 3.0, 9), (2, 3.6, 3))]
    bad = pushed["choice"].assign(score=[-1.6, -80.0])
    figure = clusters.draw(members, bad, pd.concat(own, ignore_index=True))
    marks = {(ln.get_marker(), ln.get_color()) for ln in figure.axes[0].lines if ln.get_marker() in clusters.MARKS}
    assert len(marks) == 2
    levels = {ln.get_ydata()[0] for ln in figure.axes[0].lines if list(ln.get_xdata()) == [0, 1]}
    assert levels == {3.0, 3.6}
    assert "v" in {ln.get_marker() for ln in figure.axes[1].lines}
    assert sum(len(ln.get_xdata()) == 1 for ln in figure.axes[2].lines) == 4 + 1  # every method of the larger, one of the smaller
    assert figure.axes[1].get_ylim()[0] > -3


def test_groups_not_drawn_are_named() -> None:
    """More groups than a page holds: those left out are named."""
    made = made_tables.study(subjects=clusters.MOST + 1, trials=2)
    assert f"Not drawn: sub-{clusters.MOST + 1:02d} lateral; their rows are in results/clusters." in texts(DRAW["clusters"](made))


# -- lines ------------------------------------------------------------------------------------------------------------


@given(st.lists(st.floats(-1e3, 1e3) | st.just(float("nan")), min_size=1, max_size=400), st.integers(1, 40))
def test_thinning_keeps_extremes_and_gaps(values: list[float], bins: int) -> None:
    """A thinned line holds samples of the table only, in order, with the highest and lowest of all, and stays as long as it was."""
    y, time = np.array(values), np.arange(len(values), dtype=float)
    t, v = _style.thin(time, y, bins)
    np.testing.assert_array_equal(v, y[t.astype(int)])
    assert (np.diff(t) > 0).all()
    assert len(v) <= max(2 * bins, 1)
    if np.isfinite(y).any():
        assert (np.nanmin(v), np.nanmax(v)) == (np.nanmin(y), np.nanmax(y))


def test_difference_of_a_sine() -> None:
    """The velocity of a phase portrait is the central difference of the position; beside gaps it is unknown."""
    t = np.arange(0, 4, 0.01)
    x = np.sin(2 * t)
    x[200] = np.nan
    v = _style.difference(x, t)
    step = 0.05
    expected = 2 * np.cos(2 * t) * np.sin(2 * step) / (2 * step)
    good = np.isfinite(v)
    np.testing.assert_allclose(v[good], expected[good], atol=1e-9)
    assert set(np.flatnonzero(~good)) == {*range(5), *range(395, 400), 195, 205}
