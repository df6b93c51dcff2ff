"""The command line: ask what is usable, name own files, link public data, compare with references."""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import click

from plumbline import __version__
from plumbline.errors import PlumblineError

REPO = Path(__file__).resolve().parents[1]


class Polite(click.Group):
    """A group whose commands report our own errors in one line and exit with 2."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command."""
        try:
            return super().invoke(ctx)
        except PlumblineError as error:
            raise click.ClickException(str(error)) from None


@click.group(cls=Polite, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__)
def main() -> None:
    """plumbline: from raw recordings of balance to an identified, criticised model."""


@main.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
def check(folder: Path) -> None:
    """Say what in the study FOLDER is usable, and why the rest is not. Writes nothing."""
    from plumbline.check import lines

    usable = False
    for line in lines(folder):
        usable = usable or line.usable
        click.secho(line.text, fg=line.colour)
    if not usable:
        raise click.exceptions.Exit(1)


@main.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.option("--pattern", required=True, help="How the files are named, e.g. '{participant}_{task}_{run}.c3d'.")
@click.option("--task", default="", help="The task, where the names do not hold it.")
@click.option("--force", is_flag=True, help="Replace a recordings.tsv that is there already.")
def adopt(folder: Path, pattern: str, task: str, force: bool) -> None:
    """Write FOLDER/recordings.tsv for files with their own names. Nothing is renamed or moved."""
    from plumbline.adopt import adopt as write

    for text in write(folder, pattern, task=task, force=force):
        click.echo(text)


@main.command()
@click.argument("folder", type=click.Path(exists=True, file_okay=False, path_type=Path))
def data(folder: Path) -> None:
    """Link the public data sets in FOLDER into studies/NAME/raw, where a study of that name is part of plumbline."""
    linked = 0
    for study in sorted(p.parent for p in (REPO / "studies").glob("*/recordings.tsv")):
        source, link = (folder / study.name).resolve(), study / "raw"
        if not source.is_dir():
            click.echo(f"{study.name}: not in {folder}; its README says where to get it")
            continue
        if link.is_symlink():
            link.unlink()
        if link.exists():
            raise PlumblineError(f"{link} is a folder of its own; move it away first")
        link.symlink_to(source, target_is_directory=True)
        linked += 1
        click.echo(f"{study.name}: linked; run it with `make run STUDY=studies/{study.name}`")
    if not linked:
        raise PlumblineError(f"{folder} holds none of the data sets that studies/ knows")


STUDY = click.option(
    "--study", default=".", type=click.Path(exists=True, file_okay=False, path_type=Path), help="Folder of the study; default: this one."
)


@main.command()
@click.argument("effect")
@STUDY
def add(effect: str, study: Path) -> None:
    """Add EFFECT to the models in the study's config.yaml."""
    from plumbline.models_file import add as lines

    for text in lines(study, effect):
        click.echo(text)


@main.command()
@click.argument("effect")
@STUDY
def drop(effect: str, study: Path) -> None:
    """Take EFFECT out of the last model in the study's config.yaml."""
    from plumbline.models_file import drop as lines

    for text in lines(study, effect):
        click.echo(text)


@main.command()
@click.argument("name", required=False)
@click.option("--ledger", type=click.Choice(["plant", "control", "robot"]), help="Only this part of the catalogue.")
@STUDY
def effects(name: str | None, ledger: str | None, study: Path) -> None:
    """List the catalogue of effects, or show the effect NAME in full."""
    from plumbline.config import known_effect
    from plumbline.effects import catalogue
    from plumbline.effects_text import full, listing

    known = catalogue(study.resolve())
    if name is not None:
        known_effect(name, known)
    own = frozenset(k for k, e in known.items() if e.file and Path(e.file).parent == study.resolve() / "effects")
    for text in full(known[name]) if name else listing(known, ledger, own):
        click.echo(text)
    for file, error in known.broken:
        click.secho(f"{file} cannot be used: {error}", fg="red")


@main.command("new-effect")
@click.argument("name")
@STUDY
def new_effect(name: str, study: Path) -> None:
    """Write effects/NAME.py in the study: an effect of your own, to be changed by hand."""
    from plumbline.new_effect import write

    for text in write(study, name):
        click.echo(text)


@main.command(hidden=True)
def docs() -> None:
    """Write docs/effects.md from the catalogue."""
    from plumbline.effects import catalogue
    from plumbline.effects_text import page

    (REPO / "docs" / "effects.md").write_text(page(catalogue()), encoding="utf-8")


@main.command()
@click.argument("folder", type=click.Path(path_type=Path))
def demo(folder: Path) -> None:
    """Make the recordings of the demo study in FOLDER (simulated; nothing is measured)."""
    from plumbline.simulate.demo import write

    write(folder)
    click.echo(f"demo: simulated recordings written to {folder}")


@main.command()
def papers() -> None:
    """Compare results with the committed references, column by column; the exit code is 1 where one drifts."""
    from plumbline.papers import compare_all

    fine = True
    for line, ok in compare_all(REPO):
        fine = fine and ok
        click.secho(line, fg=None if ok else "red")
    if not fine:
        raise click.exceptions.Exit(1)


@main.command()
@click.argument("name")
def freeze(name: str) -> None:
    """Renew the committed reference of studies/NAME from its results; look at the difference before you commit it."""
    from plumbline.papers import freeze_all

    for line in freeze_all(REPO / "studies" / name / "reference"):
        click.echo(line)


@main.command(hidden=True)
def lint() -> None:
    """Snakemake's own lint, without its wish for conda environments (the lock pins them)."""
    snakemake = Path(sys.executable).with_name("snakemake")
    with tempfile.TemporaryDirectory() as study:
        (Path(study) / "raw").mkdir()
        (Path(study) / "raw" / "sub-01_task-quiet.c3d").touch()
        command = [str(snakemake), "--lint", "-s", str(REPO / "Snakefile"), "-d", study]
        done = subprocess.run(command, capture_output=True, text=True)
    said = done.stdout + done.stderr
    problems = [line.strip(" *:") for line in said.splitlines() if line.startswith("    * ") and "conda environment" not in line]
    if "conda environment" not in said:  # it always is, so this is an error of the Snakefile
        raise PlumblineError(f"snakemake --lint did not come to an end: {said.strip()[-500:]}")
    click.echo("\n".join(problems) or "snakemake --lint: nothing to say")
    if problems:
        raise click.exceptions.Exit(1)
