"""Every table the pipeline writes: column, unit, meaning; and the one way to write and read it.

Files are parquet. Units stand in each column's metadata (``unit``, ``meaning``); the file's own metadata holds the table's
name, the digest of the code that made it and the config section it was made with (both JSON under ``plumbline``).
"""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from plumbline.errors import PlumblineError


class Column(NamedTuple):
    """One column: its pandas/arrow type, its SI unit ("" for none, "1" for a ratio) and its meaning."""

    name: str
    kind: str  # str, int, float, bool
    unit: str
    meaning: str


def _c(name: str, kind: str, unit: str, meaning: str) -> Column:
    return Column(name, kind, unit, meaning)


def _xyz(prefix: str, unit: str, meaning: str) -> list[Column]:
    return [_c(f"{prefix}_{a}", "float", unit, f"{meaning}, {w}") for a, w in zip("xyz", ("right", "forward", "up"), strict=True)]


def _with_interval(name: str, unit: str, meaning: str) -> list[Column]:
    ends = (("low", "lower end of its 95 % interval"), ("high", "upper end"))
    return [_c(name, "float", unit, meaning), *[_c(f"{name}_{end}", "float", unit, text) for end, text in ends]]


KEY = [
    _c("trial", "str", "", "file name without ending; unique in a study"),
    _c("subject", "str", "", "participant_id, with sub-"),
    _c("task", "str", "", "BIDS task"),
    _c("condition", "str", "", "BIDS acq, empty where none"),
]

TABLES: dict[str, list[Column]] = {
    # -- recording: what the files hold, in SI and in the axes x right, y forward, z up
    "trials": [
        *KEY,
        _c("session", "str", "", "BIDS ses, empty where none"),
        _c("run", "str", "", "BIDS run"),
        _c("files", "str", "", "the files of this trial, below raw/, joined by ' + '"),
        _c("events", "str", "", "the events as JSON, list of [onset s, duration s, trial_type]; empty where no file"),
        _c("rate", "float", "Hz", "rate of the frames"),
        _c("force_rate", "float", "Hz", "rate of the plates, NaN without plates"),
        _c("frames", "int", "", "number of frames"),
        _c("duration", "float", "s", "last time minus first"),
        _c("markers", "int", "", "markers with any valid frame"),
        _c("plates", "int", "", "force plates that carry a load"),
        _c("corners", "str", "", "corners of each of these plates [m], JSON list of four [x, y, z] or null"),
        _c("filled", "int", "", "marker samples filled across gaps"),
        _c("missing", "int", "", "marker samples still missing"),
        _c("axes", "str", "", "what the pipeline's axes are in the file, e.g. x=+Z y=+X z=+Y"),
        _c("axes_from", "str", "", "config, or what they were found from"),
        _c("force_sign", "float", "1", "factor that made the vertical force a reaction (+1 or -1)"),
        _c("shear_sign", "float", "1", "factor on the shear forces beside force_sign (+1 or -1)"),
        _c("mass", "float", "kg", "body mass from the plates, NaN where not known"),
        _c("reason", "str", "", "empty where the trial was read, else the reason code"),
        _c("message", "str", "", "what was wrong and where"),
        _c("hint", "str", "", "what to do"),
        _c("notes", "str", "", "what was assumed or found odd, JSON list"),
    ],
    "markers": [
        *KEY[:2],
        _c("frame", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "the file's own time"),
        _c("marker", "str", "", "label; derived points start with '@' (e.g. @CentreOfMass)"),
        _c("x", "float", "m", "position, right"),
        _c("y", "float", "m", "position, forward"),
        _c("z", "float", "m", "position, up"),
        _c("filled", "bool", "", "interpolated across a gap"),
    ],
    "plates": [
        *KEY[:2],
        _c("plate", "int", "", "from 1, in the file's order"),
        _c("foot", "str", "", "left, right or empty"),
        _c("sample", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "the file's own time"),
        *_xyz("force", "N", "ground reaction on the person"),
        *_xyz("moment", "N m", "its moment about the coordinates' origin, component about the axis; NaN where a load has no valid CoP"),
        *_xyz("cop", "m", "centre of pressure on the plate's surface; NaN while unloaded"),
        _c("free_moment", "float", "N m", "vertical moment about the CoP; NaN while unloaded"),
    ],
    # -- signals: one row per frame
    "signals": [
        *KEY,
        _c("frame", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "the file's own time"),
        *_xyz("com", "m", "CoM, unfiltered, by the method named in `coverage`"),
        *_xyz("com_table", "m", "CoM from the segment table, unfiltered"),
        *_xyz("com_force", "m", "CoM by double integration of the force (band-limited; mean from the CoP)"),
        *_xyz("com_lab", "m", "CoM as the file itself holds it"),
        *_xyz("grf", "N", "net ground reaction, unfiltered"),
        *_xyz("zmp", "m", "net centre of pressure in the ground plane, unfiltered"),
        *_xyz(
            "ang_mom",
            "kg m2/s",
            "angular momentum of the segments about the CoM (unfiltered positions), vector component",
        ),
        *_xyz("cop_left", "m", "CoP under the left foot"),
        *_xyz("cop_right", "m", "CoP under the right foot"),
        *_xyz("grf_left", "N", "reaction under the left foot"),
        *_xyz("grf_right", "N", "reaction under the right foot"),
        _c("limit_left", "float", "m", "left border of the support, x"),
        _c("limit_right", "float", "m", "right border of the support, x"),
        _c("limit_back", "float", "m", "rear border of the support, y"),
        _c("limit_front", "float", "m", "front border of the support, y"),
        *_xyz("com_lp", "m", "CoM, low-passed"),
        *_xyz("com_dot", "m/s", "velocity of the low-passed CoM"),
        *_xyz("com_ddot", "m/s2", "acceleration of the low-passed CoM"),
        *_xyz("zmp_lp", "m", "ZMP, low-passed"),
        _c("edge", "bool", "", "filtered columns are within the filter's reach of an end or a gap"),
        _c("filled", "bool", "", "a marker behind the CoM was filled across a gap"),
    ],
    "coverage": [
        *KEY,
        _c("com_method", "str", "", "table, lab, force or none: which CoM the columns com_* hold"),
        _c("marker_set", "str", "", "name of the marker set used, empty where none fits"),
        _c("mass_share", "float", "1", "share of body mass that has segments"),
        _c("missing_segments", "str", "", "segments without their markers, with the markers named"),
        _c("mass", "float", "kg", "body mass used: from the plates, else participants.tsv"),
        _c("height_com", "float", "m", "mean height of the CoM above the plates' surface"),
        _c(
            "lab_distance",
            "float",
            "m",
            "rms distance of the table's CoM from the lab's own, horizontal and vertical together",
        ),
        _c("support", "str", "", "what the support limits came from: markers, plates or none"),
        _c("cutoff", "float", "Hz", "corner of the low-pass after the double pass"),
        _c("filtered_before", "bool", "", "the file was low-passed before it came to us: its noise cannot be told"),
        _c("limitation", "str", "", "what cannot be judged with this trial and why; empty where all can"),
        _c("notes", "str", "", "what was assumed or found odd, JSON list"),
    ],
    # -- loci: one row per locus
    "loci": [
        *KEY,
        _c("locus", "int", "", "from 1 within the trial"),
        _c("start", "float", "s", "first instant, the file's own time"),
        _c("end", "float", "s", "last instant"),
        _c("start_frame", "int", "", "first frame"),
        _c("end_frame", "int", "", "last frame, included"),
        _c("kind", "str", "", "recovering, recovering_from_beyond, falling or unrecovered"),
        _c("side", "str", "", "left or right: where the CoM is farthest from its reference"),
        _c("source", "str", "", "event or found"),
        _c("reference", "float", "m", "lateral position the person keeps when nothing happens"),
    ],
    # -- pushes: windows in which an unmeasured force acts; masked in every plant equation
    "pushes": [
        *KEY,
        _c("start", "float", "s", "first instant"),
        _c("end", "float", "s", "last instant"),
        _c("source", "str", "", "event or found"),
        _c("peak", "float", "N", "largest external force in the window, NaN without shear"),
    ],
    # -- trust: regimes of each locus and the switches between them; returning RLS frame by frame
    "trust": [
        *KEY,
        _c("locus", "int", "", "number within the trial"),
        _c("part", "int", "", "number of the regime within the locus, from 1"),
        _c("regime", "str", "", "left or right: the ZMP is at that limit; inside: the law rules"),
        _c("start", "float", "s", "first instant: a switch, or the first used of the locus (0.08 s after a push)"),
        _c("end", "float", "s", "last instant"),
        _c("start_frame", "int", "", "first frame"),
        _c("end_frame", "int", "", "last frame, included"),
        _c("source", "str", "", "of the start: start (of the locus), found, or event (a person's mark)"),
        _c("found", "float", "s", "switch as found by change point, also where a mark overrides it; NaN at the start of a locus"),
        _c("rls", "float", "s", "the same switch by the returning-RLS rule; NaN where the rule sees none"),
        _c("mark", "float", "s", "`switch` event that belongs to this switch, NaN where none"),
        _c("mark_distance", "float", "s", "found minus mark"),
    ],
    "rls": [
        *KEY[:2],
        _c("locus", "int", "", "number within the trial"),
        _c("frame", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "the file's own time"),
        *[
            _c(f"{name}_{way}", "float", unit, f"{name} {text}")
            for name, unit in (("omega", "rad/s"), ("k1", "1"), ("k2", "s"))
            for way, text in (
                ("forward", "from the locus' start to this frame"),
                ("backward", "from its end back to this frame"),
                ("sd", "standard deviation of the backward pass, pooled noise, correlation counted"),
            )
        ],
        _c("stray", "float", "1", "what the pass that looks for the switch has not expected, in its standard deviations"),
    ],
    # -- clusters: loci by omega, and the controller of each cluster
    "clusters": [
        *KEY,
        _c("locus", "int", "", "number within the trial"),
        _c("kind", "str", "", "kind of the locus"),
        _c("reach", "float", "m", "farthest CoM from the reference"),
        _c("omega", "float", "rad/s", "natural frequency from this locus alone; NaN where it cannot be told"),
        _c("omega_low", "float", "rad/s", "lower end of its 95 % interval"),
        _c("omega_high", "float", "rad/s", "upper end"),
        _c("cluster", "int", "", "from 1 in ascending omega; 0 without an estimate"),
        _c("share", "float", "1", "probability that the locus belongs to this cluster and no other"),
        _c("gains", "bool", "", "the locus was used for the gains"),
        _c("note", "str", "", "why it was not, or what of it; empty where it was, whole"),
    ],
    "choice": [
        _c("subject", "str", "", "participant_id, with sub-"),
        _c("task", "str", "", "task"),
        _c("condition", "str", "", "condition, empty where none"),
        _c("number", "int", "", "number of clusters tried"),
        _c("score", "float", "1", "mean log density of w2 of loci left out [log s2]"),
        _c("gain_se", "float", "1", "standard error of the gain over one cluster fewer; NaN for one"),
        _c("chosen", "bool", "", "the number used"),
    ],
    "controller": [
        _c("subject", "str", "", "participant_id, with sub-"),
        _c("task", "str", "", "task"),
        _c("condition", "str", "", "condition, empty where none"),
        _c("cluster", "int", "", "cluster of omega where there are several; 0: all loci of the group, where there is one"),
        _c("method", "str", "", "output error, output error with delay, instruments, saturation (least squares, the counter-example)"),
        *_with_interval("omega", "rad/s", "natural frequency, batch least squares over the cluster"),
        *_with_interval("reference", "m", "position d that the law returns to"),
        *_with_interval("k1", "1", "gain on the position"),
        *_with_interval("k2", "s", "gain on the velocity"),
        *_with_interval("limit_left", "m", "left limit of the ZMP; NaN where never reached"),
        *_with_interval("limit_right", "m", "right limit of the ZMP; NaN where never reached"),
        *_with_interval("delay", "s", "age of the state in the law; NaN where not fitted"),
        _c("q1_real", "float", "1", "real part of q1; the closed loop's poles are -omega q; NaN with a delay, which has endless poles"),
        _c("q1_imag", "float", "1", "imaginary part of q1"),
        _c("q2_real", "float", "1", "real part of q2"),
        _c("q2_imag", "float", "1", "imaginary part of q2"),
        _c("feedback_sd", "float", "m", "rms of p - law inside the limits"),
        _c("error", "float", "m", "rms of simulated against measured CoM; NaN where not simulated"),
        _c("loci", "int", "", "loci used for the gains"),
        _c("warning", "str", "", "empty, or why the row should not be trusted"),
    ],
    # -- fit: the base model per locus, condition and subject
    "fit": [
        _c("subject", "str", "", "participant_id, with sub-"),
        _c("axis", "str", "", "lateral or forward"),
        _c("level", "str", "", "what was fitted together: locus, condition or subject; trial: left out, see warning"),
        _c("task", "str", "", "task of the locus; empty where pooled"),
        _c("condition", "str", "", "condition; empty where pooled or where none"),
        _c("trial", "str", "", "trial of the locus; empty where pooled"),
        _c("locus", "int", "", "number of the locus; 0 where pooled"),
        _c("omega", "float", "rad/s", "natural frequency of the CoM over the ZMP"),
        _c("omega_low", "float", "rad/s", "lower end of the 95 % interval"),
        _c("omega_high", "float", "rad/s", "upper end of the 95 % interval"),
        _c("w2", "float", "1/s2", "omega squared"),
        _c("w2_se", "float", "1/s2", "standard error of w2, clustered"),
        _c("offset", "float", "m", "constant fitted beside w2, as a distance of the ZMP"),
        _c("omega_height", "float", "rad/s", "sqrt(g / z) at the mean height of the CoM, for comparison"),
        _c("windows", "int", "", "test functions used"),
        _c("rejected", "int", "", "test functions that met a push, a gap or an end"),
        _c("clusters", "int", "", "independent pieces behind the interval"),
        _c("clustered_by", "str", "", "what the pieces are: locus (stretches between pushes) or block"),
        _c("condition_number", "float", "1", "of the two-column regression"),
        _c("rms", "float", "m", "rms of the residual as ZMP, constant included, in sample"),
        _c("warning", "str", "", "empty, or why omega should not be trusted"),
    ],
    "heldout": [
        *KEY,
        _c("axis", "str", "", "lateral or forward"),
        _c("fold", "int", "", "fold in which the trial was left out; 0 where the config names the test trials"),
        _c("w2", "float", "1/s2", "w2 of the base model, from the other trials"),
        _c("offset", "float", "m", "constant taken off (evaluation.offset: train), else 0"),
        _c("windows", "int", "", "test functions judged"),
        _c("square_sum", "float", "m2", "sum of squares of the weak residual as ZMP"),
        _c("noise_variance", "float", "m2", "what sensor noise alone gives per window; NaN where not identifiable"),
        _c("free_run_frames", "int", "", "frames of the free run"),
        _c("free_run_square_sum", "float", "m2", "sum of squares of free-run CoM minus measured CoM"),
    ],
    # -- residuals: one row per frame and axis, at the held-out w2; bump-weighted means and derivatives
    "residuals": [
        *KEY,
        _c("axis", "str", "", "lateral or forward"),
        _c("frame", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "the file's own time"),
        _c("locus", "int", "", "number of the locus, 0 outside"),
        _c("since", "float", "s", "time since the locus began, NaN outside"),
        _c("com", "float", "m", "CoM, bump-weighted mean"),
        _c("velocity", "float", "m/s", "velocity of the CoM, bump-weighted"),
        _c("acceleration", "float", "m/s2", "x'' of the CoM, bump-weighted"),
        _c("acceleration_model", "float", "m/s2", "w2 (x - p)"),
        _c("zmp", "float", "m", "ZMP, bump-weighted mean"),
        _c("zmp_model", "float", "m", "x - x''/w2"),
        _c("r_plant", "float", "m/s2", "rP = x'' - w2 (x - p)"),
        _c("error", "float", "m", "rP as ZMP: (x - p) - x''/w2"),
        _c("r_force", "float", "m/s2", "rF = x'' - Fx/m, NaN without shear; what is wrong on the kinematic side"),
        _c("r_vertical", "float", "m/s2", "z'' + g - Fz/m; what no plate carries"),
        _c("com_measured", "float", "m", "CoM, unfiltered"),
        _c("com_free", "float", "m", "CoM that the model gives for the measured ZMP (free run), NaN outside"),
    ],
    "where": [
        *KEY[1:],
        _c("axis", "str", "", "lateral or forward"),
        _c("view", "str", "", "phase, time, trial or frequency"),
        _c("trial", "str", "", "the trial, in view trial"),
        _c("a", "float", "", "bin centre: CoM from its reference [m], time since the push [s] or frequency [Hz]"),
        _c("b", "float", "", "bin centre: velocity [m/s] in view phase"),
        _c("count", "int", "", "frames (segments in view frequency) in the bin"),
        _c("sum", "float", "", "sum of the error [m]"),
        _c(
            "square_sum",
            "float",
            "",
            "sum of squares of the error [m2]; of its power density [m2/Hz] in view frequency",
        ),
    ],
    # -- criticism: what each effect would add, window by window; what the data of a subject say; the error of each model
    "evidence": [
        *KEY,
        _c("axis", "str", "", "lateral or forward"),
        _c("frame", "int", "", "centre of the test function, from 0 within the trial"),
        _c("time", "float", "s", "from the trial's start"),
        _c("cluster", "int", "", "independent piece of the trial"),
        _c("com", "float", "m", "mean of the CoM under the test function"),
        _c("velocity", "float", "m/s", "weak velocity of the CoM"),
        _c("zmp", "float", "m", "mean of the ZMP"),
        _c("acceleration", "float", "m/s2", "weak acceleration of the CoM"),
        _c("force", "float", "m/s2", "mean of the shear force over the mass, NaN without shear"),
        _c("vertical", "float", "m/s2", "weak z'' + g less the vertical force over the mass"),
        _c("mass", "float", "kg", "body mass"),
        _c("height", "float", "m", "mean height of the CoM over the plates"),
        _c("rate", "float", "Hz", "rate of the frames"),
        _c("half_width", "float", "s", "of the test function"),
        _c("exponent", "int", "", "of the test function"),
        *[
            _c(f"noise_{k}", "float", u, f"sd of the white noise of {w}, NaN where not known")
            for k, u, w in (
                ("x", "m", "the CoM"),
                ("p", "m", "the ZMP"),
                ("z", "m", "its height"),
                ("fx", "N", "the shear"),
                ("fz", "N", "the vertical force"),
            )
        ],
        _c("feet", "float", "m", "CoP of both plates from the middles of their feet, mean of the trial"),
        _c("use", "str", "", "both, train, test or neither, as the config asks"),
        _c("centre", "str", "", "JSON: effect -> coefficients taken out of the channels first"),
        _c("lacking", "str", "", "JSON: effect -> what it needs and the trial lacks"),
    ],
    "judged": [
        _c("axis", "str", "", "lateral or forward"),
        _c("subject", "str", "", "participant_id, or all"),
        _c("trials", "int", "", "trials judged"),
        _c("pieces", "int", "", "independent pieces of at most 5 s"),
        _c("base", "float", "m", "held-out error of the paper's equation in this search"),
        _c("final", "float", "m", "held-out error with all that is missing"),
        _c("floor", "float", "m", "what sensor noise alone gives, NaN where not known"),
        _c("w2", "float", "1/s2", "g over the height of the CoM"),
        _c("h", "float", "s2", "lever per acceleration, one over the w2 found"),
        _c("over", "str", "", "JSON: equation -> residual over noise floor and usual faults"),
        _c("left", "str", "", "equations in which more is left, joined by ', '"),
        _c("shapes", "str", "", "shapes without a cause that the residual needs, joined by ', '"),
        _c("refused", "str", "", "JSON: impostors, list of [effects, error in m, reason]"),
        _c("follows", "str", "", "what the residual that is left follows, in words; empty where nothing is left"),
        _c("formulas", "str", "", "JSON: the two best formulas of that residual, in words; no known effect"),
        _c("theta", "str", "", "JSON: effect or base column -> coefficients of the last model; empty where pooled"),
        _c("reason", "str", "", "why nothing is said; empty where it is"),
    ],
    "candidates": [
        _c("axis", "str", "", "lateral or forward"),
        _c("subject", "str", "", "participant_id, or all"),
        _c("effect", "str", "", "id; empty where only a family can be told"),
        _c("status", "str", "", "found, alike, settled, idle, refused, absorbed or lacking"),
        _c("family", "str", "", "what these data cannot tell it from, itself first, joined by ', '; empty where not found"),
        _c("before", "float", "m", "held-out error without it, of what was found"),
        _c("after", "float", "m", "held-out error with it"),
        _c("fall_low", "float", "m", "lower end of the 95 % interval of the fall it brings beside what was found"),
        _c("fall_high", "float", "m", "upper end"),
        _c("q", "float", "1", "false discovery rate over the catalogue (Benjamini and Hochberg 1995)"),
        _c("vif", "float", "1", "variance inflation beside the final model"),
        _c("trials_80", "float", "", "trials that find such an effect with 80 % power"),
        _c("parameters", "str", "", "JSON: name -> value, unit, ci95"),
        _c("reason", "str", "", "why it is not named"),
    ],
    "rungs": [
        *KEY,
        _c("axis", "str", "", "lateral or forward"),
        _c("rung", "int", "", "number of the model, from 1; the paper's equation stands in `heldout`"),
        _c("model", "str", "", "its name"),
        _c("effects", "str", "", "effects in it, joined by ', '"),
        _c("windows", "int", "", "test functions"),
        _c("square_sum", "float", "m2", "sum of squared errors as ZMP"),
        _c("free_run_frames", "int", "", "frames of the free run"),
        _c("free_run_square_sum", "float", "m2", "sum of squared misses of the CoM"),
    ],
    "contributions": [
        *KEY,
        _c("axis", "str", "", "lateral or forward"),
        _c("frame", "int", "", "from 0 within the trial"),
        _c("time", "float", "s", "from the trial's start"),
        _c("com", "float", "m", "mean of the CoM under the test function"),
        _c("velocity", "float", "m/s", "weak velocity of the CoM"),
    ],
    "control": [
        _c("subject", "str", "", "participant_id, with sub-"),
        _c("task", "str", "", "task"),
        _c("condition", "str", "", "condition, empty where none"),
        _c("mode", "str", "", "loop: simulated; frame: law against measured ZMP frame by frame"),
        _c("candidate", "str", "", "effects beside the base law, joined by +; empty: the base law alone"),
        _c("trial", "str", "", "trial that was left out"),
        _c("loci", "int", "", "its loci"),
        _c("frames", "int", "", "frames simulated (50 Hz)"),
        _c("square_sum", "float", "m2", "of simulated minus measured CoM, the trial left out"),
        _c("zmp_square_sum", "float", "m2", "of simulated minus measured ZMP, the trial left out"),
        _c("score", "float", "1", "sum of squares of the ZMP's error freed of its colour, in its sd; the trial left out"),
        _c("fitted_square_sum", "float", "m2", "of the CoM, the trial not left out"),
        _c("sizes", "int", "", "parameters of the effects"),
        _c("d", "float", "m", "reference"),
        _c("k1", "float", "1", "gain on the position"),
        _c("k2", "float", "s", "gain on the velocity"),
        _c("parameters", "str", "", "JSON: effect -> parameter -> value, unit, ci95"),
        _c("refused", "bool", "", "an effect is smaller than what matters, or at the bound of what is possible"),
        _c("settled", "bool", "", "the search ended at a minimum"),
        _c("reason", "str", "", "why the group could not be judged; empty where it was"),
    ],
    # -- cohort
    "ladder": [
        _c("ledger", "str", "", "plant, control or robot"),
        _c("axis", "str", "", "lateral or forward"),
        _c("task", "str", "", "all where pooled"),
        _c("subject", "str", "", "all where pooled"),
        _c("condition", "str", "", "all where pooled"),
        _c("kind", "str", "", "weak (residual as ZMP) or free_run (CoM)"),
        _c("model", "str", "", "name of the rung"),
        _c("effects", "str", "", "effects in it, joined by ', '; empty for the paper's equation"),
        _c("error_mm", "float", "mm", "held-out rms error"),
        _c("ci_low_mm", "float", "mm", "lower end of its 95 % interval, trials resampled"),
        _c("ci_high_mm", "float", "mm", "upper end"),
        _c("noise_floor_mm", "float", "mm", "what sensor noise alone gives; NaN where not identifiable or for free_run"),
    ],
    "exclusions": [
        _c("file", "str", "", "below raw/"),
        _c("reason", "str", "", "reason code"),
        _c("message", "str", "", "what was wrong and where"),
        _c("hint", "str", "", "what to do"),
    ],
}


OPEN = {
    "evidence": ("effect.number:part, the column of a coefficient: force [m/s2] on the kinematic side, plain [m/s2] and by_w2 [m] on the "
                 "moment side, vertical [m/s2]; all per unit of the coefficient", ""),
    "contributions": ("before: error of the paper's equation; after name: error of that model; effect id: what it adds", "m"),
}  # fmt: skip
"""Tables that have columns of floats beside their own: meaning, unit."""


class Stamp(NamedTuple):
    """Who made a table: digest of the code, the config section."""

    code: str = ""
    config: Mapping[str, Any] | None = None


_ARROW = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}


def schema(name: str, more: Iterable[str] = ()) -> pa.Schema:
    """Arrow schema of a table, with unit and meaning of each column in its metadata.  more: columns of an open table."""
    meaning, unit = OPEN.get(name, ("", ""))
    columns = [*TABLES[name], *(_c(k, "float", unit, meaning) for k in more)]
    return pa.schema([pa.field(c.name, _ARROW[c.kind], metadata={"unit": c.unit, "meaning": c.meaning}) for c in columns])


def empty(name: str) -> pd.DataFrame:
    """A table without rows."""
    return pd.DataFrame(schema(name).empty_table().to_pandas())


def joined(name: str, parts: Iterable[pd.DataFrame]) -> pd.DataFrame:
    """One table of several pieces; the table without rows where all are empty."""
    rows = [p for p in parts if len(p)]
    return pd.concat(rows, ignore_index=True) if rows else empty(name)


NO_STAMP = Stamp()


class Writer:
    """Writes a table piece by piece, so that a part need not fit into memory.

    The file gets its name when the block ends well: a killed job leaves no half file.
    """

    def __init__(self, name: str, path: str | Path, stamp: Stamp = NO_STAMP, more: Iterable[str] = ()) -> None:
        self.name, self.target = name, Path(path)
        self.temporary = self.target.with_name(f".{self.target.name}.{os.getpid()}")
        about = {"table": name, "code": stamp.code, "config": stamp.config or {}}
        self.schema = schema(name, more).with_metadata({"plumbline": json.dumps(about, sort_keys=True)})

    def __enter__(self) -> "Writer":
        self.target.parent.mkdir(parents=True, exist_ok=True)
        text = [c.name for c in TABLES[self.name] if c.kind == "str"]  # numbers hardly repeat: a dictionary of them only costs time
        self.file = pq.ParquetWriter(self.temporary, self.schema, compression="zstd", use_dictionary=text)
        return self

    def append(self, frame: pd.DataFrame) -> None:
        """Add rows.  Raises PlumblineError where the columns are not those of :data:`TABLES`."""
        want, have = self.schema.names, list(frame.columns)
        if set(want) != set(have):
            lacks, more = sorted(set(want) - set(have)), sorted(set(have) - set(want))
            raise PlumblineError(f"table {self.name}: missing columns {lacks}, unknown columns {more}")
        self.file.write_table(pa.Table.from_pandas(frame[want], schema=self.schema, preserve_index=False))

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.file.close()
        if kind is None:
            self.temporary.replace(self.target)
        else:
            self.temporary.unlink()


def write(name: str, frame: pd.DataFrame, path: str | Path, stamp: Stamp = NO_STAMP) -> None:
    """Write a whole table.  Raises PlumblineError where the columns are not those of :data:`TABLES`."""
    own = {c.name for c in TABLES[name]}
    more = [k for k in frame.columns if k not in own] if name in OPEN else []
    with Writer(name, path, stamp, more) as out:
        if len(frame.columns):
            out.append(frame)


def read(name: str, path: str | Path, columns: list[str] | None = None, trial: str = "") -> pd.DataFrame:
    """Read one file of a table: all of it, some of its columns, or the rows of one trial."""
    if about(path).get("table") != name:
        raise PlumblineError(f"{path} is no table '{name}'; delete results/ and run again")
    chosen = [("trial", "=", trial)] if trial else None
    return pd.DataFrame(pq.read_table(path, columns=columns, filters=chosen).to_pandas())


def read_all(name: str, paths: Iterable[str | Path], columns: list[str] | None = None) -> pd.DataFrame:
    """Read all parts of a table, in the order of subjects and not of parts: a cohort's result does not depend on its cutting."""
    frames = [read(name, p, columns) for p in paths]
    if not frames:
        return empty(name)
    table = pd.concat(frames, ignore_index=True)
    by = [c for c in ("subject", "trial") if c in table]
    return table.sort_values(by, kind="stable", ignore_index=True) if by else table


def to_csv(name: str, paths: Iterable[str | Path], target: str | Path) -> None:
    """Write all parts of a table as one .csv, part by part."""
    empty(name).to_csv(target, index=False)
    for path in paths:
        read(name, path).to_csv(target, index=False, mode="a", header=False)


def about(path: str | Path) -> dict[str, Any]:
    """What a file says of itself: table, code digest, config section."""
    return dict(json.loads((pq.read_schema(path).metadata or {}).get(b"plumbline", b"{}")))
