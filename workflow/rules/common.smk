# Shared by all rules - the validated config, the study, its parts, the digest of the code behind a script.
import os
import sys
from pathlib import Path

import yaml

REPO = Path(workflow.basedir)
sys.path.insert(0, str(REPO))

from plumbline import study as studies
from plumbline.config import models, with_defaults
from plumbline.errors import PlumblineError
from plumbline.provenance import digest

# numbers, fonts and file bytes must not depend on the machine's load or clock
os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1", SOURCE_DATE_EPOCH="0", MPLBACKEND="agg")

if Path("config.yaml").is_file() and yaml.safe_load(Path("config.yaml").read_text(encoding="utf-8")):

    configfile: "config.yaml"


try:
    config = with_defaults(config)
    STUDY = studies.find(Path("."), config["raw"])
    if not (STUDY.trials or STUDY.exclusions):
        raise PlumblineError(
            f"{STUDY.raw}/ of {Path.cwd()} holds no recording: put files there as the README shows, "
            "or type `make run` in the repository, which makes the demo's"
        )
    if config["models"] != "auto":  # a name that nobody knows stops here, not when its stage comes
        from plumbline.effects import catalogue

        models(config, catalogue(Path(".")))
    studies.check_names(STUDY.trials, {"sesc.tasks": config["sesc"]["tasks"]})
    studies.check_comparison(STUDY.trials, config["evaluation"]["train"], config["evaluation"]["test"])
except PlumblineError as error:
    raise WorkflowError(str(error)) from None

SIZE = config["subjects_per_job"]
PART_OF = studies.assign(STUDY.subjects, SIZE, studies.read_parts(Path("results/parts.tsv"), SIZE))
PARTS = sorted(set(PART_OF.values()))


PART_TABLES = ["trials", "markers", "plates", "sesc", "chain", "poses", "guidance", "signals", "coverage", "loci", "pushes"]
PART_TABLES += ["trust", "rls", "clusters", "choice", "controller", "fit", "heldout", "residuals", "where"]
PART_TABLES += ["centres", "stability", "margins", "evidence", "rungs", "contributions", "control"]
EFFECTS = sorted(str(f) for f in Path("effects").glob("*.py"))  # the study's own
WEAK = {k: config["evaluation"][k] for k in ("half_width", "exponent")}


wildcard_constraints:
    part=r"part-\d{4}",


onstart:
    studies.write_parts(PART_OF, SIZE, Path("results/parts.tsv"))
    studies.forget_parts(PARTS, Path("results"))


def trials(part):
    """Trials of a part's subjects."""
    return [t for t in STUDY.trials if PART_OF[t.subject] == part]


def code(script, *modules):
    """Digest of a script and of the library modules it uses, transitively: edited code re-runs what depends on it.

    modules: files of the library that the script imports by name.
    """
    return digest(REPO / "scripts" / script, *(REPO / "plumbline" / m for m in modules))


def of_the_law(models):
    """Control effects among those that the config lists: the control ledger re-runs for no other."""
    listed = [] if models == "auto" else [e for names in models.values() for e in names]
    files = [
        f for e in sorted(set(listed)) for f in (Path("effects") / f"{e}.py", REPO / "plumbline" / "effects" / f"{e}.py") if f.is_file()
    ]
    return [f.stem for f in files if 'ledger="control"' in f.read_text(encoding="utf-8")]


def parts(table):
    """Files of a table for every part."""
    return expand("results/{table}/{part}.parquet", table=table, part=PARTS)
