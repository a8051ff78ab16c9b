"""Trajectories against a reference."""

import warnings

import numpy as np

from . import _core
from ._manifolds import SE3
from ._results import Result
from ._sensors import _same_length, _vector
from ._statistics import _covariances

# Former names: those inside the tests, and those of the tests.
_RENAMED = {
    "dof": "degrees_of_freedom",
    "joint": "joint_nees",
    "position": "position_nees",
    "rotation": "rotation_nees",
}


class _Alignment(Result):
    """An alignment; `transform` is its motion, `fault` says why it is not ok."""

    def __init__(self, title, fault, parts):
        super().__init__(title, **parts)
        self._fault = fault

    @property
    def transform(self):
        return SE3._of(np.concatenate([self.quaternion_xyzw, self.translation]))

    @property
    def fault(self):
        return self._fault


class TrajectoryEvaluation(Result):
    """The result of `evaluate_trajectory`."""

    @property
    def consistency(self):
        """Deprecated: a former arrangement of `tests`, `weighted_alignment`, `errors`, `covariances` and `nees`."""
        warnings.warn("liestat: the part 'consistency' is in 'tests', 'verdict', …", DeprecationWarning, stacklevel=2)
        if self.covariance_convention is None:
            return None
        return Result(
            "consistency",
            ok=self._outcome["consistency_ok"],
            fault=self._outcome["consistency_fault"],
            n=self._outcome["n_tested"],
            alignment=self.weighted_alignment,
            tests=self.tests,
            joint=self.tests.joint_nees,
            position=self.tests.position_nees,
            rotation=self.tests.rotation_nees,
            errors=self.errors,
            covariances=self.covariances,
            nees=self.nees,
            indefinite=list(self.indefinite),
        )


def evaluate_trajectory(
    reference,
    estimate,
    covariances=None,
    *,
    reference_times=None,
    times=None,
    reference_covariances=None,
    association="interpolate",
    interpolation="cubic",
    max_gap=None,
    t_max_diff=0.01,
    t_offset=0.0,
    t_start=None,
    t_end=None,
    pose_relation="trans_part",
    alignment="none",
    verdict_alignment=None,
    n_to_align=0,
    project_to_plane=None,
    change_unit=None,
    downsample=0,
    motion_filter=None,
    delta=1.0,
    delta_unit="f",
    delta_tol=0.1,
    all_pairs=False,
    pairs_from_reference=False,
    pairs_model=None,
    misfit=False,
):
    """A trajectory against a reference: errors as evo defines them, and a verdict on the covariances.

    The options are those of `liestat evaluate`, with the same names, defaults and results.

    Parameters
    ----------
    reference, estimate : SE3, shapes (m,) and (n,)
        world_T_body. Without times row i belongs to row i, and m = n.
    covariances : array_like, shape (6, 6) or (n, 6, 6), optional
        Of the estimate: m² and rad², body axes, translation before rotation. Without them there is no verdict.
    reference_times, times : array_like, shapes (m,) and (n,), optional
        Seconds, ascending.
    reference_covariances : array_like, shape (6, 6) or (m, 6, 6), optional
        The reference is exact by default.
    association : {'interpolate', 'nearest'}
        The reference at the times of the estimate, or its nearest stamps, as evo.
    interpolation : {'cubic', 'geodesic', 'slerp'}
    max_gap : float, optional
        Seconds between two stamps of the reference to interpolate between; five times their median distance.
    t_max_diff : float
        Seconds, of nearest stamps.
    t_offset : float
        Seconds, added to the estimate's times.
    t_start, t_end : float, optional
        Seconds, of the reference.
    pose_relation : str
        Number that is made of an error, for `ape` and `rpe`: 'trans_part', 'angle_deg', 'angle_rad', 'rot_part', 'full',
        'point_distance', 'point_distance_error_ratio'.
    alignment : {'none', 'origin', 'posyaw', 'se3', 'sim3', 'scale'}
        Least squares of the positions, as evo does it, for `ape` and `rpe`.
    verdict_alignment : str, optional
        The model that is weighted with the covariances, for the verdict; as `alignment` by default. A scale alone has
        none: sim3 takes its place.
    n_to_align : int
        The first poses that are aligned; 0: all.
    project_to_plane : {'xy', 'xz', 'yz'}, optional
        Projects both after the alignment.
    change_unit : {'mm', 'cm', 'm', 'km', 'deg', 'rad'}, optional
        Unit of `ape` and `rpe`.
    downsample : int
        Keeps so many poses of each, evenly spaced; 0: all.
    motion_filter : (float, float), optional
        Keeps poses after which the body moved so far (m) or turned so far (degrees).
    delta, delta_unit, delta_tol : float, {'f', 'd', 'r', 'm'}, float
        Distance of the poses of a pair in frames, degrees, radians or metres, and its relative tolerance with all pairs.
    all_pairs, pairs_from_reference : bool
        All pairs instead of consecutive ones; the distance is measured along the reference.
    pairs_model : {'independent', 'chain'}, optional
        NEES of relative motions, if errors of a pair are independent, or a chain (dead reckoning).
    misfit : bool
        Looks for faults of the whole run: clock, scale, frame of the body or world, inverses, order of quaternions, axes.

    Returns
    -------
    TrajectoryEvaluation
        The fields of ``liestat evaluate --json`` (docs/program.md): `verdict` (a sentence), `consistent` (True, False
        or None: no verdict), `ape` and `rpe` (`rmse`, …), `alignment`, `tests` (`joint_nees`, …), …. Besides, for each
        matched pose: `rows` of the estimate, `times`, `ape_errors`, `position_errors` (m) and `rotation_errors` (rad)
        with statistics `position` and `rotation`; after the weighted alignment `errors` (n, 6), their `covariances` (n,
        6, 6) and `nees`. For each pair: `pairs` (k, 2) and `rpe_errors`. An alignment also has `transform` (SE3) and
        `fault`.

    Raises
    ------
    ValueError
        Where no two poses have a partner, with the reason.

    Warns
    -----
    UserWarning
        Where the alignment or NEES does not exist, with the reason.
    """
    given = locals()
    caller = "evaluate_trajectory"
    for name, value in (("reference", reference), ("estimate", estimate)):
        if not isinstance(value, SE3) or value.ndim != 1 or len(value) == 0:
            shape = f" of shape {value.shape}" if hasattr(value, "shape") else ""
            raise TypeError(f"{caller}: {name}: expected SE3 of shape (n,), got {type(value).__name__}{shape}")
    options = {name: given[name] for name in _core.evaluation_options()}
    if association == "nearest" and max_gap is not None:
        warnings.warn(f"liestat.{caller}: max_gap of nearest stamps is t_max_diff", DeprecationWarning, stacklevel=2)
        options["t_max_diff"] = max_gap
    if (reference_times is None) != (times is None):
        raise ValueError(f"{caller}: times of both trajectories, or of none")
    stamps = [None, None]
    if times is None:
        _same_length(caller, reference=reference, estimate=estimate)
    else:
        of_each = (("reference_times", reference_times, reference), ("times", times, estimate))
        for i, (name, value, poses) in enumerate(of_each):
            stamps[i] = _vector(value, f"{caller}: {name}")
            _same_length(caller, **{name: stamps[i], "poses": poses})
            if not (np.diff(stamps[i]) > 0).all():
                raise ValueError(f"{caller}: {name}: expected ascending times, each once")
    matrices = [reference_covariances, covariances]
    for i, (name, poses) in enumerate((("reference_covariances", reference), ("covariances", estimate))):
        if matrices[i] is not None:
            c = _covariances(matrices[i], f"{caller}: {name}", SE3, (len(poses),))
            matrices[i] = np.ascontiguousarray(np.broadcast_to(c, (len(poses), 6, 6)))
    result = _core.evaluate_trajectory(
        np.ascontiguousarray(reference.params),
        stamps[0],
        matrices[0],
        np.ascontiguousarray(estimate.params),
        stamps[1],
        matrices[1],
        options,
    )
    parts, outcome = result["parts"], result["outcome"]
    if outcome["status"] not in ("ok", "not_aligned"):
        raise ValueError(f"{caller}: {outcome['reason']}")
    parts["covariances"] = parts["covariances"].reshape(-1, 6, 6)
    parts["pairs"] = np.stack([parts.pop("pairs_from"), parts.pop("pairs_to")], axis=1)
    e = TrajectoryEvaluation.of("evaluation", parts, _RENAMED)
    e.alignment = _Alignment("alignment", outcome["alignment_fault"], parts["alignment"])
    e.weighted_alignment = _Alignment("weighted alignment", outcome["weighted_fault"], parts["weighted_alignment"])
    e._outcome = outcome
    for fault in (outcome["reason"], outcome["consistency_fault"]):
        if fault:
            warnings.warn(f"liestat.{caller}: {fault}", UserWarning, stacklevel=2)
    return e
