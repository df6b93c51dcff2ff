"""A report page of a made study, with its figures, for the tests."""

from pathlib import Path
from typing import Any

import made_tables

from plumbline import report, tables
from plumbline.figures import _style, clusters, fit, ladder, loci, residuals, signals, trust, where

ROOT = Path(__file__).resolve().parents[1]
CAPTIONS = {stage: (ROOT / "workflow" / "report" / f"{stage}.rst").read_text(encoding="utf-8") for stage in report.TITLES}


def drawn(made: dict[str, Any], results: Path) -> Path:
    """Every figure of a study of one part, below `results`."""
    _style.save(signals.draw(made["signals"], made["pushes"], made["coverage"]), results / "signals" / "_part-0001.svg")
    _style.save(loci.draw(made["signals"], made["loci"], made["fit"]), results / "loci" / "_part-0001.svg")
    tables_of_trust = ("trust", "rls", "signals", "loci", "clusters", "controller")
    _style.save(trust.draw(**{k: made[k] for k in tables_of_trust}), results / "trust" / "_part-0001.svg")
    _style.save(clusters.draw(**{k: made[k] for k in ("clusters", "choice", "controller")}), results / "clusters" / "_part-0001.svg")
    _style.save(fit.draw(made["fit"]), results / "fit" / "_part-0001.svg")
    _style.save(residuals.draw(made["residuals"]), results / "residuals" / "_part-0001.svg")
    _style.save(where.draw(made["where"]), results / "where" / "_all.svg")
    _style.save(ladder.draw(made["ladder"]), results / "ladder.svg")
    return results


def page(made: dict[str, Any], results: Path | None = None, study: str = "made study", **config: Any) -> str:
    """The page; without `results` it carries no figures."""
    used = {**made_tables.CONFIG, **config}
    pictures = report.pictures(results, ["part-0001"], CAPTIONS, used) if results else []
    return report.page(study, {k: v for k, v in made.items() if k in tables.TABLES}, made["verdict"], used, pictures)
