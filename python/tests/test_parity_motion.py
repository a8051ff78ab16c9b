"""`liestat motion` and `liestat.motion`: the same fields, values, options and refusals on the same files, and
covariances of one frame whatever the interval of the pairs."""

import inspect
import os
import re
import subprocess
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity
import support
from liestat import SE3, SO3, _core

# Fields that the module has besides: one row for each frame.
SERIES = (
    "frame usable meaning filter direction direction_covariance rotation rotation_covariance mean_inverse_depth"
    " sign_evidence innovation pairs inliers covariance_judged bad_input too_few standstill degenerate ambiguous"
    " undecided_sign lost misfit gyroscope_refuted outliers"
).split()
# Vehicle's axes (x forward, y left, z up) to the camera's (x right, y down, z forward).
AHEAD = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]], dtype=float)


class MotionParity(parity.ParityTest):
    function = "motion"

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.path = directory.name
        run = [parity.PROGRAM, "simulate", "motion", "--output", self.path, "--frames", "60", "--seed", "3"]
        subprocess.run(run, check=True, capture_output=True)
        self.tracks = self.table("tracks.csv")
        self.points = np.column_stack([self.tracks["u"], self.tracks["v"]])
        self.points = (self.points - 256) / 500
        truth = self.table("truth.csv")
        R = np.stack([truth[f"R{i}{j}"] for i in range(3) for j in range(3)], axis=1).reshape(-1, 3, 3)
        centres = np.stack([truth[name] for name in ("cx", "cy", "cz")], axis=1)
        self.truth = SE3.from_components(centres, SO3.from_matrix(R, fit=True).inv())
        # Rates in the camera's axes, and the rotation of the points from each frame to the next.
        rates = self.table("rates.csv")
        times = rates["t_s"]
        rates = np.stack([rates[name] for name in ("wx", "wy", "wz")], axis=1) @ AHEAD.T
        with open(os.path.join(self.path, "camera_rates.csv"), "w", encoding="utf-8") as file:
            file.write("frame,t_s,wx,wy,wz\n")
            for k, (t, w) in enumerate(zip(times.tolist(), rates.tolist())):
                file.write(",".join(map(repr, [k, t, *w])) + "\n")
        self.gyroscope = np.zeros((60, 3))
        self.gyroscope[1:] = -0.5 * (rates[1:] + rates[:-1]) * np.diff(times)[:, None]
        self.seconds = float(np.median(np.diff(times)))

    def table(self, name):
        return np.genfromtxt(os.path.join(self.path, name), delimiter=",", names=True)

    def program(self, *options, codes=(0,)):
        tracks = os.path.join(self.path, "tracks.csv")
        return parity.program(
            "motion", tracks, "--intrinsics", "500,500,256,256", "--sigma", "1", *options, codes=codes
        )

    def module(self, **options):
        ids = [self.tracks[name].astype(int) for name in ("frame", "track")]
        return liestat.motion(*ids, self.points, 1 / 500, **options)

    def inertial(self, **options):
        sigma = np.radians(0.1)
        return self.module(
            gyroscope=self.gyroscope, gyroscope_covariance=sigma**2 * np.eye(3), seconds=self.seconds, **options
        )

    def _compare(self, theirs, ours, path):
        # The two make calibrated coordinates and rotations of their files in another order of operations.
        if isinstance(theirs, float) and isinstance(ours, float):
            self.assertLess(abs(theirs - ours), 1e-8 * max(1, abs(theirs)), path)
        else:
            super()._compare(theirs, ours, path)

    def test_images(self):
        for program, module in (
            ([], {}),
            (["--frames-apart", 4], {"frames_apart": 4}),
            (["--frames-apart", 4, "--flow", "discrete"], {"frames_apart": 4, "flow": "discrete"}),
            (["--frames-apart", 3, "--filter", "essential"], {"frames_apart": 3, "filter": "essential"}),
            (["--filter", "subspace", "--starts", 8], {"filter": "subspace", "starts": 8}),
            (["--outliers"], {"outliers": True}),
            (["--passes", 2, "--process-noise", 1e-4], {"passes": 2, "process_noise": 1e-4}),
        ):
            with self.subTest(program=program):
                self.assert_equal_results(self.program(*program), self.module(**module), SERIES)

    def test_truth(self):
        truth = ["--truth", os.path.join(self.path, "truth.csv"), "--min-motion", 0]
        result = self.module(truth=self.truth, min_motion=0)
        self.assert_equal_results(self.program(*truth), result, SERIES)
        self.assertLess(result.median_rotation_error_deg, 0.5)

    def test_gyroscope(self):
        rates = ["--rates", os.path.join(self.path, "camera_rates.csv"), "--rates-axes", "camera"]
        for program, module in (
            ([], {}),
            (["--frames-apart", 4], {"frames_apart": 4}),
            (["--frames-apart", 4, "--flow", "midpoint"], {"frames_apart": 4, "flow": "midpoint"}),
            (["--bias"], {"bias": True}),
            (["--bias", "--frames-apart", 3], {"bias": True, "frames_apart": 3}),
            (["--bias", "--bias-sigma", 0.05], {"bias": True, "bias_sigma": 0.05}),
        ):
            with self.subTest(program=program):
                self.assert_equal_results(self.program(*rates, *program), self.inertial(**module), SERIES)

    def test_refused(self):
        run = [parity.PROGRAM, "motion", os.path.join(self.path, "tracks.csv"), "--intrinsics", "500,500,256,256"]
        composition = ["--filter", "composition", "--frames-apart", "4"]
        for program, module, fault in (
            (composition, {"filter": "composition", "frames_apart": 4}, "successive"),
            (["--bias"], {"bias": True}, "gyroscope"),
        ):
            refused = subprocess.run([*run, *program], capture_output=True, text=True, check=False)
            self.assertEqual(refused.returncode, 2)
            with self.assertRaisesRegex(ValueError, fault) as raised:
                self.module(**module)
            self.assertIn(fault, refused.stderr)
            if fault == "successive":
                words = "the composition takes successive frames"
                self.assertIn(words, refused.stderr)
                self.assertIn(words, str(raised.exception))

    def test_defaults(self):
        parameters = inspect.signature(liestat.motion).parameters
        for name, value in _core.motion_defaults.items():
            self.assertEqual(parameters[name].default, value, name)
        said = subprocess.run([parity.PROGRAM, "motion", "--help"], capture_output=True, text=True, check=True).stdout
        said = re.sub(r"\s+", " ", said)
        for name, value in _core.motion_defaults.items():
            option = re.search(rf"--{name.replace('_', '-')} [^-]*?\(default ([0-9.e-]+)", said)
            if option:
                self.assertEqual(float(option.group(1)), value, name)
        self.assertIn("(default 32)", said)

    def test_verdict(self):
        few = self.tracks["track"] < 5
        ids = [self.tracks[name][few].astype(int) for name in ("frame", "track")]
        result = liestat.motion(*ids, self.points[few], 1 / 500)
        self.assertEqual((result.status, result.frames_usable), ("ill_defined", 0))
        self.assertIn("NOT TO BE TRUSTED", result.verdict)
        self.assertTrue(any(cause.startswith("too_few in 59") for cause in result.causes), result.causes)


class Consistency(unittest.TestCase):
    """The simulated orbit: 150 frames, 40 points, 1 px, 3° per frame, with the pairs and gyroscope of the call. Means
    of the squared Mahalanobis distances, expected below their dimensions since covariances are upper bounds; over four
    seeds they are 0.6 to 2.4 for the rotation and 0.2 to 0.9 for the direction, with standard errors below 0.1 (0.3 for
    the essential filter)."""

    omega = np.radians(3) * np.array([0.6, 0.8, 0.0])
    centre = np.array([0, 0, 1.5])

    def orbit(self, seed, gyroscope_sigma=0.0):
        rng = support.generator(seed)
        unit = liestat.random_directions(40, rng).params
        points = self.centre + 0.5 * unit * np.cbrt(rng.uniform(0, 1, (40, 1)))
        R, frames, tracks, xy = SO3.exp(self.omega), [], [], []
        for i in range(150):
            frames.append(np.full(40, i))
            tracks.append(np.arange(40))
            xy.append(points[:, :2] / points[:, 2:] + 2e-3 * rng.standard_normal((40, 2)))
            points = R.act(points - self.centre) + self.centre
        gyroscope = {}
        if gyroscope_sigma:
            rotations = self.omega + gyroscope_sigma * rng.standard_normal((150, 3))
            gyroscope = {"gyroscope": rotations, "gyroscope_covariance": gyroscope_sigma**2 * np.eye(3)}
        return [np.concatenate(part) for part in (frames, tracks, xy)], gyroscope

    def distances(self, result, apart):
        """Means over the usable frames from 30 on: of the rotation of one frame, and of the direction."""
        use = result.usable & (np.arange(150) >= 30)
        self.assertGreater(use.sum(), 100)
        velocity = -np.cross(self.omega, self.centre)
        over = SO3.exp(apart * self.omega)
        translation = self.centre - over.act(self.centre)
        rotation, direction = [], []
        for k in np.flatnonzero(use):
            error = result.rotation[k].local(SO3.exp(self.omega))
            rotation.append(error @ np.linalg.solve(result.rotation_covariance[k], error))
            truth = liestat.S2.from_vector(velocity if result.meaning[k] == "velocity" else translation)
            error = result.direction[k].local(truth)
            direction.append(error @ np.linalg.solve(result.direction_covariance[k], error))
        return np.mean(rotation), np.mean(direction)

    def test_defaults_and_intervals(self):
        for name, options, sigma in (
            ("defaults", {}, 0),
            ("former intervals", {"frames_apart": 4}, 0),
            ("essential", {"frames_apart": 4, "filter": "essential"}, 0),
            ("gyroscope", {}, np.radians(0.05)),
            ("gyroscope, intervals", {"frames_apart": 4}, np.radians(0.05)),
            ("gyroscope, midpoint", {"frames_apart": 4, "flow": "midpoint"}, np.radians(0.05)),
        ):
            with self.subTest(name):
                values = []
                for seed in range(4):
                    data, gyroscope = self.orbit(seed, sigma)
                    result = liestat.motion(*data, 2e-3, **gyroscope, **options)
                    values.append(self.distances(result, options.get("frames_apart", 1)))
                rotation, direction = np.mean(values, axis=0)
                self.assertLess(rotation, 3)
                self.assertLess(direction, 2)

    def test_former_names(self):
        data, _ = self.orbit(5)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            former = liestat.motion(*data, 2e-3, span=4)
            self.assertTrue(former.ok[-1])
            alone = liestat.motion(*data, 2e-3, essential=False)
        self.assertEqual([w.category for w in caught], 3 * [DeprecationWarning])
        self.assertEqual((former.frames_apart, former.hand_overs), (4, 0))
        self.assertEqual(set(alone.filter), {"subspace"})
        with warnings.catch_warnings(), self.assertRaisesRegex(ValueError, "successive frames"):
            warnings.simplefilter("ignore")
            liestat.motion(*data, 2e-3, span=4, essential=True)


if __name__ == "__main__":
    unittest.main()
