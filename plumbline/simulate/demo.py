"""The demo study: two simulated people, pushed by hand, of whom the model is told nothing.

Their trunks roll on a rhythm of their own, which the CoM-ZMP equation cannot hold: the demo shows an error above the noise floor
and where it lives. Seeded: the files are the same at each run.
"""

from pathlib import Path

from plumbline.simulate.person import draw_subject
from plumbline.simulate.study import write_study

SEED = 2013
EFFECTS = {"ang_mom": {"amplitude": 0.03, "frequency": 0.65}}  # [rad], [Hz]


def write(raw: Path, *, trials: int = 5, duration: float = 13.0) -> None:
    """Write the recordings below `raw` (a folder of that name), which must hold none.

    trials: per subject.  duration: [s].  Raises ValueError for another folder name.
    """
    if raw.name != "raw":
        raise ValueError(f"{raw}: recordings of a study lie in a folder named raw")
    people = [draw_subject("sub-01", seed=1, sex="M"), draw_subject("sub-02", seed=2, sex="M")]
    write_study(raw.parent, people, trials=trials, duration=duration, effects=EFFECTS, seed=SEED)
