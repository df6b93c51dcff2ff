"""One person of 16 trials, three loci each, from tables in memory to the verdict; and the memory of the search as people are added."""

import time
import tracemalloc
from collections.abc import Sequence
from dataclasses import replace

from benchmarks._study import Stages
from plumbline import control, criticism, evidence
from plumbline.effects import catalogue
from plumbline.simulate.cohort import draw

LABORATORY = {"people": 1, "trials": 16, "duration": 12.0, "rate": 100.0, "force_rate": 1000.0}
SEED = 1
PEOPLE = (2, 8, 32)


def main(_: Sequence[str] = ()) -> list[dict[str, object]]:
    """Rows of the table: processor time of each ledger, largest memory of the search for all people together."""
    stages = Stages(draw(SEED, "one", names=("ang_mom",), share=(0.7, 0.7), **LABORATORY))
    stages.plant()
    t, effects = stages.control(), catalogue()
    evaluation = stages.config["evaluation"]
    start = time.process_time()
    table, alone, tried = criticism.of_part(t["signals"], t["pushes"], t["coverage"], effects, evaluation)
    middle = time.process_time()
    faults, others = criticism.known(alone, tried, effects)
    given = {n: t[n] for n in ("signals", "pushes", "loci", "coverage", "trust", "clusters", "controller")}
    control.of_part(**given, evaluation=evaluation, corrected=faults, plant=others, effects=effects)
    end = time.process_time()
    rows: list[dict[str, object]] = [
        {"what": f"{name}, {t['coverage'].shape[0]} trials, {t['loci']['locus'].count()} loci: processor time [s]", "is": round(spent, 2)}
        for name, spent in (("plant", middle - start), ("control", end - middle), ("both", end - start))
    ]
    windows = list(evidence.from_table(table[table["axis"] == "lateral"]))
    h = float(alone.loc[alone["axis"] == "lateral", "h"].iloc[0])
    for number in PEOPLE:
        names = [f"sub-{k:02d}" for k in range(number)]
        each = criticism.OneByOne({k: evidence.to_table([replace(w, subject=k) for w in windows]) for k in names}, names, "lateral")
        tracemalloc.start()
        criticism.together(each, [h] * number, criticism.plant_effects(effects))
        rows.append({"what": f"search over {number} people: memory [MB]", "is": round(tracemalloc.get_traced_memory()[1] / 1e6, 1)})
        tracemalloc.stop()
    return rows
