"""Every file that could not be used, with its reason: nothing is skipped in silence."""

from collections.abc import Iterable

import pandas as pd

from plumbline.errors import REASONS
from plumbline.study import Exclusion


def exclusions(trials: pd.DataFrame, unused: Iterable[Exclusion]) -> pd.DataFrame:
    """Table `exclusions`: one row per file.

    trials: the table of all parts.  unused: files that no trial uses, from `study.find`.
    """
    rows = [(e.file, e.reason, e.message, e.hint) for e in unused]
    for _, t in trials[trials["reason"] != ""].iterrows():
        rows += [(file, str(t["reason"]), str(t["message"]), str(t["hint"])) for file in str(t["files"]).split(" + ")]
    assert all(r[1] in REASONS for r in rows), "reason codes are a closed list"
    return pd.DataFrame(sorted(rows), columns=["file", "reason", "message", "hint"])
