"""Covariances: conventions, propagation, fusion, sampling and validation."""

import unittest

import numpy as np
import support
from scipy import stats

import liestat
from liestat import S2, SE3, SO3, CounterRng, Frame3, Gaussian, Law


def covariance(k, seed=0, scale=0.05, shape=()):
    root = scale * support.generator(seed).standard_normal((*shape, k, k + 2))
    return root @ np.swapaxes(root, -1, -2)


class Unscented(unittest.TestCase):
    def test_the_identity_keeps_the_gaussian(self):
        # From four dimensions on the middle's weight is negative.
        for name, k in support.TYPES.items():
            for c in (1.0, 3.0, 8.0):
                with self.subTest(name=name, c=c):
                    g = Gaussian(support.features(name, 3)[1], covariance(k))
                    image, cross = liestat.unscented_transform(lambda x: x, g, c)
                    np.testing.assert_allclose(g.mean.local(image.mean), 0, atol=1e-11)
                    np.testing.assert_allclose(image.covariance, g.covariance, atol=1e-12)
                    np.testing.assert_allclose(cross, g.covariance, atol=1e-12)

    def test_moments_of_a_square_are_exact(self):
        g = Gaussian(liestat.R3([1.0, 2.0, -1.0]), covariance(3, scale=0.4))
        (mean, _), _ = liestat.unscented_transform(lambda x: (x.params**2).sum(axis=1), g)
        self.assertAlmostEqual(mean[0], 6 + np.trace(g.covariance), places=12)

    def test_bad_input_is_said(self):
        x = support.features("SO3", 3)
        with self.assertRaisesRegex(ValueError, "add up to zero"):
            liestat.mean_about(x, [1, -2, 1], x[0])
        with self.assertRaisesRegex(ValueError, "one list each"):
            liestat.mean_about(x, [1, 1], x[0])
        with self.assertRaisesRegex(ArithmeticError, "negative weight"):
            g = Gaussian(SE3.identity(), np.eye(6))
            liestat.unscented_transform(lambda y: (y.local(SE3.identity()) ** 2).sum(axis=1), g, 0.5)


class Conventions(unittest.TestCase):
    def test_known_matrices(self):
        x = support.features("SE3", 7)
        c = covariance(6, shape=(7,))
        Adj = x.Adj()
        left = liestat.convert_covariance(x, c, "left")
        np.testing.assert_allclose(left, Adj @ c @ np.swapaxes(Adj, 1, 2), rtol=1e-10, atol=1e-14)
        R = np.zeros((7, 6, 6))
        R[:, :3, :3] = R[:, 3:, 3:] = x.rotation.as_matrix()
        world = liestat.convert_covariance(x, c, "world")
        np.testing.assert_allclose(world, R @ c @ np.swapaxes(R, 1, 2), rtol=1e-10, atol=1e-14)
        order = [3, 4, 5, 0, 1, 2]
        np.testing.assert_array_equal(liestat.convert_covariance(x, c, "rotation_first"), c[:, order][:, :, order])
        np.testing.assert_allclose(liestat.convert_covariance(x, c, "left_rotation_first"), left[:, order][:, :, order])

    def test_round_trips(self):
        for name, k in support.TYPES.items():
            x, c = support.features(name, 4), covariance(k, shape=(4,))
            for convention in liestat.CONVENTIONS:
                with self.subTest(name=name, convention=convention):
                    try:
                        there = liestat.convert_covariance(x, c, convention)
                    except ValueError as error:
                        self.assertRegex(str(error), "has no convention")
                        self.assertTrue(name in support.METRIC or convention == "chart", name)
                        continue
                    back = liestat.convert_covariance(x, there, source=convention)
                    np.testing.assert_allclose(back, c, rtol=1e-9, atol=1e-14)
        with self.assertRaisesRegex(ValueError, "to: expected one of body"):
            liestat.convert_covariance(SO3.identity(), np.eye(3), "right")

    def test_chart_is_that_of_rotation_vectors(self):
        """To first order the covariance of rotation vectors; 200000 samples, 5 standard errors."""
        x = SO3.exp([0.5, -0.8, 0.3])
        c = covariance(3, scale=0.01)
        v = liestat.sample(x, c, 200000, rng=1).log()
        np.testing.assert_allclose(np.cov(v.T), liestat.convert_covariance(x, c, "chart"), atol=5 * 1.5 * c.max() / 447)


class Propagation(unittest.TestCase):
    def test_products_by_differences(self):
        for name, k in support.GROUPS.items():
            with self.subTest(name):
                a = Gaussian(support.features(name, 1)[0], covariance(k))
                b = Gaussian(support.features(name, 1, seed=1)[0], covariance(k, 1))
                for ours, function, inputs in (
                    (a * b, lambda x, y: x * y, (a, b)),
                    (a.inv(), lambda x: x.inv(), (a,)),
                    (a.between(b), lambda x, y: x.inv() * y, (a, b)),
                    (a * b.mean, lambda x: x * b.mean, (a,)),
                    (b.mean * a, lambda x: b.mean * x, (a,)),
                ):
                    theirs = liestat.propagate(function, *inputs)
                    self.assertTrue(theirs.mean.allclose(ours.mean, 1e-12))
                    np.testing.assert_allclose(theirs.covariance, ours.covariance, rtol=1e-6, atol=1e-9)

    def test_moved(self):
        for name, k in support.METRIC.items():
            with self.subTest(name):
                by = support.features({"R3": "SE3", "S2": "SO3", "SO2": "SO2", "SO3": "SO3"}.get(name, "SE3"), 1, seed=3)[0]
                x = Gaussian(support.features(name, 1)[0], covariance(k))
                moved = x.moved(by)
                self.assertTrue(moved.mean.allclose(x.mean.moved(by), 1e-12))
                # A motion changes no distance.
                y = support.features(name, 5, seed=4)
                np.testing.assert_allclose(moved.mahalanobis(y.moved(by)), x.mahalanobis(y), rtol=1e-6)

    def test_functions_of_users(self):
        x = Gaussian(support.features("SE3", 1)[0], covariance(6))
        value, c = liestat.propagate(lambda pose, d: np.linalg.norm(pose.act([1.0, 2, 3])) + d, x, (0.5, 0.01))
        p = x.mean.act([1.0, 2, 3])
        direction = p / np.linalg.norm(p) @ x.mean.rotation.as_matrix()
        J = np.concatenate([direction, -direction @ np.cross(np.eye(3), [1.0, 2, 3])])
        self.assertAlmostEqual(c[0, 0], 0.01 + J @ x.covariance @ J, delta=1e-9)
        by_hand = liestat.propagate(lambda pose, d: np.linalg.norm(pose.act([1.0, 2, 3])) + d, x, (0.5, 0.01),
                                    jacobian=[*J, 1.0])
        np.testing.assert_allclose(by_hand[1], c, rtol=1e-7)
        joint = np.zeros((7, 7))
        joint[:6, :6], joint[6, 6] = x.covariance, 0.01
        difference = lambda pose, d: d - pose.act([1.0, 2, 3])  # noqa: E731
        correlated = liestat.propagate(difference, x, (0.5, 0.01), joint_covariance=joint)
        np.testing.assert_allclose(correlated[1], liestat.propagate(difference, x, (0.5, 0.01))[1])
        with self.assertRaisesRegex(ValueError, r"propagate: jacobian: expected shape \(\.\.\., 6, 6\), got \(3, 3\)"):
            liestat.propagate(lambda pose: pose.inv(), x, jacobian=np.eye(3))
        with self.assertRaisesRegex(ValueError, "one feature"):
            liestat.propagate(lambda pose: pose, Gaussian(SE3.identity(2), np.eye(6)))

    def test_fourth_order(self):
        """Large noise: 100000 samples; the second order is off where the fourth is not."""
        a = Gaussian(SE3.identity(), np.diag([0.1, 0.1, 0.1, 0.1, 0.1, 0.4]))
        second, fourth = a * a, a.product_fourth_order(a)
        z = (second.mean.inv() * (a.sample(100000, 1) * a.sample(100000, 2))).log()
        sampled = z.T @ z / len(z)
        self.assertLess(np.abs(sampled - fourth.covariance).max(), 0.5 * np.abs(sampled - second.covariance).max())


class Fusion(unittest.TestCase):
    def test_points(self):
        x = support.features("R3", 5)
        c = covariance(3, shape=(5,))
        fused = liestat.tested_fuse(x, c).estimate
        information = np.linalg.inv(c)
        np.testing.assert_allclose(fused.covariance, np.linalg.inv(information.sum(0)), rtol=1e-8)
        expected = fused.covariance @ (information @ x.params[:, :, None]).sum(0)
        np.testing.assert_allclose(fused.mean.params, expected[:, 0], rtol=1e-8)

    def test_is_the_mean(self):
        for name, k in support.TYPES.items():
            with self.subTest(name):
                at = {"covariance_at": "measured"}
                x = support.features(name, (6, 3), sigma=0.05)
                c = 0.1 * np.eye(k) if name == "S2" else covariance(k, shape=(6, 3))
                fused = liestat.fuse(Gaussian(x, c), axis=0, **at)
                self.assertEqual(fused.shape, (3,))
                for i in range(3):
                    one = liestat.mean(x[:, i], covariances=c if c.ndim == 2 else c[:, i], **at)
                    self.assertTrue(one.mean.allclose(fused.mean[i], 1e-9))
                    np.testing.assert_allclose(one.covariance, fused.covariance[i], rtol=1e-6, atol=1e-12)

    def test_factors_keep_small_variances(self):
        rng = np.random.default_rng(5)
        q = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        a = q * [0.3, 3e-6, 3e-7]
        x = liestat.SO3.exp(np.tile([0.1, 0.2, 0.3], (5, 1)))
        fused = liestat.fuse(liestat.Gaussian.from_factor(x, a))
        # Its columns are principal axes here, the shortest first; NumPy's singular values lose digits.
        variances = (fused.factor**2).sum(0) * 5
        np.testing.assert_allclose(variances, [9e-14, 9e-12, 0.09], rtol=1e-9)
        np.linalg.cholesky(fused.covariance)
        self.assertTrue((fused.covariance == fused.covariance.T).all())
        result = liestat.mean(x, factors=a)
        self.assertEqual(result.status, "ok")
        np.testing.assert_allclose((np.asarray(result.covariance_factor) ** 2).sum(0), variances / 5, rtol=1e-9)
        by_deviations = liestat.fuse(x, deviations=[0.3, 3e-6, 3e-7])
        np.testing.assert_allclose(by_deviations.sigma * 5**0.5, [0.3, 3e-6, 3e-7], rtol=1e-9)
        np.testing.assert_array_equal(
            by_deviations.factor, liestat.fuse(liestat.Gaussian.from_deviations(x, [0.3, 3e-6, 3e-7])).factor
        )
        self.assertIsNone(liestat.fuse(x, a @ a.T).factor)
        with self.assertRaisesRegex(ValueError, "give one of them"):
            liestat.mean(x, covariances=np.eye(3), factors=a)
        with self.assertRaisesRegex(ValueError, "not above zero"):
            liestat.mean(x, deviations=[1, 0, 1])

    def test_withheld_and_refused(self):
        opposite = SO3.exp([[0, 0, 0], [0, 0, np.pi]])
        with self.assertWarnsRegex(UserWarning, "no covariance of 1 of 1"):
            fused = liestat.fuse(opposite, 2 * np.eye(3))
        self.assertTrue(np.isnan(fused.covariance).all())
        far = SO3.exp([[0, 0, 0], [0, 0, 1], [0, 1, 0]])
        with self.assertWarnsRegex(UserWarning, "farther apart than their covariances say"):
            fused = liestat.fuse(far, 1e-4 * np.eye(3))
        self.assertTrue(np.isnan(fused.covariance).all())
        tested = liestat.tested_fuse(far, 1e-4 * np.eye(3))
        self.assertEqual((tested.status, tested.fit_dof), ("inconsistent", 6))
        self.assertLess(tested.fit_p, 1e-3)
        self.assertAlmostEqual(tested.fit_factor, tested.fit / 6)
        self.assertTrue(tested.estimate.mean.allclose(fused.mean, 1e-12))
        self.assertTrue(np.isfinite(tested.estimate.covariance).all())
        with self.assertRaisesRegex(ValueError, "covariance_at"):
            liestat.fuse(Frame3.identity(3), np.eye(6))
        with self.assertRaisesRegex(ValueError, "no features"):
            liestat.fuse(SO3.identity((0,)), np.eye(3))


class Sampling(unittest.TestCase):
    def test_law(self):
        """Squared distances of samples are χ²; 5000 samples, false alarm 1e-6 each."""
        for name, k in support.TYPES.items():
            with self.subTest(name):
                c = covariance(k)
                x = support.features(name, 1)[0]
                mu2 = liestat.mahalanobis(x, c, liestat.sample(x, c, 5000, rng=7)) ** 2
                self.assertGreater(stats.kstest(mu2, stats.chi2(k).cdf).pvalue, 1e-6)

    def test_counters(self):
        rng = CounterRng(3, trial=5, stream=2)
        first = rng.standard_normal((4, 3))
        again = CounterRng(3, trial=7, stream=2).standard_normal((2, 3))
        np.testing.assert_array_equal(first[2:], again)
        self.assertEqual(rng.trial, 9)
        np.testing.assert_array_equal(liestat.sample(SO3.identity(), np.eye(3), 4, CounterRng(1)).params,
                                      liestat.sample(SO3.identity(), np.eye(3), 4, 1).params)
        u = CounterRng(0).uniform((1000, 2))
        self.assertTrue(((u > 0) & (u < 1)).all())

    def test_numpy_generators(self):
        a = liestat.sample(S2.identity(3), np.eye(2) * 0.01, (5, 3), np.random.default_rng(0))
        b = liestat.sample(S2.identity(3), np.eye(2) * 0.01, (5, 3), np.random.default_rng(0))
        self.assertEqual(a.shape, (5, 3))
        np.testing.assert_array_equal(a.params, b.params)
        with self.assertRaisesRegex(TypeError, "rng"):
            liestat.sample(S2.identity(), np.eye(2), rng="seed")

    def test_uniform(self):
        """Angles of uniform rotations have the density (1 - cos)/π; 4000 samples, false alarm 1e-6."""
        angles = liestat.random_rotations(4000, rng=1).magnitude()
        self.assertGreater(stats.kstest(angles, lambda a: (a - np.sin(a)) / np.pi).pvalue, 1e-6)
        z = liestat.random_directions(4000, rng=1).params[:, 2]
        self.assertGreater(stats.kstest(z, stats.uniform(-1, 2).cdf).pvalue, 1e-6)
        self.assertTrue(liestat.random_rotations().single)


class Laws(unittest.TestCase):
    def test_against_scipy(self):
        chi2, hotelling = Law(3), Law(3, 12)
        for p in (0.01, 0.5, 0.95, 0.999):
            self.assertAlmostEqual(chi2.quantile(p), stats.chi2.ppf(p, 3), places=9)
            self.assertAlmostEqual(hotelling.quantile(p), stats.f.ppf(p, 3, 9) * 33 / 9, places=6)
        np.testing.assert_allclose(chi2.survival([1, 2, 30]), stats.chi2.sf([1, 2, 30], 3))
        np.testing.assert_allclose(hotelling.survival([[1], [20]]), stats.f.sf(np.array([[1], [20]]) * 9 / 33, 3, 9))
        self.assertEqual((chi2.mean(), chi2.name, hotelling.name), (3, "chi2", "hotelling"))
        self.assertAlmostEqual(hotelling.mean(), 33 / 7)
        self.assertEqual(Law(3, 12), hotelling)

    def test_region_of_a_gaussian(self):
        g = Gaussian(support.features("SO3", 1)[0], covariance(3))
        region = g.confidence_region(0.9)
        inside = region.contains(g.sample(4000, rng=2))
        # Binomial, false alarm 1e-6.
        self.assertLess(abs(inside.mean() - 0.9), 5 * np.sqrt(0.09 / 4000))


class Validation(unittest.TestCase):
    @staticmethod
    def draw(rng):
        truth = SO3.exp(rng.uniform(-1, 1, 3))
        return truth, truth.retract(0.1 * rng.standard_normal((8, 3)))

    def test_a_right_covariance_passes(self):
        report = liestat.validate(lambda x: liestat.tested_fuse(x, 0.01 * np.eye(3)).estimate, self.draw, trials=300)
        self.assertTrue(report.passed, str(report))
        self.assertIn("validation index", str(report))
        self.assertEqual((report.trials, report.failures, len(report.distances)), (300, 0, 300))
        self.assertLess(abs(report.index - 3), 5 * np.sqrt(6 / 300))
        by_residuals = liestat.validate(liestat.mean, self.draw, trials=300)
        self.assertEqual(by_residuals.law, Law(3, 8))
        self.assertTrue(by_residuals.passed, str(by_residuals))

    def test_noise_that_chance_refutes_is_no_failure(self):
        def estimator(x):
            return liestat.mean(x, covariances=0.01 * np.eye(3), criterion="maha")

        report = liestat.validate(estimator, self.draw, trials=3000)
        self.assertTrue(0 < report.failures < 15, report.failures)
        self.assertTrue(report.passed, str(report))
        strict = liestat.validate(estimator, self.draw, trials=3000, failure_fraction=0.0)
        self.assertEqual(strict.verdict, "too_many_failures")

        def half(x):
            return liestat.mean(x, covariances=0.005 * np.eye(3), criterion="maha")

        self.assertFalse(liestat.validate(half, self.draw, trials=300).passed)

    def test_a_wrong_one_fails(self):
        report = liestat.validate(lambda x: (liestat.mean(x).mean, 0.0003 * np.eye(3)), self.draw, trials=300)
        self.assertEqual((report.passed, report.verdict), (False, "index_too_large"))
        self.assertNotIn("\n", repr(report))

    def test_failures_are_counted(self):
        def estimator(x):
            if x.params[0, 0] > 0:
                raise RuntimeError("no")
            return None

        report = liestat.validate(estimator, self.draw, trials=50, law=Law(3))
        self.assertEqual((report.failures, report.verdict), (50, "no_trial_succeeded"))
        self.assertTrue(0 < report.exceptions < 50)

    def test_vectors(self):
        def draw(rng):
            truth = rng.standard_normal(2)
            return truth, truth + rng.standard_normal((5, 2))

        report = liestat.validate(lambda x: (x.mean(0), np.eye(2) / 5), draw, trials=400)
        self.assertTrue(report.passed, str(report))


if __name__ == "__main__":
    unittest.main()
