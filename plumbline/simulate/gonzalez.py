"""One person of nine segments in multi-contact as raw files: calibration, held-out volume, standing up and a longer protocol.

What a laboratory would have: markers on the joints, a plate under each foot, a sensor in each handle and one under the seat. The files
say nothing of the truth, which is written beside them. Noise: markers white; the ground projection as in `multi_contact.ground_noise`,
put on the plates of the feet; forces white.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from plumbline.simulate import multi_contact as mc
from plumbline.simulate import nine_segments as nine
from plumbline.simulate import routes, wrenches
from plumbline.simulate.nine_segments import Array

SEED = 2013
RATE = 50.0  # [Hz]
MARKER, FORCE, MOMENT = 0.0005, 0.5, 0.05  # [m], [N], [N m] white noise
FOOT = {"HEE": (0.0, -0.05, -0.04), "TOE": (0.0, 0.20, -0.04)}  # [m] from the ankle, while the foot is flat
SENSORS = ("foot_l", "foot_r", "hand_l", "hand_r", "seat")


def markers(joints: Mapping[str, Array]) -> dict[str, Array]:
    """Label -> place [m], (n, 3): LSHO, LELB, LHND, LHIP, LKNE, LANK and the same on the right; feet flat with LHEE, LTOE."""
    short = {"shoulder": "SHO", "elbow": "ELB", "hand": "HND", "hip": "HIP", "knee": "KNE", "ankle": "ANK"}
    out = {f"{s.upper()}{label}": joints[f"{name}_{s}"] for s in "lr" for name, label in short.items()}
    return out | {f"{s.upper()}{label}": joints[f"ankle_{s}"] + np.array(at) for s in "lr" for label, at in FOOT.items()}


def motions(rate: float = RATE) -> dict[str, mc.Motion]:
    """Task -> motion: static (300 s), volume (60 s), sts (2 s), extended (290 s)."""
    return {
        "static": mc.paper(rate=rate), "volume": mc.volume(rate=rate), "sts": mc.sit_to_stand(rate=rate), "extended": routes.extended(rate),
    }  # fmt: skip


def write(folder: Path, seed: int = SEED, plan: Mapping[str, mc.Motion] | None = None) -> None:
    """Write raw/sub-01/*.parquet and truth/*.parquet.  plan: other motions by task.  Raises FileExistsError where raw holds some."""
    where = folder / "raw" / "sub-01"
    if where.is_dir() and any(where.iterdir()):
        raise FileExistsError(f"{where} is not empty; remove it to simulate anew")
    person = nine.draw_subject(seed)
    for i, (task, motion) in enumerate((motions() if plan is None else plan).items()):
        record = mc.record(motion, person, seed + i)
        name = f"sub-01_task-{task}.parquet"
        _write_parquet(where / name, recorded(record, np.random.default_rng([seed, 31, i])))
        truth = {"time": record.time} | {f"com_{a}": record.com[:, k] for k, a in enumerate("xyz")}
        _write_parquet(folder / "truth" / name, truth, np.float64)


def recorded(record: mc.Recording, rng: np.random.Generator) -> dict[str, Array]:
    """What the laboratory writes down: column -> (n,)."""
    out = {"time": record.time}
    for label, place in markers(record.joints).items():
        out |= _named(label, place + rng.normal(0.0, MARKER, place.shape))
    error = record.ground - wrenches.projection(record.contacts)
    load = np.sum([c.force[:, 2] for c in record.contacts], axis=0)
    feet = np.sum([c.force[:, 2] for c in record.contacts if c.name.startswith("foot")], axis=0)
    touched = {c.name: c for c in record.contacts}
    for name in SENSORS:
        force, moment = np.zeros_like(record.com), np.zeros_like(record.com)
        if name in touched:
            c = touched[name]
            force, moment = c.force.copy(), np.cross(c.point, c.force) + c.moment
        if name.startswith("foot"):  # the CoP of all is off by `error`: M = r x W
            share = (touched[name].force[:, 2] / feet * load)[:, None]
            moment[:, :2] += share * np.column_stack([error[:, 1], -error[:, 0]])
        out |= _named(f"{name}_F", force + rng.normal(0.0, FORCE, force.shape))
        out |= _named(f"{name}_M", moment + rng.normal(0.0, MOMENT, moment.shape))
    return out


def _named(stem: str, values: Array) -> dict[str, Array]:
    return {f"{stem}_{a}": values[:, k] for k, a in enumerate("xyz")}


def _write_parquet(path: Path, columns: Mapping[str, Array], kind: type = np.float32) -> None:
    """The time is kept double."""
    import pyarrow as pa  # here, as only writing needs it
    import pyarrow.parquet as pq

    path.parent.mkdir(parents=True, exist_ok=True)
    table = pa.table({name: pa.array(value if name == "time" else value.astype(kind)) for name, value in columns.items()})
    pq.write_table(table, path, compression="zstd", use_dictionary=False)
