"""`liestat fit` and `liestat.fit` on the same points."""

import os
import tempfile
import unittest
import warnings

import numpy as np

import liestat
import parity


def arc(n=40, sigma=0.05):
    """Points of a part of an ellipse."""
    noise = np.random.default_rng(1)
    t = np.linspace(1.2, 4.7, n)
    turn = np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    points = np.stack([3 * np.cos(t), 1.5 * np.sin(t)], axis=1) @ turn.T + (100, 50)
    return points + sigma * noise.standard_normal(points.shape)


class FitParity(parity.ParityTest):
    function = "fit"

    def run_both(self, points, model, *options, codes=(0,), **keywords):
        with tempfile.TemporaryDirectory() as directory:
            path = os.path.join(directory, "points.csv")
            header = {2: "x,y", 3: "x,y,z", 4: "x1,y1,x2,y2"}[points.shape[1]]
            np.savetxt(path, points, delimiter=",", header=header, comments="", fmt="%.17g")
            json = parity.program("fit", path, "--model", model, *options, codes=codes)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            result = liestat.fit(points, model, **keywords)
        self.assert_equal_results(json, result, ())
        said = [] if result.status == "ok" else [f"liestat.fit: {result.verdict}"]
        self.assertEqual([str(w.message) for w in caught], said)
        return result

    def test_ellipse(self):
        result = self.run_both(arc(), "ellipse", "--sigma", 0.05, sigma=0.05)
        truth = np.array([100, 50, 3, 1.5, 0.4])
        self.assertTrue((np.abs(result.parameter - truth) < 4 * np.sqrt(np.diag(result.covariance))).all())
        self.assertTrue(result.consistent)
        self.assertEqual(result.names[2], "semi_major")

    def test_refuted_sigma(self):
        result = self.run_both(arc(), "ellipse", "--sigma", 0.005, codes=(3,), sigma=0.005)
        self.assertEqual(result.status, "inconsistent")
        self.assertTrue(np.isnan(result.covariance).all())
        scaled = self.run_both(arc(), "ellipse", "--sigma", 0.02, "--birge", sigma=0.02, birge=True)
        self.assertIsNone(scaled.consistent)
        self.assertGreater(scaled.birge_factor, 2)

    def test_every_model(self):
        noise = np.random.default_rng(2)
        for model, width in (("line", 2), ("circle", 2), ("conic", 2), ("plane", 3), ("line3", 3), ("sphere", 3)):
            points = arc() if width == 2 else np.column_stack([arc(), 0.05 * noise.standard_normal(40)])
            self.run_both(points, model, codes=(0, 3))
        first = noise.uniform(0, 100, (30, 2))
        matches = np.column_stack([first, first @ [[1.1, 0.1], [-0.1, 0.9]] + (3, 4)]) + noise.normal(0, 0.1, (30, 4))
        for model in ("homography", "fundamental"):
            self.run_both(matches, model, codes=(0, 3))

    def test_refused_arguments(self):
        for points, model, sigma, said in (
            (arc(), "elipse", None, "model: expected one of circle, sphere"),
            (arc()[:, :1], "ellipse", None, "shape"),
            (arc(), "sphere", None, "shape"),
            (arc(), "ellipse", 0.0, "sigma: expected a positive number"),
            (np.full((9, 2), np.nan), "line", None, "points"),
        ):
            with self.assertRaisesRegex(ValueError, said):
                liestat.fit(points, model, sigma)


if __name__ == "__main__":
    unittest.main()
