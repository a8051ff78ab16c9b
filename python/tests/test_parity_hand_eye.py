"""`liestat hand-eye` and `liestat.hand_eye` on the same files."""

import os
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity

SERIES = ("errors", "pair_chi2")
# Fields that describe the files and how they are read.
OF_FILES = ("hints", "notes", "A", "B", "association", "tolerance", "largest_gap", "pairs")


class HandEyeParity(parity.ParityTest):
    function = "hand_eye"

    def run_both(self, *simulated, options=(), status="ok", **keywords):
        with tempfile.TemporaryDirectory() as directory:
            parity.simulate("hand-eye", "--output", directory, "--overwrite", *simulated)
            paths = [os.path.join(directory, name) for name in ("a.csv", "b.csv")]
            json = parity.program("hand-eye", *paths, *options, codes=(0 if status == "ok" else 3,))
            a, b = (liestat.read_features(path, liestat.SE3) for path in paths)
            times = np.loadtxt(paths[0], delimiter=",", skiprows=1, ndmin=2)[:, 0]
        if not keywords.get("relative"):
            keywords["stream_of_a"] = (times, a.features)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = liestat.hand_eye(a.features, b.features, a.covariances, b.covariances, times=times, **keywords)
        pairs = json["pairs"]
        for name in OF_FILES:
            json.pop(name)
        self.assertEqual(json["status"], status)
        self.assert_equal_results(json, result, SERIES)
        fit = np.array([p["error_translation"] + p["error_rotation"] for p in pairs])
        np.testing.assert_array_equal(fit, result.errors)
        np.testing.assert_array_equal([p["chi2"] for p in pairs], result.pair_chi2)
        self.assertEqual(json["exit_code"] == 0, result.ok)
        said = [f"liestat.hand_eye: {status}: {result.in_words}"]
        self.assertEqual([str(w.message) for w in caught], [] if status == "ok" else said)
        return result

    def test_determined(self):
        result = self.run_both("--seed", 2)
        self.assertTrue(result.ok)
        np.testing.assert_array_equal(result.X.covariance, result.joint_covariance[:6, :6])
        self.assertLess(float(result.X.mahalanobis(result.X.mean)), 1e-9)

    def test_motions(self):
        result = self.run_both("--relative", options=("--relative",), relative=True)
        self.assertIsNone(result.Y)
        self.assertIsNone(result.joint_covariance)

    def test_outliers_and_options(self):
        result = self.run_both(
            "--outliers", 0.2, "--seed", 4, options=("--samples", 40, "--seed", 5), samples=40, seed=5
        )
        self.assertGreater(len(result.outliers), 0)

    def test_interpolated_streams(self):
        result = self.run_both(
            "--seed", 3, options=("--interpolate", "--largest-delay", 0.1), interpolate=True, largest_delay=0.1
        )
        self.assertEqual(result.interpolation.in_gaps, 0)
        with self.assertRaisesRegex(ValueError, "need times and stream_of_a"):
            one = liestat.SE3.identity(3)
            liestat.hand_eye(one, one, np.eye(6), np.eye(6), interpolate=True)

    def test_what_is_not_to_be_trusted(self):
        planar = self.run_both("--motion", "planar", status="undetermined")
        self.assertEqual(len(planar.open_directions), 1)
        turning = self.run_both("--motion", "one_axis", status="undetermined")
        self.assertIsNone(turning.X.covariance if any(d.rotates for d in turning.open_directions) else None)
        self.run_both("--outliers", 0.3, options=("--keep-outliers",), status="inconsistent", find_outliers=False)

    def test_former_names(self):
        result = self.run_both("--seed", 2)
        for old, new in (("covariance", "joint_covariance"), ("directions", "open_directions"), ("reason", "in_words")):
            with self.assertWarnsRegex(DeprecationWarning, f"'{old}' is called '{new}' now"):
                self.assertIs(result[old], result[new])


if __name__ == "__main__":
    unittest.main()
