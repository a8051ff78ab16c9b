"""`liestat two-view` and `liestat.two_view` on the same files."""

import os
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity

INTRINSICS = (600, 600, 320, 240)


class TwoViewParity(parity.ParityTest):
    function = "two_view"

    def run_both(self, *simulated, options=(), codes=(0,), **keywords):
        with tempfile.TemporaryDirectory() as directory:
            path = os.path.join(directory, "matches.csv")
            parity.simulate("two-view", "--output", path, *simulated)
            json = parity.program("two-view", path, *options, codes=codes)
            matches = np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)[:, :4]
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = liestat.two_view(matches, **keywords)
        self.assert_equal_results(json, result, ("threshold",))
        self.assertEqual(json["exit_code"] == 0, result.status == "ok")
        said = [] if result.status == "ok" else [f"liestat.two_view: {result.status}: {result.reason}"]
        self.assertEqual([str(w.message) for w in caught], said)
        return result

    def calibrated(self, *simulated, **keywords):
        options = ("--intrinsics", ",".join(map(str, INTRINSICS)), "--image-size", "640,480", "--sigma", 0.5)
        camera = liestat.Camera(*INTRINSICS)
        return self.run_both(*simulated, options=options, sigma=0.5, camera=camera, image_size=(640, 480), **keywords)

    def test_calibrated(self):
        result = self.calibrated()
        self.assertEqual(result.model, "essential")
        self.assertIsNotNone(result.second_T_first)
        self.assertLess(np.nanmax(result.squared_errors[result.inlier]), result.threshold)
        self.assertEqual(np.count_nonzero(result.inlier), result.inliers)

    def test_plane_and_defaults(self):
        self.calibrated("--motion", "homography", "--seed", 3)
        self.run_both("--motion", "homography", "--sigma", 1)
        self.run_both("--seed", 7, options=("--seed", 8), seed=8)
        self.run_both("--seed", 7, options=("--noise-is-known",), noise_is_known=True)

    def test_what_is_not_to_be_trusted(self):
        result = self.calibrated("--outliers", 1, "--matches", 30, codes=(3,))
        self.assertEqual(result.status, "ill_defined")

    def test_former_names(self):
        result = self.calibrated()
        for old, new in (("physical", "parameters"), ("errors", "squared_errors")):
            with self.assertWarnsRegex(DeprecationWarning, f"'{old}' is called '{new}' now"):
                self.assertIs(result[old], result[new])
        with self.assertWarnsRegex(DeprecationWarning, "second_T_first"):
            pose = result.relative_pose
        np.testing.assert_array_equal(pose.rotation.params, result.second_T_first.quaternion_xyzw)
        self.assertIsInstance(pose.direction, liestat.S2)


if __name__ == "__main__":
    unittest.main()
