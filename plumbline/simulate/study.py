"""Write simulated trials as a study on disk: C3D files, events, participants and marker set, and the truth beside it if asked."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from plumbline.simulate import c3d_file
from plumbline.simulate.contacts import Touch
from plumbline.simulate.human import SimulatedTrial, simulate
from plumbline.simulate.person import ENDS, PAIRED, Subject

_HEADER = """\
# segments by the markers at their ends; mass as a share of the body, com and gyration as shares of the length,
# com counted from the proximal end
segments:"""


def write_study(
    folder: str | Path,
    subjects: Sequence[Subject],
    *,
    trials: int = 5,
    quiet: bool = False,
    truth_folder: str | Path | None = None,
    rate: float = 200.0,
    force_rate: float = 1000.0,
    seed: int,
    **options: Any,
) -> list[SimulatedTrial]:
    """Simulate and write `folder`/raw: `trials` recordings of each subject named task-lateral, and one task-quiet if `quiet`.

    rate, force_rate: [Hz].  options: those of `simulate`.  truth_folder: where to leave one parquet file of truth per trial; it
    must lie outside raw (else ValueError), as nothing in raw may tell the truth. marker set: the mean of the subjects' nominal
    numbers, so that it is exact for subjects of one sex without personal deviation. Returns the trials, quiet ones last.
    """
    raw = Path(folder) / "raw"
    if truth_folder is not None and Path(truth_folder).resolve().is_relative_to(raw.resolve()):
        raise ValueError(f"the truth may not lie in {raw}; give a folder outside it")
    options |= {"rate": rate, "force_rate": force_rate, "seed": seed}
    done = [("lateral", t) for t in simulate(subjects, trials=trials, **options)]
    if quiet:
        options |= {"touches": [[] for _ in subjects], "seed": seed + 1}
        done += [("quiet", t) for t in simulate(subjects, trials=1, **options)]
    raw.mkdir(parents=True, exist_ok=True)
    (raw / "participants.tsv").write_text(participants(subjects), encoding="utf-8")
    (raw / "markerset.yaml").write_text(marker_set(subjects), encoding="utf-8")
    for task, trial in done:
        where = raw / trial.subject.participant_id
        where.mkdir(exist_ok=True)
        name = f"{trial.subject.participant_id}_task-{task}_run-{trial.run:02d}"
        c3d_file.write(where / f"{name}.c3d", trial.markers, trial.plates, rate, force_rate)
        if trial.touches:
            (where / f"{name}_events.tsv").write_text(events(trial), encoding="utf-8")
        if truth_folder is not None:
            write_truth(trial, Path(truth_folder) / f"{name}.parquet")
    return [trial for _, trial in done]


def participants(subjects: Sequence[Subject]) -> str:
    """Text of participants.tsv."""
    rows = [f"{s.participant_id}\t{s.mass}\t{s.height}\t{s.sex}" for s in subjects]
    return "\n".join(["participant_id\tmass_kg\theight_m\tsex", *rows]) + "\n"


def marker_set(subjects: Sequence[Subject]) -> str:
    """Text of markerset.yaml: the nominal numbers as a laboratory would use them."""
    lines = [_HEADER]
    for segment, (near, far) in ENDS.items():
        mass, com, gyration = (sum(s.nominal[segment][i] for s in subjects) / len(subjects) for i in range(3))
        sides = {"_right": "R", "_left": "L"} if segment in PAIRED else {"": ""}
        for suffix, letter in sides.items():
            ends = f"proximal: [{letter}{near}], distal: [{letter}{far}]"
            lines.append(f"  {segment}{suffix}: {{{ends}, mass: {mass:.8g}, com: {com:.8g}, gyration: {gyration:.8g}}}")
    return "\n".join(lines) + "\n"


def events(trial: SimulatedTrial) -> str:
    """Text of the events file: every touch by hand that began within the record is a push."""
    inside: list[Touch] = [t for t in trial.touches if t.onset < trial.time[-1]]
    return "\n".join(["onset\tduration\ttrial_type", *(f"{t.onset:.3f}\t{t.duration:.3f}\tpush" for t in inside)]) + "\n"


def write_truth(trial: SimulatedTrial, path: Path) -> None:
    """The truth of a trial as parquet."""
    import pyarrow as pa  # here, as writing the demo needs no parquet and should start quickly
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(trial.truth), path, compression="zstd")
