"""The report: one self-contained page per study. Loads nothing from anywhere; the same results give the same bytes."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2
import pandas as pd

from plumbline.effects import Effect, catalogue
from plumbline.report import centre, controller, first, linked, methods, sheets, verdicts, words

DATA_FILES = ("page.html.j2", "page.css", "../../workflow/report/*.rst")  # the captions are those of the Snakemake report

HERE = Path(__file__).parent
CAPTIONS = HERE.parents[1] / "workflow" / "report"
INLINE_PARTS = 3  # parts whose figures stand in the page; those of the others are linked
STAGES = ("signals", "loci", "trust", "clusters", "fit", "residuals")  # figures of a part, in the order data flow
COHORT = {"where": "where/_all.svg", "ladder": "ladder.svg"}
TITLES = {
    "signals": "From the recording to the CoM",
    "loci": "Phase portrait of all loci",
    "trust": "Regimes of the controller and returning RLS",
    "clusters": "Clusters of \u03c9 and gains",
    "fit": "Natural frequency",
    "residuals": "Measured and modelled",
    "where": "Where the model fails",
    "ladder": "The ladder",
}


@dataclass(frozen=True)
class Picture:
    """One figure: its stage, its part ("" for the cohort), its caption, its file below results/, its bytes (None: only linked)."""

    stage: str
    part: str
    caption: str
    path: str
    svg: bytes | None

    @property
    def title(self) -> str:
        """Heading of the figure."""
        return TITLES[self.stage]

    @property
    def source(self) -> str:
        """The picture itself as a data address; apart from the page, so that its ids meet no others and nothing in it can run."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.svg or b"").decode("ascii")


def page(
    study: str,
    tables: Mapping[str, pd.DataFrame],
    verdict: Mapping[str, Any],
    config: Mapping[str, Any],
    pictures: Sequence[Picture],
    effects: Mapping[str, Effect] | None = None,
) -> str:
    """The whole page as HTML.

    study: its name.  tables: trials, coverage, exclusions, loci, pushes, trust, clusters, choice, controller, fit, where, ladder of all
    parts, residuals of the first; and, where effects were searched for, candidates of the cohort and contributions of the first part.
    verdict: what results/verdict.json holds.  config: its sections recording, signals, sesc, evaluation, models.  pictures: see
    :func:`pictures`.  effects: the catalogue, without it the library's.
    """
    known = catalogue() if effects is None else effects
    auto = config.get("models", "auto") == "auto"
    view = linked.linked(tables["residuals"], tables["where"], config["evaluation"]["half_width"], tables.get("contributions"), known)
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(HERE), autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    return environment.get_template("page.html.j2").render(
        study=study,
        css=(HERE / "page.css").read_text(encoding="utf-8"),
        look=first.look(verdict, tables["ladder"], known, auto),
        control=first.control(verdict, known, auto),
        auto=auto,
        broken=verdict.get("broken_effects", []),
        counts=words.counts(tables),
        sheets=sheets.all_sheets(tables) | centre.all_sheets(tables) | verdicts.all_sheets(tables, verdict, known),
        controller=controller.section(tables),
        view=view,
        bokeh=linked.javascript() if view.roots else "",
        inline=[p for p in pictures if p.svg is not None],
        several=len({p.part for p in pictures if p.part}) > 1,
        linked_only=[p for p in pictures if p.svg is None],
        methods=methods.paragraphs(tables, verdict, config),
        references=methods.references(tables),
        versions=methods.versions(),
        half_width=config["evaluation"]["half_width"],
        gate=centre.gate(config["sesc"]),
        files=sheets.FILES,
    )


def pictures(results: Path, parts: Sequence[str], captions: Mapping[str, str], config: Mapping[str, Any]) -> list[Picture]:
    """The figures of a study; those of the cohort come first where there are several parts, else last, as data flow.

    results: folder.  parts: their names.  captions: stage -> text of workflow/report/<stage>.rst, a Jinja template that may name
    `snakemake.config` like a caption of Snakemake's own report.
    """
    said = {k: jinja2.Template(v).render(snakemake={"config": config}).strip() for k, v in captions.items()}
    cohort = [Picture(stage, "", said[stage], path, (results / path).read_bytes()) for stage, path in COHORT.items()]
    out: list[Picture] = []
    for number, part in enumerate(parts):
        for stage in STAGES:
            path = f"{stage}/_{part}.svg"
            out.append(Picture(stage, part, said[stage], path, (results / path).read_bytes() if number < INLINE_PARTS else None))
    return cohort + out if len(parts) > 1 else out + cohort
