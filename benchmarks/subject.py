"""One subject of 128 loci: from signals in memory to switches, clusters, gains, limits and intervals, the search for a delay included."""

import sys
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from made_loci import made, tabled

from plumbline import clusters, trust

WEAK = {"half_width": 0.4, "exponent": 4}


def main(_: Sequence[str] = ()) -> list[dict[str, object]]:
    """Rows of the table: processor time of each stage."""
    far = made("A", 31, n=32, omega=2.117, k2=0.875 * 2.740 / 2.117)
    study = tabled({"free": far + made("A", 32, n=32)}, omega=2.7)
    start = time.process_time()
    parts, _rls = trust.of_part(*study, WEAK)
    middle = time.process_time()
    clusters.of_part(*study[:4], parts, WEAK)
    end = time.process_time()
    return [
        {"stage": name, "loci": len(study[2]), "processor time [s]": round(spent, 2)}
        for name, spent in (("trust", middle - start), ("clusters", end - middle), ("both", end - start))
    ]
