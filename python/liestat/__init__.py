"""Statistics on Lie groups and homogeneous manifolds: means with covariances, tests and sensors over NumPy arrays.

Quaternions are x y z w, tangent vectors translation before rotation, perturbations on the right ("body axes"), lengths
in metres and angles in radians.
"""

from . import _core
from ._manifolds import (
    R3,
    S2,
    SE2,
    SE3,
    SE23,
    SO2,
    SO3,
    Frame3,
    Group,
    Manifold,
    NonOrientedFrame3,
    SemiOrientedFrame3,
)
from ._columns import columns, from_columns
from ._conversions import (
    convert_trajectory,
    diagnose_conventions,
    read_bag,
    read_pose_graph,
    read_trajectory,
    write_trajectory,
)
from ._files import (
    find_recording,
    read_calibration,
    read_camera_poses,
    read_features,
    read_ground_truth,
    read_imu,
    read_imu_noise,
    read_landmarks,
    read_matches,
    read_pose_pairs,
    read_stereo_camera,
    read_stereo_tracks,
    read_tracks,
    read_two_view_pair,
    read_two_view_pairs,
    track,
)
from ._gaussians import (
    CONVENTIONS,
    CounterRng,
    FuseResult,
    Gaussian,
    ValidationReport,
    convert_covariance,
    fuse,
    mean_about,
    propagate,
    random_directions,
    random_rotations,
    sample,
    tested_fuse,
    unscented_transform,
    validate,
)
from ._motion import motion
from ._results import ConfidenceRegion, Law, MeanResult, Result, Uniqueness
from ._sensors import (
    VI_BLOCKS,
    CalibratedPose,
    Camera,
    InitialisedWindow,
    TwoViewResult,
    hand_eye,
    preintegrate,
    robust_two_view,
    two_view,
    vi_init,
)
from ._state import State
from ._statistics import compare, fit, fit_law, group_mean, mahalanobis, mean, validate_split
from ._trajectories import TrajectoryEvaluation, evaluate_trajectory

__version__ = _core.__version__
