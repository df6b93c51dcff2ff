"""padasip's side of benchmarks/rls.py, run by the peers' own Python: `_padasip.py CASES.npz ANSWERS.npz`.

CASES: for each case k: y_k (n, m), phi_k (c, n, m), mu_k, eps, start_k (c, m).  ANSWERS: theta_k (c, n, m) and seconds_k, one per round.
"""

import sys
import time

import numpy as np
from padasip.filters import FilterRLS

ROUNDS = 5


def run(y, phi, mu, eps, start):
    """Estimates after each frame of each locus, and the processor time of the loops [s]."""
    theta, seconds = np.empty(phi.shape), 0.0
    for i in range(y.shape[1]):
        rows, wanted = np.ascontiguousarray(phi[:, :, i].T), np.ascontiguousarray(y[:, i])
        filtered = FilterRLS(n=len(phi), mu=mu, eps=eps, w=start[:, i].copy())
        begin = time.process_time()
        _, _, history = filtered.run(wanted, rows)
        seconds += time.process_time() - begin
        theta[:, :, i] = np.vstack([history[1:], filtered.w]).T  # it notes the weights before each frame
    return theta, seconds


if __name__ == "__main__":
    cases, answers = np.load(sys.argv[1]), {}
    for k in range(int(cases["count"])):
        arguments = (cases[f"y_{k}"], cases[f"phi_{k}"], float(cases[f"mu_{k}"]), float(cases["eps"]), cases[f"start_{k}"])
        rounds = [run(*arguments) for _ in range(ROUNDS)]
        answers |= {f"theta_{k}": rounds[0][0], f"seconds_{k}": np.array([s for _, s in rounds])}
    np.savez(sys.argv[2], **answers)
