"""Sensors and estimators, on simulated data with known truth."""

import unittest

import numpy as np
import support

import liestat
from liestat import SE3, SE23, SO3, Camera


class Preintegration(unittest.TestCase):
    rate, force = np.array([0.1, -0.2, 0.3]), np.array([0.5, 0.2, 9.7])

    def recording(self, n=201):
        t = np.linspace(0, 2, n)
        return t, np.tile(self.rate, (n, 1)), np.tile(self.force, (n, 1))

    def test_constant_motion(self):
        """A constant rate and force have a closed form; here by small steps of the definition."""
        begin, end = np.array([[0.0, 0.25], [0.5, 1.0]]), np.array([[1.0, 1.25], [2.0, 1.7]])
        result = liestat.preintegrate(*self.recording(), begin, end, noise=(1e-3, 1e-2))
        self.assertEqual(result.increment.shape, (2, 2))
        self.assertEqual(result.covariance.shape, (2, 2, 9, 9))
        self.assertTrue(result.ok.all())
        for i in np.ndindex(2, 2):
            h = end[i] - begin[i]
            n = 2000
            middle = (np.arange(n) + 0.5) * h / n
            forces = SO3.exp(middle[:, None] * self.rate).act(self.force)
            np.testing.assert_allclose(result.increment[i].rotation.log(), h * self.rate, atol=1e-12)
            np.testing.assert_allclose(result.increment[i].velocity, forces.sum(0) * h / n, atol=1e-6)
            position = ((h - middle)[:, None] * forces).sum(0) * h / n
            np.testing.assert_allclose(result.increment[i].position, position, atol=1e-6)
            # White noise of the gyroscope alone determines the rotation's covariance. The first and the last reading, at
            # the ends, count half: a quarter of the variance each.
            np.testing.assert_allclose(
                result.covariance[i][3:6, 3:6], 1e-6 * (h - 0.01 / 2) * np.eye(3), rtol=1e-6, atol=1e-12
            )

    def test_bias_jacobian(self):
        t, w, f = self.recording()
        at = liestat.preintegrate(t, w, f, 0.0, 1.0)
        self.assertTrue(at.increment.single)
        for i in range(6):
            bias = np.zeros(6)
            bias[i] = 1e-5
            moved = [liestat.preintegrate(t, w, f, 0.0, 1.0, bias=s * bias).increment for s in (-1, 1)]
            slope = (at.increment.local(moved[1]) - at.increment.local(moved[0])) / 2e-5
            np.testing.assert_allclose(at.bias_jacobian[:, i], slope, atol=1e-6)

    def test_faults(self):
        t, w, f = self.recording()
        with self.assertWarnsRegex(UserWarning, "1 of 2 intervals are not usable; 1: the readings do not reach"):
            result = liestat.preintegrate(t, w, f, [0.0, 1.0], [1.0, 3.0])
        self.assertEqual(result.ok.tolist(), [True, False])
        self.assertTrue(np.isnan(result.covariance[1]).all())
        with self.assertRaisesRegex(ValueError, r"preintegrate: rates: expected shape \(\.\.\., 3\), got \(201, 2\)"):
            liestat.preintegrate(t, w[:, :2], f, 0.0, 1.0)
        with self.assertRaisesRegex(ValueError, "lengths differ: times 201, rates 200"):
            liestat.preintegrate(t, w[1:], f, 0.0, 1.0)
        w[7, 1] = np.nan
        with self.assertRaisesRegex(ValueError, r"preintegrate: rates, shape \(201, 3\): not finite at index \(7, 1\)"):
            liestat.preintegrate(t, w, f, 0.0, 1.0)


class HandEye(unittest.TestCase):
    def scene(self, seed=0, n=20, sigma=0.002):
        rng = support.generator(seed)
        X, Y = SE3.exp([0.05, 0.02, 0.1, 0.1, 0.3, 0]), SE3.exp([0.8, 0.1, 0, 0, 0, 1.0])
        A = SE3.exp(0.6 * rng.standard_normal((n, 6)))
        B = Y.inv() * A * X
        covariance = sigma**2 * np.eye(6)
        return X, Y, liestat.sample(A, covariance, rng=rng), liestat.sample(B, covariance, rng=rng), covariance

    def test_truth_is_within_its_covariance(self):
        """Sum over 20 scenes of χ²₆: 120 expected, a false alarm 1e-6 above 200."""
        total = 0
        for seed in range(20):
            X, Y, A, B, covariance = self.scene(seed)
            result = liestat.hand_eye(A, B, covariance, covariance)
            self.assertEqual(result.status, "ok")
            total += float(result.X.mahalanobis(X)) ** 2
        self.assertLess(total, 200)
        self.assertLess(np.linalg.norm(result.Y.mean.local(Y)), 0.02)
        self.assertEqual(result.errors.shape, (20, 6))

    def test_open_direction_and_outlier(self):
        X, Y, A, B, covariance = self.scene()
        turned = SE3.exp(support.generator(1).standard_normal((20, 6)) * [0.3, 0.3, 0, 0, 0, 1])
        with self.assertWarnsRegex(UserWarning, "undetermined"):
            planar = liestat.hand_eye(turned, Y.inv() * turned * X, covariance, covariance)
        self.assertEqual(len(planar.open_directions), 1)
        self.assertIn("translation along the rotation axis", planar.open_directions[0].description)
        wrong = B.copy()
        wrong[3] = wrong[3] * SE3.exp([0.5, 0, 0, 0, 0, 0])
        self.assertEqual(liestat.hand_eye(A, wrong, covariance, covariance).outliers, [3])

    def test_refusals(self):
        _, _, A, B, covariance = self.scene()
        with self.assertRaisesRegex(TypeError, r"hand_eye: a: expected SE3 of shape \(n,\)"):
            liestat.hand_eye(A.params, B, covariance, covariance)
        with self.assertRaisesRegex(ValueError, "lengths differ: a 20, b 19"):
            liestat.hand_eye(A, B[1:], covariance, covariance)
        with self.assertRaisesRegex(ValueError, r"hand_eye: a_covariance: expected shape \(\.\.\., 6, 6\)"):
            liestat.hand_eye(A, B, np.eye(3), covariance)


class TwoViews(unittest.TestCase):
    camera = Camera(600, 600, 320, 240, width=640, height=480)

    def scene(self, n=120, wrong=20, noise=0.5):
        rng = support.generator(2)
        points = np.column_stack([rng.uniform(-2, 2, n), rng.uniform(-1.5, 1.5, n), rng.uniform(4, 10, n)])
        pose = SE3.from_components([-0.8, 0.1, 0.05], SO3.exp([0.02, -0.1, 0.03]))
        def pixels(p):
            return p[:, :2] / p[:, 2:] * 600 + [320, 240]

        matches = np.hstack([pixels(points), pixels(pose.act(points))]) + noise * rng.standard_normal((n, 4))
        matches[:wrong, 2:] = rng.uniform([0, 0], [640, 480], (wrong, 2))
        return pose, matches

    def check(self, pose, found, sigmas=6):
        self.assertLess(pose.rotation.distance(found.rotation), 0.02)
        direction = liestat.S2.from_vector(pose.translation)
        self.assertLess(direction.distance(found.direction), 0.1)
        self.assertEqual(found.covariance.shape, (5, 5))

    def test_model_is_chosen(self):
        pose, matches = self.scene()
        found = liestat.two_view(matches, 0.5, self.camera)
        self.assertEqual((found.status, found.model), ("ok", "essential"))
        with self.assertWarns(DeprecationWarning):
            self.check(pose, found.relative_pose)
        self.assertLess(found.inlier[:20].sum(), 5)
        self.assertGreater(found.inlier[20:].sum(), 90)
        self.assertTrue(found.parameters)

    def test_one_model(self):
        pose, matches = self.scene()
        normalised = (matches - [320, 240, 320, 240]) / 600
        found = liestat.robust_two_view("pose", normalised, 0.5 / 600)
        self.assertEqual(found.status, "ok")
        self.check(pose, found.relative_pose)
        F = liestat.robust_two_view("fundamental", matches, 0.5).matrix
        ones = np.ones((len(matches) - 20, 1))
        first, second = np.hstack([matches[20:, :2], ones]), np.hstack([matches[20:, 2:], ones])
        line = first @ F.T
        distance = np.abs(np.sum(second * line, 1)) / np.linalg.norm(line[:, :2], axis=1)
        self.assertLess(np.median(distance), 1.0)

    def test_too_few(self):
        with self.assertWarnsRegex(UserWarning, "two_view"):
            self.assertNotEqual(liestat.two_view(np.empty((0, 4)), 1.0).status, "ok")
        with self.assertRaisesRegex(ValueError, r"two_view: matches: expected shape \(\.\.\., 4\), got \(5, 3\)"):
            liestat.two_view(np.zeros((5, 3)))
        with self.assertRaisesRegex(ValueError, "model: expected"):
            liestat.robust_two_view("affine", np.zeros((5, 4)), 1.0)

    def test_camera(self):
        rays, sigmas = self.camera.bearings([[320, 240], [920, 240]], 1.0)
        np.testing.assert_allclose(rays, [[0, 0, 1], [np.sqrt(0.5), 0, np.sqrt(0.5)]], atol=1e-12)
        self.assertAlmostEqual(sigmas[0], 1 / 600)
        with self.assertRaisesRegex(ValueError, "focal lengths"):
            Camera(0, 1, 0, 0)


class Motion(unittest.TestCase):
    def test_constant_motion(self):
        rng = support.generator(3)
        points = np.column_stack([rng.uniform(-3, 3, 40), rng.uniform(-3, 3, 40), rng.uniform(6, 12, 40)])
        step = SE3.from_components([0.1, 0.02, 0.05], SO3.exp([0.0, 0.01, 0.02]))
        frames, tracks, xy = [], [], []
        for i in range(30):
            frames.append(np.full(40, i))
            tracks.append(np.arange(40))
            xy.append(points[:, :2] / points[:, 2:] + 5e-4 * rng.standard_normal((40, 2)))
            points = step.act(points)
        data = [np.concatenate(part) for part in (frames, tracks, xy)]
        result = liestat.motion(*data, 5e-4, frames_apart=4)
        self.assertEqual((len(result.direction), len(result.rotation), result.usable.shape), (30, 30, (30,)))
        self.assertEqual((len(result.frames), result.frames[0].frame), (29, 1))
        self.assertTrue(result.usable[-1])
        self.assertLess(result.rotation[-1].distance(step.rotation), 0.003)
        # The velocity is the translation half-way through the rotation.
        direction = liestat.S2.from_vector(SO3.exp([0, 0.005, 0.01]).inv().act(step.translation))
        self.assertLess(result.direction[-1].distance(direction), 0.05)
        with self.assertRaisesRegex(ValueError, "tracks: expected integers"):
            liestat.motion([0], [0.5], [[0, 0]], 1.0)
        empty = liestat.motion(np.empty(0, int), np.empty(0, int), np.empty((0, 2)), 1.0)
        self.assertEqual(len(empty.direction), 0)


class VisualInertial(unittest.TestCase):
    def test_velocity_gravity_and_scale(self):
        """A body that turns and accelerates, exact trajectories by fine integration, noisy bearings."""
        rng = support.generator(4)
        g = np.array([0, 0, -9.81])
        n, h = 2001, 1e-3
        t = h * np.arange(n)
        rates = np.column_stack([0.6 * np.sin(2 * t), 0.5 * np.cos(1.5 * t), 0.4 * np.sin(t + 1)])
        accelerations = np.column_stack([2 * np.sin(3 * t), 1.5 * np.cos(2 * t), np.sin(4 * t + 0.5)])
        rotations = [SO3.identity()]
        for i in range(n - 1):
            rotations.append(rotations[-1] * SO3.exp(h * 0.5 * (rates[i] + rates[i + 1])))
        R = SO3.stack(rotations)
        v0 = np.array([0.5, -0.3, 0.2])

        def integral(x):
            return np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * h * (x[1:] + x[:-1]), 0)])

        velocity = v0 + integral(accelerations)
        position = integral(velocity)
        forces = R.inv().act(accelerations - g)
        noise = (1e-4, 1e-3)
        keep = slice(None, None, 5)
        sampled = [rates[keep], forces[keep]]
        for values, density in zip(sampled, noise):
            values += density / np.sqrt(5 * h) * rng.standard_normal(values.shape)
        landmarks = np.column_stack([rng.uniform(-4, 4, (25, 2)), rng.uniform(4, 9, 25)])
        at = np.arange(0, n, 100)
        images, tracks = np.repeat(np.arange(len(at)), 25), np.tile(np.arange(25), len(at))
        rays = R[at][:, None].inv().act(landmarks - position[at][:, None]).reshape(-1, 3)
        rays /= np.linalg.norm(rays, axis=1)[:, None]
        rays += 1e-3 * rng.standard_normal(rays.shape)
        result = liestat.vi_init(t[keep], *sampled, noise, t[at], images, tracks, rays, 1e-3)
        self.assertEqual(len(result.windows), 1)
        window = result.windows[0]
        self.assertEqual(window.status, "ok", window.reason)
        for name, truth, rank in (("velocity", v0, 3),):
            error = getattr(window, name) - truth
            self.assertLess(np.linalg.norm(error), 0.1)
            # χ²₃ exceeds 30 with 1.4e-6.
            self.assertLess(error @ np.linalg.solve(window.block(name), error), 30)
        self.assertLess(np.linalg.norm(window.gravity - g), 0.3)
        self.assertIsInstance(window.states, SE23)
        self.assertEqual(window.block("velocity", "gravity").shape, (3, 3))
        with self.assertRaisesRegex(ValueError, r"vi_init: images: expected integers of shape"):
            liestat.vi_init(t[keep], *sampled, noise, t[at], images[1:], tracks, rays, 1e-3)


if __name__ == "__main__":
    unittest.main()
