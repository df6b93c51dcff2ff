r"""From one recording to its signals: CoM, angular momentum, ground reaction, CoP and ZMP, support limits, raw and low-passed.

CoM: from the segments of a marker set (``table``), as the file holds it (``lab``), and from the forces (``force``); `com_*` is
the first of these that exists. Beside them the subject's own (``sesc``, from ``plumbline/sesc.py``) and the table's held together
with the force (``fused``): they are ranked later, the base of the ladder is always the table's.

Positions and forces stay unfiltered in their own columns: the weak form that judges the plant
integrates by parts and needs no smooth derivative, and a filter would take away part of the motion (2 Hz on cut loci costs 10
to 15 % of omega). Angular momentum is made of central differences of unfiltered positions and is noisy for the same reason.
Only `com_lp`, `zmp_lp` and the derivatives are low-passed: second-order Butterworth, forth and back over the continuous
recording, -3 dB at `cutoff` *after both passes* (``plumbline/filters.py``).
"""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from plumbline import body, contact, filters, forces, noise_band, support
from plumbline.com_force import CROSSOVER, DEFAULT_HEIGHT, HEIGHT_SHARE, com_from_force, fused
from plumbline.errors import Refused
from plumbline.forces import Forces, Plate
from plumbline.markerset import MarkerSet, choose
from plumbline.study import Participant, Trial
from plumbline.tables import TABLES, joined

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

METHODS = ("table", "lab", "force", "sesc", "others", "fused")
LAB_COM = ("centreofmass", "centerofmass", "com", "cog", "wholebodycom", "centreofgravity", "centerofgravity")


class Recording(Protocol):
    """What is needed of a recording; pipeline axes, SI (see ``plumbline/recording.py``)."""

    trial: Trial
    time: Array
    rate: float
    markers: dict[str, Array]
    filled: dict[str, Mask]
    derived: dict[str, Array]
    mass: float

    @property
    def plates(self) -> Sequence[Plate]:
        """Loaded force plates."""


class Signals(NamedTuple):
    """frames: table `signals` of one trial.  coverage: one row of table `coverage`.  notes: what was assumed, in words."""

    frames: pd.DataFrame
    coverage: dict[str, Any]
    notes: list[str]


def signals(
    recording: Recording, participant: Participant, markerset: MarkerSet | None, *, cutoff: float, subject_mass: float = math.nan,
    own: tuple[Array, Array] | None = None,
) -> Signals:  # fmt: skip
    """Signals of one trial.

    markerset: None where no set fits; then there is no table CoM.  cutoff: [Hz], -3 dB after the double pass.
    subject_mass: [kg], what the plates say in the subject's other trials; used where this trial does not tell it, before
    participants.tsv.  own: the subject's own CoM, by all its trials and by
    the others [m], each (n, 3).  Raises Refused ("no_rate") where the frames are too slow for the cut-off.
    """
    notes: list[str] = list(markerset.notes) if markerset else []
    made = _made(recording, participant, markerset, subject_mass, notes)
    if own is not None:
        made.coms["sesc"], made.coms["others"] = own
    columns = _columns(recording, markerset, made, cutoff)
    coverage = _coverage(recording, markerset, made, cutoff, notes)
    return Signals(pd.DataFrame({c.name: columns[c.name] for c in TABLES["signals"]}), coverage, notes)


class _Made(NamedTuple):
    """What a trial's tables are written from."""

    mass: float
    force: Forces
    frame: body.Body | None
    coms: dict[str, Array]  # by method, and "none"
    method: str
    border: support.Support


def _made(recording: Recording, participant: Participant, markerset: MarkerSet | None, subject_mass: float, notes: list[str]) -> _Made:
    time, nothing = recording.time, np.full((len(recording.time), 3), np.nan)
    mass = _mass(recording, subject_mass, participant, notes)
    outline = support.feet(recording.markers, markerset) if markerset else {}
    standing = contact.of_feet(recording.markers, outline, time)
    force = forces.net(recording.plates, time, standing)
    frame = body.build(recording.markers, markerset, participant.sex, time) if markerset and recording.markers else None
    notes += force.notes + (frame.notes if frame else [])
    coms = {"table": frame.com() if frame else nothing, "lab": _lab(recording)}
    height = _height(coms, force, participant, notes)
    coms |= {"force": com_from_force(force.grf, force.zmp, time, mass, height), "none": nothing, "sesc": nothing, "others": nothing}
    coms["fused"] = fused(coms["table"], force.grf, time, mass)
    method = next((m for m in ("table", "lab", "force") if filters.known(coms[m]).any()), "none")
    border = support.limits(outline, markerset, standing, force, recording.plates)
    notes.append(border.note)
    return _Made(mass, force, frame, coms, method, border)


# -- columns ----------------------------------------------------------------------------------------------------------


def _columns(recording: Recording, markerset: MarkerSet | None, made: _Made, cutoff: float) -> dict[str, Any]:
    """Columns of table `signals`."""
    time, n = recording.time, len(recording.time)
    com, force, frame = made.coms[made.method], made.force, made.frame
    out: dict[str, Any] = {k: np.full(n, v, dtype=object) for k, v in _key_of(recording.trial).items()}
    out |= {"frame": np.arange(n), "time": time} | _xyz("com", com)
    for method in METHODS:
        out |= _xyz(f"com_{method}", made.coms[method])
    out |= _xyz("grf", force.grf) | _xyz("zmp", force.zmp) | _xyz("hand", force.hand) | _per_foot(force, n)
    out |= _xyz("ang_mom", frame.angular_momentum(time, made.mass) if frame else made.coms["none"])
    out |= dict(zip(("limit_left", "limit_right", "limit_back", "limit_front"), made.border.limits.T, strict=True))
    out |= _filtered(com, force.zmp, time, recording.rate, cutoff)
    return out | {"filled": _flags(recording, markerset, frame if made.method == "table" else None)}


def _key_of(trial: Trial) -> dict[str, Any]:
    return {"trial": trial.trial, "subject": trial.subject, "task": trial.task, "condition": trial.condition}


def _xyz(prefix: str, values: Array) -> dict[str, Array]:
    return {f"{prefix}_{a}": values[:, i] for i, a in enumerate("xyz")}


def _per_foot(force: Forces, n: int) -> dict[str, Array]:
    nothing = np.full((n, 3), np.nan)
    out: dict[str, Array] = {}
    for side in ("left", "right"):
        grf, cop = force.feet.get(side, (nothing, nothing))
        out |= _xyz(f"grf_{side}", grf) | _xyz(f"cop_{side}", cop)
    return out


def _filtered(com: Array, zmp: Array, time: Array, rate: float, cutoff: float) -> dict[str, Any]:
    """Low-passed CoM and ZMP, the CoM's derivatives, and where an end or a gap reaches into them."""
    com_lp, zmp_lp = filters.low_pass(com, time, cutoff), filters.low_pass(zmp, time, cutoff)
    velocity, acceleration = filters.derivatives(com_lp, time)
    there = [filters.known(x) for x in (com, zmp) if np.isfinite(x).any()]
    good = np.logical_and.reduce(there) if there else np.zeros(len(time), dtype=bool)
    out: dict[str, Any] = _xyz("com_lp", com_lp) | _xyz("com_dot", velocity) | _xyz("com_ddot", acceleration) | _xyz("zmp_lp", zmp_lp)
    return out | {"edge": filters.edges(good, rate, cutoff)}


def _flags(recording: Recording, markerset: MarkerSet | None, frame: body.Body | None) -> Mask:
    """Frames in which a marker behind the CoM was filled, or a segment bridged."""
    out = np.zeros(len(recording.time), dtype=bool)
    if frame is None or markerset is None:
        return out
    labels = markerset.resolve(recording.markers)
    for name in body.inputs(markerset, frame.names):
        out |= recording.filled.get(labels.get(name, ""), False)
    return out | frame.filled


# -- coverage ---------------------------------------------------------------------------------------------------------


def _coverage(recording: Recording, markerset: MarkerSet | None, made: _Made, cutoff: float, notes: list[str]) -> dict[str, Any]:
    """Row of table `coverage`, without its notes."""
    frame, coms = made.frame, made.coms
    return _key_of(recording.trial) | {
        "com_method": made.method,
        "marker_set": markerset.name if markerset else "",
        "mass_share": frame.share if frame else 0.0,
        "missing_segments": "; ".join(frame.missing) if frame else "",
        "mass": made.mass,
        "height_com": _mean(coms[made.method][:, 2]) - made.force.surface,
        "lab_distance": _rms(coms["table"] - coms["lab"]),
        "support": made.border.source,
        "cutoff": cutoff,
        "filtered_before": _filtered_before(recording, coms["lab"], notes),
        "limitation": "; ".join(_limitations(recording, frame, made.force, made.method)),
    }


def _mass(recording: Recording, subject_mass: float, participant: Participant, notes: list[str]) -> float:
    """Body mass [kg]: from the plates in this trial, else in the subject's others, else from participants.tsv, else NaN."""
    if np.isfinite(recording.mass):
        return float(recording.mass)
    if np.isfinite(subject_mass):
        notes.append(f"body mass {subject_mass:.2f} kg from the plates in the subject's other trials")
        return float(subject_mass)
    if participant.mass is not None:
        notes.append(f"body mass {participant.mass:g} kg from participants.tsv: the plates do not tell it in this trial")
        return float(participant.mass)
    notes.append("body mass unknown: neither steady standing on the plates nor participants.tsv")
    return float("nan")


def _lab(recording: Recording) -> Array:
    """CoM as the file holds it [m], (n, 3)."""
    found = (v for k, v in recording.derived.items() if "".join(c for c in k.lower() if c.isalpha()) in LAB_COM)
    return next(found, np.full((len(recording.time), 3), np.nan))


def _height(coms: Mapping[str, Array], force: Forces, participant: Participant, notes: list[str]) -> float:
    """CoM height over the plates [m] for the force-only CoM: measured where a CoM is, else 0.56 of body height."""
    for com in coms.values():
        if np.isfinite(com[:, 2]).any() and np.isfinite(force.surface):
            return float(np.nanmean(com[:, 2]) - force.surface)
    tall = participant.height if participant.height is not None else DEFAULT_HEIGHT
    said = "participants.tsv" if participant.height is not None else "no height in participants.tsv, assumed"
    if np.isfinite(force.grf).any():
        notes.append(f"CoM height of the force-only CoM: {HEIGHT_SHARE:g} x {tall:.2f} m ({said})")
    return HEIGHT_SHARE * tall


def _mean(values: Array) -> float:
    good = values[np.isfinite(values)]
    return float(good.mean()) if len(good) else float("nan")


def _rms(difference: Array) -> float:
    return float(np.sqrt(_mean(np.sum(difference**2, axis=1))))


def _filtered_before(recording: Recording, lab: Array, notes: list[str]) -> bool:
    """Whether markers or forces were low-passed before they came to us; the notes say which."""
    plates = [p for p in recording.plates if len(p.time) > 1]
    loaded = [(np.where(np.isfinite(p.cop[:, :1]), p.force, np.nan).T, (len(p.time) - 1) / float(np.ptp(p.time))) for p in plates]
    tracks = list(recording.markers.values()) or ([lab] if np.isfinite(lab).any() else [])
    found = []
    if noise_band.most_are_empty((t[:, k] for t in tracks for k in range(3)), recording.rate, noise_band.EMPTY_MARKER):
        found.append("markers" if recording.markers else "CoM")
    if any(noise_band.most_are_empty(force, rate, noise_band.EMPTY_FORCE) for force, rate in loaded):
        found.append("forces")
    if found:
        notes.append(f"the {' and '.join(found)} were low-passed before they came to us: no noise is left in the upper band")
    return bool(found)


def _limitations(recording: Recording, frame: body.Body | None, force: Forces, method: str) -> list[str]:
    """What this trial cannot tell, in words."""
    out = []
    shear = np.isfinite(force.grf[:, :2]).any()
    if not np.isfinite(force.zmp).any():
        out.append("no centre of pressure: the plant equation cannot be judged")
    elif not np.isfinite(force.grf[:, 2]).any():
        out.append("CoP without forces: sway of the CoP can be described, the plant equation cannot be judged")
    elif not shear:
        out.append("no shear force: x'' - F/m and unmeasured pushes cannot be seen")
    if method == "none":
        why = "no marker set fits the labels" if frame is None and recording.markers else "no markers of a whole body"
        if frame is not None and frame.share < body.MIN_MASS:
            why = f"segments of only {frame.share:.0%} of body mass have markers, {body.MIN_MASS:.0%} are needed"
        out.append(f"no CoM: {why}, no CoM in the file" + ("" if shear else ", and no shear force to integrate"))
    if method == "force":
        out.append(f"the CoM comes from the same forces as the ZMP: below about {CROSSOVER:g} Hz it follows the CoP by assumption")
    if method == "lab":
        out.append("the CoM is the file's own: how it was made is not known here")
    return out


# -- a part -----------------------------------------------------------------------------------------------------------


def of_part(
    recordings: Iterable[Recording], people: Mapping[str, Participant], markers: str, *, cutoff: float, masses: Mapping[str, float],
    own: Callable[[str], tuple[Array, Array] | None] = lambda trial: None,
) -> tuple[pd.DataFrame, pd.DataFrame]:  # fmt: skip
    """Tables `signals` and `coverage` of whole subjects.

    people: rows of participants.tsv by subject.  markers: path of a markerset.yaml, the name of a built-in set, or "auto".  masses:
    from `subject_masses`.  own: trial -> the subject's own CoM, by all its trials and by the others [m], each (n, 3), None
    where there is none.  A trial that is too slow for the cut-off has a row in `coverage` that says so, and no signals.
    """
    frames, rows = [], []
    for recording in recordings:
        subject = recording.trial.subject
        person = people.get(subject, Participant(subject))
        chosen = choose(markers, recording.markers)
        try:
            mass = masses.get(subject, math.nan)
            made = signals(recording, person, chosen, cutoff=cutoff, subject_mass=mass, own=own(recording.trial.trial))
        except Refused as refusal:
            rows.append(_no_signals(recording.trial, cutoff, refusal))
            continue
        frames.append(made.frames)
        rows.append(made.coverage | {"notes": json.dumps(made.notes, ensure_ascii=False)})
    return joined("signals", frames), joined("coverage", [pd.DataFrame(rows)] if rows else [])


def subject_masses(trials: pd.DataFrame) -> dict[str, float]:
    """Body mass of each subject [kg]: the median of what the plates say in its trials (columns `subject`, `mass`); NaN where none does."""
    return {str(s): float(m) for s, m in trials.groupby("subject")["mass"].median().items()}


def own_com(rows_of: Callable[[str], pd.DataFrame]) -> Callable[[str], tuple[Array, Array] | None]:
    """Trial -> the subject's own CoM, by all its trials and by the others [m], each (n, 3); None where there is none.

    rows_of: trial -> its rows of table `sesc`.
    """

    def of(trial: str) -> tuple[Array, Array] | None:
        rows = rows_of(trial)
        one, two = (rows[[f"{name}_{a}" for a in "xyz"]].to_numpy() for name in ("com_sesc", "com_others"))
        return (one, two) if len(rows) else None

    return of


def _no_signals(trial: Trial, cutoff: float, refusal: Refused) -> dict[str, Any]:
    blank: dict[str, Any] = {c.name: {"str": "", "float": math.nan, "bool": False}[c.kind] for c in TABLES["coverage"]}
    said = f"{refusal.message}; {refusal.hint}"
    return blank | _key_of(trial) | {"com_method": "none", "cutoff": cutoff, "limitation": said, "notes": "[]"}
