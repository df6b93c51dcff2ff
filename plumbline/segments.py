"""Segment parameters by named table: where a segment's mass sits between two landmarks, and how it is spread.

Source: de Leva P. (1996) Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters. J Biomech 29:1223-1230, table 4 and
its list of alternative end points. Masses are shares of the body; the CoM and the radii of gyration are shares of the distance
between the two landmarks, the CoM counted from the first of them. Radii are about the segment's sagittal (back to front),
transverse (left to right) and longitudinal axes through its CoM.
"""

from typing import NamedTuple

from plumbline.errors import PlumblineError


class Numbers(NamedTuple):
    """One segment's parameters, all shares [1]; longitudinal is NaN where not known."""

    mass: float
    com: float
    sagittal: float
    transverse: float
    longitudinal: float


class Row(NamedTuple):
    """One row of a table: its landmarks and its numbers for each sex."""

    proximal: str
    distal: str
    female: Numbers
    male: Numbers


#: landmark -> where it is
LANDMARKS = {
    "VERT": "uppermost part of the head",
    "MIDG": "midway between the two gonia (angles of the jaw)",
    "CERV": "spine of the 7th cervical vertebra",
    "SUPR": "suprasternal notch",
    "XYPH": "lower end of the sternum",
    "OMPH": "navel",
    "MIDS": "midway between the shoulder joint centres",
    "MIDH": "midway between the hip joint centres",
    "SJC": "shoulder joint centre",
    "EJC": "elbow joint centre",
    "WJC": "wrist joint centre",
    "STYL": "styloid process of the radius",
    "MET3": "knuckle of the third finger",
    "DAC3": "tip of the third finger",
    "HJC": "hip joint centre",
    "KJC": "knee joint centre",
    "AJC": "ankle joint centre",
    "LMAL": "lateral malleolus",
    "SPHY": "tip of the tibia below the medial malleolus",
    "HEEL": "rearmost point of the heel",
    "TTIP": "tip of the longest toe",
}


def _row(proximal: str, distal: str, *percent: float) -> Row:
    """percent: female then male of mass, CoM, sagittal, transverse, longitudinal, in the order of the paper."""
    shares = [p / 100.0 for p in percent]
    return Row(proximal, distal, Numbers(*shares[0::2]), Numbers(*shares[1::2]))


#                             mass F   M     CoM F   M      sagittal F, M  transverse F, M  longitudinal F, M
DE_LEVA: dict[str, Row] = {
    "head": _row("VERT", "MIDG", 6.68, 6.94, 58.94, 59.76, 33.0, 36.2, 35.9, 37.6, 31.8, 31.2),
    "head-c7": _row("VERT", "CERV", 6.68, 6.94, 48.41, 50.02, 27.1, 30.3, 29.5, 31.5, 26.1, 26.1),
    "trunk": _row("SUPR", "MIDH", 42.57, 43.46, 41.51, 44.86, 35.7, 37.2, 33.9, 34.7, 17.1, 19.1),
    "trunk-c7": _row("CERV", "MIDH", 42.57, 43.46, 49.64, 51.38, 30.7, 32.8, 29.2, 30.6, 14.7, 16.9),
    "trunk-shoulders": _row("MIDS", "MIDH", 42.57, 43.46, 37.82, 43.10, 37.9, 38.4, 36.1, 35.8, 18.2, 19.7),
    "upper-trunk": _row("SUPR", "XYPH", 15.45, 15.96, 20.77, 29.99, 74.6, 71.6, 50.2, 45.4, 71.8, 65.9),
    "upper-trunk-c7": _row("CERV", "XYPH", 15.45, 15.96, 50.50, 50.66, 46.6, 50.5, 31.4, 32.0, 44.9, 46.5),
    "middle-trunk": _row("XYPH", "OMPH", 14.65, 16.33, 45.12, 45.02, 43.3, 48.2, 35.4, 38.3, 41.5, 46.8),
    "lower-trunk": _row("OMPH", "MIDH", 12.47, 11.17, 49.20, 61.15, 43.3, 61.5, 40.2, 55.1, 44.4, 58.7),
    "upper-arm": _row("SJC", "EJC", 2.55, 2.71, 57.54, 57.72, 27.8, 28.5, 26.0, 26.9, 14.8, 15.8),
    "forearm": _row("EJC", "WJC", 1.38, 1.62, 45.59, 45.74, 26.1, 27.6, 25.7, 26.5, 9.4, 12.1),
    "forearm-stylion": _row("EJC", "STYL", 1.38, 1.62, 45.92, 46.08, 26.3, 27.8, 25.9, 26.7, 9.5, 12.2),
    "hand": _row("WJC", "MET3", 0.56, 0.61, 74.74, 79.00, 53.1, 62.8, 45.4, 51.3, 33.5, 40.1),
    "hand-fingertip": _row("WJC", "DAC3", 0.56, 0.61, 34.27, 36.24, 24.4, 28.8, 20.8, 23.5, 15.4, 18.4),
    "hand-stylion": _row("STYL", "MET3", 0.56, 0.61, 75.34, 79.48, 51.9, 61.4, 44.3, 50.2, 32.7, 39.2),
    "hand-stylion-fingertip": _row("STYL", "DAC3", 0.56, 0.61, 35.02, 36.91, 24.1, 28.5, 20.6, 23.3, 15.2, 18.2),
    "thigh": _row("HJC", "KJC", 14.78, 14.16, 36.12, 40.95, 36.9, 32.9, 36.4, 32.9, 16.2, 14.9),
    "shank": _row("KJC", "AJC", 4.81, 4.33, 43.52, 43.95, 26.7, 25.1, 26.3, 24.6, 9.2, 10.2),
    "shank-malleolus": _row("KJC", "LMAL", 4.81, 4.33, 44.16, 44.59, 27.1, 25.5, 26.7, 24.9, 9.3, 10.3),
    "shank-sphyrion": _row("KJC", "SPHY", 4.81, 4.33, 44.81, 45.24, 27.5, 25.8, 27.1, 25.3, 9.4, 10.5),
    "foot": _row("HEEL", "TTIP", 1.29, 1.37, 40.14, 44.15, 29.9, 25.7, 27.9, 24.5, 13.9, 12.4),
}

TABLES = {"de-leva-1996": DE_LEVA}


def row(name: str) -> Row:
    """A row by its full name, e.g. ``de-leva-1996/thigh``.  Raises PlumblineError naming what exists."""
    table, _, segment = name.partition("/")
    if table not in TABLES:
        raise PlumblineError(f"table '{name}': unknown segment table '{table}'; known: {', '.join(TABLES)}")
    if segment not in TABLES[table]:
        raise PlumblineError(f"table '{name}': no row '{segment}'; rows of {table}: {', '.join(TABLES[table])}")
    return TABLES[table][segment]


def numbers(name: str, sex: str) -> Numbers:
    """Parameters of a row for ``sex`` "M" or "F"; "" gives the mean of both.  Raises PlumblineError."""
    found = row(name)
    if sex == "":
        return Numbers(*((f + m) / 2.0 for f, m in zip(found.female, found.male, strict=True)))
    if sex not in ("M", "F"):
        raise PlumblineError(f"sex '{sex}': the segment tables know 'M', 'F' and '' (the mean of both)")
    return found.male if sex == "M" else found.female
