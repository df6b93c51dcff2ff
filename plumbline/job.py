"""What each script of the workflow does first: open its log and say who makes the tables."""

import platform
import sys
import traceback
from pathlib import Path
from types import TracebackType
from typing import Any

from plumbline import __version__
from plumbline.tables import Stamp


def start(snakemake: Any) -> Stamp:
    """Begin a job: its log holds versions, parameters and, should it fail, the traceback.

    snakemake: the object a script is given.  Returns the stamp for the tables it writes.
    """
    log = Path(snakemake.log[0])
    log.parent.mkdir(parents=True, exist_ok=True)
    params = snakemake.params
    log.write_text(f"plumbline {__version__}, Python {platform.python_version()}, code {params.code}\n", encoding="utf-8")

    def keep(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
        with log.open("a", encoding="utf-8") as handle:
            traceback.print_exception(kind, error, trace, file=handle)
        sys.__excepthook__(kind, error, trace)

    sys.excepthook = keep
    return Stamp(params.code, params.config)
