"""Trajectories against a reference: errors as evo defines them, NEES with the right degrees of freedom."""

import unittest
import warnings

import numpy as np
import support

import liestat
from liestat import SE3


class Evaluation(unittest.TestCase):
    def setUp(self):
        g = support.generator(5)
        n = 400
        self.times = np.arange(n) * 0.1
        turn = np.stack([np.sin(self.times), np.cos(0.7 * self.times), 0.3 * self.times], 1)
        self.truth = SE3.exp(np.concatenate([5 * turn, turn], 1))
        root = np.diag([0.05, 0.05, 0.02, 0.01, 0.01, 0.02]) @ (np.eye(6) + 0.2 * np.tri(6, k=-1))
        self.covariance = root @ root.T
        self.estimate = self.truth * SE3.exp(g.standard_normal((n, 6)) @ root.T)
        self.world = SE3.exp([3.0, -2.0, 1.0, 0.2, -0.3, 1.1])

    def test_errors_without_alignment(self):
        r = liestat.evaluate_trajectory(self.truth, self.estimate)
        error = self.estimate.inv() * self.truth
        distance = np.linalg.norm(self.estimate.translation - self.truth.translation, axis=1)
        np.testing.assert_allclose(r.position_errors, distance, atol=1e-12)
        np.testing.assert_allclose(r.rotation_errors, np.linalg.norm(error.rotation.log(), axis=1), atol=1e-12)
        self.assertAlmostEqual(r.position.rmse, np.sqrt(np.mean(distance**2)), 12)
        self.assertAlmostEqual(r.position.median, np.median(distance), 12)
        self.assertEqual(r.ape.rmse, r.position.rmse)
        self.assertIsNone(r.consistent)
        self.assertEqual(r.verdict, "no verdict: the estimate has no covariances")

    def test_consistent_in_another_world(self):
        r = liestat.evaluate_trajectory(self.world * self.truth, self.estimate, self.covariance, alignment="se3")
        self.assertIs(r.consistent, True, r.verdict)
        self.assertAlmostEqual(r.tests.joint_nees.degrees_of_freedom, 6 * 400 - 6, 6)
        self.assertGreater(r.tests.joint_nees.p, 1e-3)
        self.assertLess(np.linalg.norm((self.world.inv() * r.weighted_alignment.transform).log()), 0.05)
        self.assertEqual(r.errors.shape, (400, 6))
        self.assertEqual(r.covariances.shape, (400, 6, 6))
        z = np.linalg.solve(r.covariances, r.errors[:, :, None])[:, :, 0]
        np.testing.assert_allclose(r.nees, np.sum(r.errors * z, axis=1), rtol=1e-9)
        self.assertAlmostEqual(float(r.nees.sum()), r.tests.joint_nees.statistic, delta=0.05 * 2394)

    def test_overconfidence_is_seen(self):
        r = liestat.evaluate_trajectory(self.truth, self.estimate, 0.5 * self.covariance)
        self.assertIs(r.consistent, False)
        self.assertTrue(r.verdict.startswith("OVERCONFIDENT"), r.verdict)
        self.assertTrue(r.causes)
        self.assertLess(r.tests.joint_nees.p, 1e-6)
        self.assertAlmostEqual(r.tests.joint_nees.ratio, 2, delta=0.2)

    def test_former_names(self):
        r = liestat.evaluate_trajectory(self.truth, self.estimate, self.covariance, alignment="se3")
        with self.assertWarns(DeprecationWarning):
            c = r.consistency
        self.assertTrue(c.ok)
        self.assertEqual(c.n, 400)
        self.assertIs(c.joint, r.tests.joint_nees)
        self.assertIs(c.alignment, r.weighted_alignment)
        with self.assertWarns(DeprecationWarning):
            self.assertEqual(c.joint.dof, 6 * 400 - 6)
        with self.assertWarns(DeprecationWarning):
            self.assertIs(c.tests.rotation, r.tests.rotation_nees)
        with self.assertWarnsRegex(DeprecationWarning, "t_max_diff"):
            near = liestat.evaluate_trajectory(
                self.truth,
                self.truth,
                reference_times=self.times,
                times=self.times + 0.02,
                association="nearest",
                max_gap=0.03,
            )
        self.assertEqual(near.matched, 400)

    def test_times(self):
        half = slice(1, None, 2)
        r = liestat.evaluate_trajectory(
            self.truth[::2], self.truth[half], reference_times=self.times[::2], times=self.times[half]
        )
        # The last one is after the reference's end; motion in between is no screw.
        self.assertEqual(list(r.rows), list(range(199)))
        self.assertLess(r.position.max, 0.2)
        shifted = self.times[half] + 1000
        with self.assertRaisesRegex(ValueError, "do not overlap"):
            liestat.evaluate_trajectory(
                self.truth[::2], self.truth[half], reference_times=self.times[::2], times=shifted
            )

    def test_bad_input(self):
        with self.assertRaisesRegex(ValueError, "lengths differ: reference 400, estimate 10"):
            liestat.evaluate_trajectory(self.truth, self.estimate[:10])
        with self.assertRaisesRegex(ValueError, "times: expected ascending times"):
            liestat.evaluate_trajectory(
                self.truth, self.estimate, reference_times=self.times, times=self.times[::-1].copy()
            )
        with self.assertRaisesRegex(ValueError, "alignment: expected one of"):
            liestat.evaluate_trajectory(self.truth, self.estimate, alignment="umeyama")
        with self.assertRaisesRegex(TypeError, "estimate: expected SE3"):
            liestat.evaluate_trajectory(self.truth, self.estimate.translation)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            broken = np.tile(self.covariance, (400, 1, 1))
            broken[7] = -np.eye(6)
            r = liestat.evaluate_trajectory(self.truth, self.estimate, broken)
        self.assertIsNone(r.consistent)
        self.assertEqual(list(r.indefinite), [7])
        self.assertIn("(pose 7)", r.notes[0])
        self.assertTrue(caught)


if __name__ == "__main__":
    unittest.main()
