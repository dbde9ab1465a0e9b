"""What is told of a calibrated log: table, JSON, compensation file, page and figure."""

from pathlib import Path
from typing import Any

import numpy as np

from inscal import earth
from inscal.parameters import NAMES
from inscal.record_filter import forces_at_rest
from pipeline.config.schema import Config
from pipeline.logs.calibration import Calibrated, unit_of, with_guess
from pipeline.logs.evidence import LAGS, Evidence, Test
from pipeline.words.render import render

_TEMPLATES = Path(__file__).parent / "templates"
_KINDS = ("whiteness", "position", "suspect", "halves", "other")


def content(found: Calibrated, evidence: Evidence, config: Config) -> dict[str, Any]:
    """What was found, as it is written."""
    interval, rests = found.log.record.interval, found.log.rests
    return {
        "parameter": found.parameter,
        "unit": found.unit,
        "estimate": found.estimate.tolist(),
        "std": found.std.tolist(),
        "given": found.given,
        "covariance": found.covariance.tolist(),
        "dwells": len(rests),
        "from_s": [part.first * interval for part in rests],
        "to_s": [part.end * interval for part in rests],
        "force_less_gravity_m_per_s2": force_less_gravity(found).tolist(),
        "left_out": config.calibration.left_out,
        "innovation_ratio": evidence.ratio,
        "passes": int(found.outcome.calibration.passes[0]),
        "false_alarms": config.calibration.false_alarms,
        "tests": [vars(one) for one in evidence.tests],
        "findable": evidence.findable,
        "alike": {k: [vars(one) for one in likes] for k, likes in evidence.alike.items()},
        "no_halves": evidence.no_halves,
    }


def compensation(found: Calibrated) -> str:
    """Text of a compensation file: parameters of the sensor model in paper units, YAML."""
    about = found.outcome
    states = [*NAMES, *about.estimator.augmented_names]
    values = np.concatenate([about.estimate, about.augmented])
    rows = []
    for name, value in with_guess(found.log, dict(zip(states, values, strict=True))).items():
        unit, size = unit_of(name)
        rows.append((name, value / size, unit))
    return render(_TEMPLATES, "compensation.yaml.jinja", log=found.log.header.data, rows=rows)


def page(found: Calibrated, evidence: Evidence, config: Config, figure: str) -> str:
    """One page on a calibrated log.

    Parameters
    ----------
    found : Calibrated
    evidence : Evidence
    config : Config
    figure : str
        Name of the figure's file.

    Returns
    -------
    str
        Markdown.
    """
    log, about = found.log, config.calibration
    force = force_less_gravity(found)
    left_out = [number - 1 for number in about.left_out]
    return render(
        _TEMPLATES,
        "calibration.md.jinja",
        log=log.header.data,
        header=log.header,
        frame=about.frame,
        noise=config.noise.name,
        duration=log.record.duration,
        rate=1.0 / log.record.interval,
        dwells=len(log.rests),
        turns=len(log.parts) - len(log.rests),
        innovation_ratio=evidence.ratio,
        passes=int(found.outcome.calibration.passes[0]),
        rows=rows(found),
        not_given=[n for n, given in zip(found.parameter, found.given, strict=True) if not given],
        level=about.false_alarms,
        power=about.power,
        wander_time=about.wander_time_s,
        lags=LAGS,
        count={kind: sum(one.kind == kind for one in evidence.tests) for kind in _KINDS},
        found=[said(one) for one in evidence.found],
        alike=evidence.alike,
        compare_to=about.compare_to,
        no_halves=evidence.no_halves,
        findable=[
            (f"`{name}`", *(("none", "") if size is None else (f"{size[0]:.3g}", size[1])))
            for name, size in evidence.findable.items()
        ],
        largest_force=float(np.abs(np.delete(force, left_out)).max()),
        left_out=about.left_out,
        left_out_force=[float(force[n]) for n in left_out],
        figure=figure,
    )


def said(test: Test) -> tuple[str, str, str, str]:
    """Kind, name, chi-square over degrees of freedom, and p-value of a test, in words."""
    p = f"{test.p:.1g}" if test.p > 1e-300 else "below 1e-300"
    return test.kind, test.name, f"{test.chi_square:.3g} / {test.dof:.3g}", p


def force_less_gravity(found: Calibrated) -> np.ndarray:
    """Length of the compensated specific force of each rest less gravity, m/s^2."""
    log = found.log
    force = forces_at_rest(log.record, log.parts, found.outcome.estimate)
    gravity = float(earth.gravity_ned(log.site.latitude, log.site.height)[2])
    return np.asarray(np.linalg.norm(force, axis=1) - gravity)


def rows(found: Calibrated) -> list[tuple[str, str, str, str]]:
    """Parameter, unit, estimate and sigma in words."""
    return [
        (name, unit, f"{value:.5g}", f"{std:.2g}" if given else "not given")
        for name, unit, value, std, given in zip(
            found.parameter, found.unit, found.estimate, found.std, found.given, strict=True
        )
    ]
