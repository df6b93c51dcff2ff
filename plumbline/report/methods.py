"""A methods paragraph to paste into a paper: what was done with these recordings, in numbers, with versions and sources."""

import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import pandas as pd

from plumbline import __version__
from plumbline.report.controller import results
from plumbline.report.missing import sizes
from plumbline.report.words import number, plural, pooled

OWN = "markerset"  # name of a marker set that came with the study
PACKAGES = ("numpy", "scipy", "pandas", "pyarrow", "ezc3d", "matplotlib", "bokeh", "snakemake")

MURAI = (
    "Murai N, Kaneta D, Sugihara T (2013) Identification of a piecewise controller of lateral human standing based on returning "
    "recursive-least-square method. IEEE/RSJ International Conference on Intelligent Robots and Systems."
)
LEVA = "de Leva P (1996) Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters. Journal of Biomechanics 29:1223-1230."
BENJAMINI = "Benjamini Y, Hochberg Y (1995) Controlling the false discovery rate. J. Royal Statistical Society B 57:289-300."
LIANG = "Liang KY, Zeger SL (1986) Longitudinal data analysis using generalized linear models. Biometrika 73:13-22."
LJUNG = "Ljung L (1999) System Identification: Theory for the User, 2nd edition. Prentice Hall."
KING = "King DL, Zatsiorsky VM (1997) Extracting gravity line displacement from stabilographic recordings. Gait & Posture 6:27-38."
MOELDER = "M\u00f6lder F et al. (2021) Sustainable data analysis with Snakemake. F1000Research 10:33."


def versions() -> str:
    """Versions of what made the results."""
    return f"plumbline {__version__}, Python {platform.python_version()}, " + ", ".join(f"{p} {_version(p)}" for p in PACKAGES)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "(not installed)"


def references(tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Sources of the methods that were used."""
    used = set(tables["coverage"]["com_method"])
    built_in = set(tables["coverage"].loc[tables["coverage"]["com_method"] == "table", "marker_set"]) - {OWN}
    law = [LJUNG] if len(tables["controller"]) else []
    searched = [BENJAMINI] if len(tables.get("candidates", ())) else []
    return [MURAI, *([LEVA] if built_in else []), *([KING] if "force" in used else []), *law, *searched, LIANG, MOELDER]


def paragraphs(tables: Mapping[str, pd.DataFrame], verdict: Mapping[str, Any], config: Mapping[str, Any]) -> list[str]:
    """The paragraphs."""
    return [
        " ".join([_recordings(tables, config), _com(tables["coverage"]), _filter(config)]),
        " ".join([_model(config["evaluation"]), _judging(config["evaluation"]), _loci(tables)]),
        *([_search(tables["candidates"])] if len(tables.get("candidates", ())) else []),
        *([_controller(tables)] if len(tables["controller"]) else []),
        " ".join([*(_result(a, verdict, tables["ladder"]) for a in ("lateral", "forward")), f"Software: {versions()}."]),
    ]


def _recordings(tables: Mapping[str, pd.DataFrame], config: Mapping[str, Any]) -> str:
    trials = tables["trials"]
    used = trials[trials["reason"] == ""]
    tasks = ", ".join(f"{task} ({n})" for task, n in sorted(used["task"].value_counts().items()))
    rates = " and ".join(f"{r:.0f}" for r in sorted(used["rate"].round().dropna().unique())[:6])
    said = f"Recordings were processed with plumbline {__version__}. Of {plural(len(used), 'trial')} of "
    said += f"{plural(used['subject'].nunique(), 'subject')} ({tasks or 'none'}; {rates or 'no'} Hz), "
    said += f"{plural(int((tables['coverage']['com_method'] != 'none').sum()), 'trial')} had a centre of mass (CoM); "
    said += f"{plural(len(tables['exclusions']), 'file')} could not be used."
    samples = (used["markers"] * used["frames"]).sum()
    if samples:
        said += f" Marker gaps of up to {config['recording']['max_gap']:g} s were interpolated ("
        said += f"{100 * used['filled'].sum() / samples:.2f} % of the samples)."
    return said


def _com(coverage: pd.DataFrame) -> str:
    said = []
    for method, rows in coverage.groupby("com_method", sort=True):
        if method == "table":
            least = rows["mass_share"].min()
            share = "the whole body has segments" if least > 0.995 else f"segments cover at least {100 * least:.0f} % of body mass"
            said.append(f"from segments ({_sets(rows)}; {share})")
        elif method == "lab":
            said.append("as the files hold it")
        elif method == "force":
            said.append("by band-limited double integration of the ground reaction, held in place by the centre of pressure")
    text = "The CoM was taken " + "; ".join(said) + "." if said else "No CoM could be computed."
    lab = coverage["lab_distance"].dropna()
    if len(lab):
        text += f" It lay {1e3 * lab.median():.0f} mm (median over {plural(len(lab), 'trial')}) from the CoM that the files hold."
    return text + " The zero-moment point (ZMP) is the net centre of pressure in the ground plane."


def _sets(coverage: pd.DataFrame) -> str:
    """Which segments: those of a built-in marker set are de Leva's, those of markerset.yaml may be anybody's."""
    names = sorted(set(coverage["marker_set"]) - {"", OWN})
    built_in = [f"tables of de Leva 1996, marker set {', '.join(names)}"] if names else []
    return "; ".join(built_in + (["numbers of the study's own markerset.yaml"] if OWN in set(coverage["marker_set"]) else []))


def _filter(config: Mapping[str, Any]) -> str:
    corner = config["signals"]["cutoff"]
    return (
        "For figures, signals were low-passed over the continuous recording by a second-order Butterworth filter run forwards and "
        f"backwards (zero phase; -3 dB at {corner:g} Hz after both passes). The model was fitted and judged on unfiltered signals."
    )


def _model(evaluation: Mapping[str, Any]) -> str:
    width, k = evaluation["half_width"], evaluation["exponent"]
    said = (
        "The CoM-ZMP model x'' = \u03c9\u00b2 (x - xZ) (Murai et al. 2013) was identified in weak form: both sides were integrated with "
        f"test functions (1 - s\u00b2)^{k} of half width {width:g} s that touch no push, no gap and no end, the derivative being moved to "
        "the test function, so that noise is not amplified. \u03c9\u00b2 was estimated per axis and subject by least squares with a free "
        "constant beside it; its 95 % interval is clustered by the stretches between pushes (Liang and Zeger 1986)."
    )
    if evaluation["w2"] == "height":
        said += " For judging, \u03c9\u00b2 was not the fitted one but g/z at the mean height of the CoM."
    return said


def _judging(evaluation: Mapping[str, Any]) -> str:
    if evaluation["train"] or evaluation["test"]:
        train = ", ".join(evaluation["train"]) or "all others"
        split = f"trained on {train}, judged on {', '.join(evaluation['test'])}"
    else:
        split = "whole trials of a subject left out in eight folds, one by one where there are fewer"
    said = f"The error is the rms of (x - xZ) - x''/\u03c9\u00b2 on trials the model had not seen ({split}), as a distance of the ZMP"
    said += ", after taking off a constant fitted on the training trials" if evaluation["offset"] == "train" else ", without the constant"
    return (
        said + "; its 95 % interval comes from resampling whole trials. The noise floor is the white noise of CoM and ZMP, estimated from "
        "fourth differences, carried through the same test functions."
    )


def _search(candidates: pd.DataFrame) -> str:
    count = int((candidates["status"] != "lacking").groupby(candidates["effect"]).any().sum())
    return (
        f"What the equation lacks was searched for among {plural(count, 'listed effect')}, alone and in small sets, in the weak form of "
        "the equation; where the shear force was recorded the kinematic side (x'' against Fx/m) and the moment side were judged apart. An "
        "effect is named where it differs from zero beyond chance (false discovery rate over the list below 5 %, Benjamini and Hochberg "
        "1995; covariance from whole trials left out), lowers the error on trials left out by an amount that matters against the noise "
        "floor, and has a size and sign that are physically possible. Effects that these data cannot tell apart are named together."
    )


def _loci(tables: Mapping[str, pd.DataFrame]) -> str:
    pushes, loci = tables["pushes"], tables["loci"]
    if pushes.empty and loci.empty:
        return "No push and no locus was marked or found."
    marked = int((pushes["source"] == "event").sum())
    return (
        f"{plural(len(pushes), 'push')} ({marked} marked, {len(pushes) - marked} found in the data) were masked; "
        f"{plural(len(loci), 'locus')} followed."
    )


def _controller(tables: Mapping[str, pd.DataFrame]) -> str:
    gains, trust = tables["clusters"]["gains"], tables["trust"]
    said = (
        "The law xZ = d + k1 (x - d) + k2 x' within the limits of the ZMP (Murai et al. 2013) was identified from the loci of one subject, "
        "task and condition together, lateral axis, unfiltered. Frames at the left limit, inside and at the right limit were told apart by "
        "change points, any number per locus, with noise pooled over the loci"
    )
    said += "; switches that a person had marked override them. " if trust["mark"].notna().any() else ". "
    said += (
        "Beside them stands the rule of Murai et al. made numeric: recursive least squares runs forward along a locus and returns from "
        "its end, and another law begins where the returning estimate begins to stray. Loci were clustered by \u03c9; the number of "
        "clusters is the one that predicts loci left out. d, k1 and k2 were estimated by output error (Ljung 1999, section 7.3), that is, "
        "such that the simulated closed loop follows the measured CoM and ZMP, from the loci that do not fall; "
        "limits are means of the ZMP at them"
        ", left and right apart. 95 % intervals leave out locus by locus (jackknife; t distribution) and take ω as known."
    )
    found = results(tables["controller"])
    if not found:
        return f"{said} The gains could not be told."
    return f"{said} {int(gains.sum())} of {plural(len(gains), 'locus')} were used for the gains. Found: {'; '.join(found)}."


def _result(axis: str, verdict: Mapping[str, Any], ladder: pd.DataFrame) -> str:
    plant, rung = verdict["by_axis"][axis]["plant"], pooled(ladder, axis, "weak")
    if plant["base_error_mm"] is None:
        return f"The {axis} error could not be stated ({plant['reason']})."
    said = f"The {axis} held-out error was {number(plant['base_error_mm'])} mm"
    if rung and rung["ci_low_mm"] == rung["ci_low_mm"]:
        said += f" (95 % interval {number(rung['ci_low_mm'])} to {number(rung['ci_high_mm'])} mm)"
    floor = plant["noise_floor_mm"]
    said += f", the noise floor {number(floor)} mm." if floor else "; the noise floor is not known."
    if plant["missing"] is None:
        return said
    names = [f"{m['effect'] or ' or '.join(m['family'])} ({sizes(m)})" for m in plant["missing"]]
    left = ["structure that no listed effect explains"] if plant["unexplained"] else []
    if not names and not left:
        return f"{said} No listed effect was found to be missing."
    return f"{said} Found to be missing: {', '.join(names + left)}."
