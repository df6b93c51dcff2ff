"""The report is one page that stands alone, says what was done and found, and loses nothing in silence."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import made_report
import made_tables
import numpy as np
import pandas as pd
import pytest
from bokeh.plotting import figure

from plumbline import report, tables
from plumbline.report import controller, linked, methods, sheets, words

Tables = dict[str, Any]
SECTIONS = ("result", "read", "excluded", "loci", "omega", "controller", "figures", "explore", "ladder", "methods", "reading")


@pytest.fixture(scope="module")
def made() -> Tables:
    return made_tables.study(subjects=2, trials=3)


@pytest.fixture(scope="module")
def results(made: Tables, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_report.drawn(made, tmp_path_factory.mktemp("results"))


@pytest.fixture(scope="module")
def page(made: Tables, results: Path) -> str:
    return made_report.page(made, results)


@pytest.fixture(scope="module")
def nothing() -> Tables:
    """A study whose every file was refused."""
    out: Tables = made_tables.study(subjects=0, trials=0)
    said = {"file": "sub-01/a.c3d", "reason": "no_plates", "message": "a.c3d has no force plate", "hint": "add its .mot"}
    out["exclusions"] = pd.DataFrame([said])
    return out


class Reader(HTMLParser):
    """Collects text, ids and addresses; checks that tags close in order."""

    VOID = ("meta", "link", "img", "br")

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.words: list[str] = []
        self.tags: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.ids += [v for k, v in attrs if k == "id" and v]
        self.addresses += [v for k, v in attrs if k in ("src", "href", "srcset", "data", "action") and v]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("script", "style"):
            self.words.append(data)


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    reader.close()
    assert not reader.open
    assert len(reader.ids) == len(set(reader.ids))
    return reader


def said(html: str) -> str:
    return " ".join(" ".join(read(html).words).split())


# -- the page stands alone --------------------------------------------------------------------------------------------


def test_loads_nothing(page: str) -> None:
    """Every address in the page is a place in it, data inside it, or a file beside it; none is on a network."""
    addresses = read(page).addresses
    assert sum(a.startswith("data:image/svg+xml;base64,") for a in addresses) == 8
    assert all(a.startswith(("#", "data:")) or re.fullmatch(r"[a-z_/0-9-]+\.svg", a) for a in addresses)
    assert not re.search(r"""(src|href)\s*=\s*["']?\s*(https?:)?//""", page)
    assert "@import" not in page


def test_forbids_loading(page: str) -> None:
    """The page itself forbids the browser to fetch anything."""
    assert "default-src 'none'" in page


def test_size(page: str, nothing: Tables) -> None:
    """A study of six trials makes a page below 5 MB; one without results carries no plotting script."""
    assert len(page.encode()) < 5_000_000
    assert len(made_report.page(nothing).encode()) < 100_000


def test_same_bytes(made: Tables, results: Path, page: str) -> None:
    """The same results give the same bytes, whatever was plotted in this process before."""
    figure().scatter([1], [2])
    assert made_report.page(made, results) == page


def test_sections(page: str) -> None:
    """Every part of the report is there, in its order."""
    assert [i for i in read(page).ids if i in SECTIONS] == list(SECTIONS)


def test_names_are_text(tmp_path: Path) -> None:
    """Markup in the names of files and studies is shown, never obeyed."""
    evil = "</script><script>alert(1)</script><img src=x onerror=alert(2)>"
    made = made_tables.study(trials=3, names=evil)
    made["exclusions"] = pd.DataFrame([{"file": evil, "reason": "unreadable", "message": evil, "hint": evil}])
    made["trials"] = made["trials"].assign(notes=json.dumps([evil]), axes_from=evil)
    html = made_report.page(made, study=evil)
    reader = read(html)
    assert reader.tags.count("script") == 3
    assert "img" not in reader.tags
    assert evil in "".join(reader.words)


# -- what it says -----------------------------------------------------------------------------------------------------


def test_first_screen(made: Tables, page: str) -> None:
    """The first screen states error, interval, floor and half width, and that nothing was judged to be missing."""
    row = words.pooled(made["ladder"], "lateral", "weak")
    text = said(page).split("What was read")[1]
    error, low, high, floor = (words.number(row[k]) for k in ("error_mm", "ci_low_mm", "ci_high_mm", "noise_floor_mm"))
    assert f"misses the measured ZMP by {error} mm rms (95 % interval {low} to {high} mm)" in text
    assert f"Sensor noise alone would give {floor} mm" in text
    assert "Not judged" in text
    assert "half width 0.4 s" in text


def test_what_was_read(page: str) -> None:
    """Rates, axes and from what, force sign, mass, CoM, marker set, distance to the lab's CoM and notes stand in the page."""
    text = said(page)
    for word in (
        "100",
        "1000",
        "x=+X y=+Y z=+Z",
        "from gravity and feet",
        "turned",
        "70.0",
        "plug-in-gait",
        "12.0",
        "plate 2: offset of 3 N",
    ):
        assert word in text


def test_exclusions(nothing: Tables) -> None:
    """A study whose every file was refused names each with reason, message and hint, and says why there is no error."""
    text = said(made_report.page(nothing))
    for word in (
        "sub-01/a.c3d",
        "no_plates",
        "a.c3d has no force plate",
        "add its .mot",
        "No trial could be used.",
        "no trial could be used",
    ):
        assert word in text
    assert "nothing to explore" in text


def test_every_file_used(page: str) -> None:
    """Where nothing was excluded the page says so."""
    assert "Every file was used." in said(page)


def test_counts_of_pushes_and_loci(made: Tables) -> None:
    """Pushes and loci are counted by kind and source, and the counts add up."""
    sheet = sheets.all_sheets(made)["loci"]
    assert [list(r) for r in sheet.rows] == [
        ["lateral", "falling", "right", "event", "6"],
        ["lateral", "recovering", "left", "event", "6"],
    ]
    assert sheets.all_sheets(made)["pushes"].rows[0][-1] == "12"


def test_omega_table(made: Tables) -> None:
    """Every subject and axis has its omega with interval; the text to copy holds the same rows in SI."""
    sheet = sheets.all_sheets(made)["fit"]
    assert [(r[0], r[1]) for r in sheet.rows] == [(s, a) for s in ("sub-01", "sub-02") for a in ("lateral", "forward")]
    low, value, high = (float(sheet.rows[0][k]) for k in (4, 3, 5))
    assert low < value < high
    copied = sheet.copy.splitlines()
    assert len(copied) == 5
    assert copied[0].split("\t")[3:6] == ["omega", "omega_low", "omega_high"]


def test_long_tables_say_what_they_leave_out() -> None:
    """A table shows its first rows and says how many there are and where; none is dropped in silence."""
    many = pd.DataFrame([{"file": f"{k}.c3d", "reason": "truncated", "message": "", "hint": ""} for k in range(1234)])
    sheet = sheets.exclusions(many)
    assert len(sheet.rows) == sheets.MOST
    assert "1\u202f234 rows" in sheet.note
    assert "results/exclusions.parquet" in sheet.note


def test_cohort_links_what_it_does_not_hold(made: Tables, results: Path) -> None:
    """Of many parts the first few have their figures in the page; those of the others are linked, each of them."""
    parts = [f"part-{k:04d}" for k in range(1, 7)]
    for stage in report.STAGES:
        for part in parts[1:]:
            (results / stage / f"_{part}.svg").write_bytes((results / stage / "_part-0001.svg").read_bytes())
    pictures = report.pictures(results, parts, made_report.CAPTIONS, made_tables.CONFIG)
    html = report.page("cohort", made, made["verdict"], made_tables.CONFIG, pictures)
    addresses = read(html).addresses
    assert sum(a.startswith("data:image/svg") for a in addresses) == 2 + len(report.STAGES) * report.INLINE_PARTS
    assert all(f"{stage}/_{part}.svg" in addresses for stage in report.STAGES for part in parts)


def test_captions_carry_parameters(results: Path) -> None:
    """Captions are filled from the config, as Snakemake's own report fills them."""
    config = {**made_tables.CONFIG, "evaluation": {**made_tables.CONFIG["evaluation"], "half_width": 0.31}}
    pictures = report.pictures(results, ["part-0001"], made_report.CAPTIONS, config)
    captions = {p.stage: p.caption for p in pictures}
    assert "0.31 s" in captions["residuals"]
    assert not any("{{" in c or "{%" in c for c in captions.values())


# -- controller -------------------------------------------------------------------------------------------------------


def law(**changes: Any) -> pd.Series:
    """A row of `controller`, changed."""
    row = {"k1": 4.0, "k2": 0.9, "omega": 3.0, "error": 1.2e-3, "warning": ""}
    return pd.Series({**row, "q1_real": 1.35, "q1_imag": 1.0, "q2_real": 1.35, "q2_imag": -1.0, **changes})


def test_controller_section(made: Tables, page: str) -> None:
    """Omega, gains, limits with intervals, the delay in words, loci used and left out with the reason: each stands in the page."""
    text = said(page).replace("\u00a0", " ")
    for word in (
        "4.000 3.900 to 4.100", "0.900 0.870 to 0.930", "-100.00 -100.10 to -99.90", "2.00 1.50 to 2.50", "no delay found at most 21 ms",
        "1 cluster in sub-01 lateral, sub-02 lateral", "6 switches between a limit and the law in 12 loci", "saw 6 of them, half of these "
        "within 12 ms; no person marked any", "3: falls: its ZMP only shows the limit", "least squares: the counter-example",
    ):  # fmt: skip
        assert word in text
    made_sections = controller.section(made)
    assert [r[0] for r in made_sections.law.rows] == ["sub-01", "sub-02"]
    assert len(made_sections.methods.rows) == 8
    assert made_sections.methods.copy.splitlines()[0].split("\t") == list(made["controller"])


def test_no_loci_no_controller(nothing: Tables) -> None:
    """Without loci the section is one plain sentence, and the methods claim no law."""
    text = said(made_report.page(nothing))
    assert "No loci, so no controller" in text
    assert "counter-example" not in text
    assert "output error" not in " ".join(methods.paragraphs(nothing, nothing["verdict"], made_tables.CONFIG))
    assert not any("Ljung" in source for source in methods.references(nothing))


@pytest.mark.parametrize(
    ("late", "warning", "words_"),
    [
        ({"delay": 0.0, "delay_low": 0.0, "delay_high": 0.0173}, "", "no delay found\nat most 17 ms"),
        ({"delay": 0.02, "delay_low": 0.0, "delay_high": 0.0403}, "", "no delay found\nat most 40 ms"),
        ({"delay": 0.08, "delay_low": 0.071, "delay_high": 0.089}, "a delay of 80 ms lowers the error", "80 ms\n71 to 89 ms"),
        ({"delay": 0.068, "delay_low": 0.037, "delay_high": 0.099}, "", "not shown: 68 ms, 37 to 99 ms, but the error stays 1.19 mm (1.20"),
        ({"delay": 0.05, "delay_low": np.nan, "delay_high": np.nan}, "", "50 ms, no interval"),
        ({"delay": np.nan, "delay_low": np.nan, "delay_high": np.nan}, "", "not fitted"),
        ({"delay": 0.05, "delay_low": 0.04, "delay_high": 0.06, "warning": "the search did not settle"}, "", "not told: the search"),
    ],
)
def test_delay_in_words(late: dict[str, Any], warning: str, words_: str) -> None:
    """An interval that holds nought is no delay; one that does not must also lower the error before a delay is claimed."""
    assert controller.delay(law(warning=warning), law(**{"error": 1.19e-3, **late})).startswith(words_)
    assert controller.delay(law(), None) == "not fitted"


@pytest.mark.parametrize(
    ("q1", "q2", "words_"),
    [
        (1.35 + 1.0j, 1.35 - 1.0j, "swings at 0.48 Hz damping 0.80"),
        (-0.1 + 1.0j, -0.1 - 1.0j, "swings, and ever wider"),
        (2.0, 0.5, "does not swing time constants 0.17 and 0.67 s"),
        (2.0, -0.5, "does not return"),
        (complex("nan"), complex("nan"), "\u2013"),
    ],
)
def test_poles_in_words(q1: complex, q2: complex, words_: str) -> None:
    """Complex poles -omega q swing at omega Im(q) / 2 pi, real ones have the time constants 1 / (omega q)."""
    q1, q2 = complex(q1), complex(q2)
    row = law(q1_real=q1.real, q1_imag=q1.imag, q2_real=q2.real, q2_imag=q2.imag)
    assert " ".join(controller.loop(row).split()) == words_


def test_intervals_in_words() -> None:
    """A limit that no locus reached is said to be so; an interval that is not known is no interval; without gains there is a dash."""
    row = law(limit_left=np.nan, limit_left_low=np.nan, limit_left_high=np.nan, k1_low=np.nan, k1_high=np.nan)
    assert controller.estimate(row, "limit_left", 2, 1e3) == "never reached"
    assert controller.estimate(row, "k1", 3) == "4.000\nno interval"
    none = law(k1=np.nan, k1_low=np.nan, k1_high=np.nan, limit_left=np.nan, limit_left_low=np.nan, limit_left_high=np.nan)
    assert {controller.estimate(none, "limit_left", 2), controller.estimate(none, "k1", 3)} == {"\u2013"}


def test_gains_that_cannot_be_told(made: Tables) -> None:
    """Where too few loci remain the table has dashes, no locus counts as used, the reason stands beside it, and methods claim nothing."""
    reason = "2 loci do not fall and have an unbroken CoM and ZMP; 3 are needed"
    empty = {k: np.nan for k in made["controller"] if k.startswith(("k1", "k2", "limit", "reference", "q1", "q2", "feedback", "delay"))}
    few = made["controller"][made["controller"]["method"] == "output error"].assign(warning=reason, **empty)
    section = controller.section({**made, "controller": few, "trust": tables.empty("trust")})
    assert "No regimes" in section.sentences[1]
    assert list(section.law.rows[0][3:6]) == ["3.000\n2.950\u00a0to\u00a03.050", "\u2013", "\u2013"]
    assert section.law.rows[0][-1] == reason
    assert section.bounds.rows[0][-2] == "0"
    assert section.methods.empty
    assert "could not be told" in " ".join(methods.paragraphs({**made, "controller": few}, made["verdict"], made_tables.CONFIG))


def test_loci_left_out(made: Tables) -> None:
    """Loci left out of the gains are counted with their reasons; those used in part keep theirs; a missing reason is said to be."""
    members = made["clusters"].copy()
    members.loc[members.index[0], "note"] = "its end is cut"
    members.loc[members.index[1], "note"] = ""
    out = controller.section({**made, "clusters": members}).bounds.rows[0][-1]
    assert out.text == "3 loci"
    assert out.more == ("2: falls: its ZMP only shows the limit", "1: no reason given", "1 used in part: its end is cut")


def test_clusters_and_marks_in_words(made: Tables) -> None:
    """Groups are counted by their number of clusters; clusters have rows of their own; distances to a person's marks are stated."""
    choice = made["choice"].copy()
    choice.loc[choice["subject"] == "sub-02", "chosen"] = [False, True]
    members = made["clusters"]
    assert "1 cluster in sub-01 lateral; 2 clusters in sub-02 lateral" in controller.numbers(choice, members)
    assert "In 2 groups there were too few loci" in controller.numbers(choice[choice["number"] == 1], members)
    assert "in no cluster" not in controller.numbers(choice, members)
    members = members.assign(cluster=members["cluster"].where(members["omega"].isna() | (members["reach"] < 0.1), 2))
    assert "in no cluster and in no gains: 3 loci" in controller.numbers(choice, members)
    both = [made["controller"].assign(cluster=k) for k in (1, 2)]
    section = controller.section({**made, "controller": pd.concat(both, ignore_index=True), "clusters": members})
    assert [r[2] for r in section.law.rows if r[0] == "sub-01"] == ["cluster 1 of 2", "cluster 2 of 2"]
    assert "sub-01 lateral, cluster 1: k1" in controller.results(pd.concat(both).iloc[:1])[0]
    assert controller.results(pd.concat([*both, *both]))[0].endswith("over 8 groups of loci")
    marked = made["trust"].assign(mark=made["trust"]["found"] + 0.02, mark_distance=-0.02)
    assert "a person marked 6, half of these within 20 ms" in controller.switches(marked)
    assert "marked override" in " ".join(methods.paragraphs({**made, "trust": marked}, made["verdict"], made_tables.CONFIG))


# -- methods ----------------------------------------------------------------------------------------------------------


def test_methods(made: Tables) -> None:
    """The paragraph names the filter's corner, the test function, the folds, the numbers found, versions and sources."""
    text = " ".join(methods.paragraphs(made, made["verdict"], made_tables.CONFIG))
    for word in ("-3 dB at 2 Hz after both passes", "(1 - s\u00b2)^4", "half width 0.4 s", "eight folds", "numpy", "plumbline", "12 mm"):
        assert word in text
    assert words.number(made["verdict"]["plant"]["base_error_mm"]) in text
    for word in (
        "output error (Ljung 1999",
        "returns from its end",
        "6 of 12 loci were used",
        "k1 4.000 (3.900 to 4.100)",
        "-100.0 mm and 90.0 mm",
    ):
        assert word in text
    sources = " ".join(methods.references(made))
    assert "Murai" in sources
    assert "de Leva" in sources
    assert "Ljung" in sources
    assert "Zatsiorsky VM (1997)" not in sources  # no CoM came from forces here


@pytest.mark.parametrize(
    ("asked", "words_"),
    [
        ({"train": ["static"], "test": ["sts"]}, "trained on static, judged on sts"),
        ({"offset": "train"}, "after taking off a constant"),
        ({"w2": "height"}, "g/z at the mean height"),
        ({"exponent": 3, "half_width": 0.3}, "(1 - s\u00b2)^3 of half width 0.3 s"),
    ],
)
def test_methods_follow_the_config(made: Tables, asked: dict[str, Any], words_: str) -> None:
    """What the config asks for stands in the methods, and only then."""
    config = {**made_tables.CONFIG, "evaluation": {**made_tables.CONFIG["evaluation"], **asked}}
    assert words_ in " ".join(methods.paragraphs(made, made["verdict"], config))
    assert words_ not in " ".join(methods.paragraphs(made, made["verdict"], made_tables.CONFIG))


# -- words ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "text"), [(3.856, "3.86"), (0.2, "0.200"), (360.4, "360"), (1234.5, "1234"), (None, ""), (float("nan"), ""), (12.0, "12.0")]
)
def test_numbers(value: float | None, text: str) -> None:
    """Numbers carry three digits that count; what is not known is empty, never nan."""
    assert words.number(value) == text


def test_sentences() -> None:
    """An unknown error, floor or interval is said to be unknown."""
    assert words.sentence(None, None, "", "") == "No error can be stated."
    assert "not known" in words.sentence(3.0, None, "2.5", "3.5")
    assert "no interval" in words.sentence(3.0, 1.0, "", "")
    assert "within a quarter" in words.sentence(1.1, 1.0, "1.0", "1.2")
    assert "3.0 times that floor" in words.sentence(3.0, 1.0, "2.5", "3.5")


def test_no_nan_in_words(page: str) -> None:
    """No bare nan, None or minus nought reaches the reader."""
    assert not re.search(r"\b(nan|NaN|None|NaT|-0\.0+)\b", said(page).split("tab-separated")[0])


# -- linked views -----------------------------------------------------------------------------------------------------


def named(node: Any, name: str) -> list[Any]:
    """All objects of a Bokeh document with this class name."""
    if isinstance(node, dict):
        mine = [node] if node.get("name") == name and node.get("type") == "object" else []
        return mine + [x for v in node.values() for x in named(v, name)]
    return [x for v in node for x in named(v, name)] if isinstance(node, list) else []


def test_views_share_one_source(made: Tables) -> None:
    """All views of an axis read one source: what is selected in one is selected in all."""
    view = linked.linked(made["residuals"], made["where"], 0.4)
    documents = json.loads(view.documents)
    assert list(documents) == ["lateral", "forward"]
    for axis, document in documents.items():
        assert len(named(document, "ColumnDataSource")) == 1
        assert len(named(document, "GlyphRenderer")) == 7
        assert len(named(document, "BoxSelectTool")) >= 3
        assert [r["id"] for r in document["roots"]] == [r[0] for r in view.roots[axis]]


def test_samples_are_bounded_and_true(made: Tables) -> None:
    """At most MOST samples per axis, each a row of the table; the note says how many trials they are of."""
    judged = made["residuals"].query("axis == 'lateral'").dropna(subset="error")
    step = linked.spacing(judged, 0.4)
    points, trials = linked.chosen(judged, step)
    assert trials == 6
    assert 0 < len(points) <= linked.MOST
    assert set(points["error"]) <= set(judged["error"])
    assert (np.diff(points["shift"]) > 0).all()
    assert f"{len(points)} samples" in linked.linked(made["residuals"], made["where"], 0.4).note


def test_many_trials_take_turns() -> None:
    """When not all trials fit, every subject has one before any has two."""
    time = np.arange(0, 60, 0.02)
    rows = [
        pd.DataFrame({"trial": f"s{s}-{t}", "subject": f"s{s}", "time": time, "com": 0.0, "zmp": 0.0, "zmp_model": 0.0, "error": 1e-3})
        for s in range(3) for t in range(9)
    ]  # fmt: skip
    judged = pd.concat(rows, ignore_index=True)
    points, trials = linked.chosen(judged, linked.spacing(judged, 0.4))
    assert trials == 6
    assert sorted(points["trial"].unique()) == ["s0-0", "s0-1", "s1-0", "s1-1", "s2-0", "s2-1"]


def test_nothing_to_explore() -> None:
    """Without judged trials there is no view and a reason."""
    view = linked.linked(tables.empty("residuals"), tables.empty("where"), 0.4)
    assert not view.roots
    assert "nothing to explore" in view.note


def test_script_asks_nobody() -> None:
    """The plotting script's two ways to load more of itself are closed."""
    assert "jsdelivr.net" not in linked.javascript()
    assert "maps.googleapis.com" not in linked.javascript()
