"""`liestat evaluate` and `evaluate_trajectory`: the same fields, values, defaults and verdicts on the same files."""

import inspect
import os
import tempfile
import unittest
import warnings

import numpy as np
import support
from parity import ParityTest, plain, program

import liestat
from liestat import SE3

# The orders in which compilers add the squares of four numbers.
ORDERS_OF_SUM = ((0, 1, 2, 3), (0, 2, 1, 3))
# Fields of a run, which the program's JSON has once for all estimates.
SETTING = ("reference_poses", "association", "ape_unit", "rpe_unit", "pairs_model")
SERIES = ("rows", "times", "ape_errors", "rpe_errors", "pairs", "position_errors", "rotation_errors", "errors")
SERIES += ("covariances", "nees", "position", "rotation")

SETTINGS = (
    ([], {}),
    (["-a"], {"alignment": "se3"}),
    (["-s"], {"alignment": "scale"}),
    (["-a", "-s"], {"alignment": "sim3"}),
    (["--align_origin"], {"alignment": "origin"}),
    (["--alignment", "posyaw"], {"alignment": "posyaw"}),
    (["-s", "--verdict-alignment", "se3"], {"alignment": "scale", "verdict_alignment": "se3"}),
    (["-a", "-s", "--n_to_align", "40"], {"alignment": "sim3", "n_to_align": 40}),
    (["-a", "-s", "--association", "nearest"], {"alignment": "sim3", "association": "nearest"}),
    (["--association", "nearest", "--t_max_diff", "0.03"], {"association": "nearest", "t_max_diff": 0.03}),
    (
        ["-a", "--interpolation", "slerp", "--t_offset", "0.03"],
        {"alignment": "se3", "interpolation": "slerp", "t_offset": 0.03},
    ),
    (["-a", "--max-gap", "0.05"], {"alignment": "se3", "max_gap": 0.05}),
    (
        ["-a", "-s", "--t_offset", "0.002", "--t_start", "3", "--t_end", "15"],
        {"alignment": "sim3", "t_offset": 0.002, "t_start": 3, "t_end": 15},
    ),
    (["-a", "-r", "angle_deg"], {"alignment": "se3", "pose_relation": "angle_deg"}),
    (
        ["-a", "-s", "-r", "point_distance_error_ratio", "--change_unit", "cm"],
        {"alignment": "sim3", "pose_relation": "point_distance_error_ratio", "change_unit": "cm"},
    ),
    (
        ["-a", "-s", "-r", "full", "--project_to_plane", "xz"],
        {"alignment": "sim3", "pose_relation": "full", "project_to_plane": "xz"},
    ),
    (["-a", "-s", "--downsample", "50"], {"alignment": "sim3", "downsample": 50}),
    (["-a", "-s", "--motion_filter", "1.5,20"], {"alignment": "sim3", "motion_filter": (1.5, 20)}),
    (
        ["-a", "-s", "-d", "3", "-u", "m", "-t", "0.2", "--all_pairs", "--pairs_from_reference"],
        {
            "alignment": "sim3",
            "delta": 3,
            "delta_unit": "m",
            "delta_tol": 0.2,
            "all_pairs": True,
            "pairs_from_reference": True,
        },
    ),
    (["-a", "-s", "-d", "30", "-u", "d"], {"alignment": "sim3", "delta": 30, "delta_unit": "d"}),
    (["-a", "-d", "1e9", "-u", "m"], {"alignment": "se3", "delta": 1e9, "delta_unit": "m"}),
    (["-a", "-s", "--pairs-model", "independent"], {"alignment": "sim3", "pairs_model": "independent"}),
    (["-a", "-s", "--pairs-model", "chain", "-d", "5"], {"alignment": "sim3", "pairs_model": "chain", "delta": 5}),
)


def exactly_normed(poses, g):
    """The poses with quaternions whose norm is 1 to the last bit, so that a reader that normalises them changes nothing."""
    params = poses.params.copy()
    params[:, :4] /= np.linalg.norm(params[:, :4], axis=1)[:, None]
    for q in params[:, :4]:
        found = q.copy()
        while any(sum(found[[a, b]] ** 2) + sum(found[[c, d]] ** 2) != 1 for a, b, c, d in ORDERS_OF_SUM):
            found = q + 2.0**-51 * g.uniform(-1, 1, 4)
        q[:] = found
    return SE3(params)


class Evaluate(ParityTest):
    function = "evaluate_trajectory"

    @classmethod
    def setUpClass(cls):
        cls.directory = tempfile.TemporaryDirectory()
        g = support.generator(7)
        n = 200
        cls.times = np.arange(n) * 0.1
        turn = np.stack([np.sin(cls.times), np.cos(0.7 * cls.times), 0.3 * cls.times], 1)
        cls.truth = exactly_normed(SE3.exp(np.concatenate([5 * turn, turn], 1)), g)
        root = np.diag([0.05, 0.05, 0.02, 0.01, 0.01, 0.02]) @ (np.eye(6) + 0.2 * np.tri(6, k=-1))
        estimate = SE3.exp([3.0, -2.0, 1.0, 0.02, -0.03, 1.1]) * cls.truth * SE3.exp(g.standard_normal((n, 6)) @ root.T)
        # Lengths of the estimate are nine tenths of the reference's.
        lengths = np.diag([0.9] * 3 + [1.0] * 3)
        c = lengths @ root @ root.T @ lengths
        cls.covariance = np.tile((c + c.T) / 2, (n, 1, 1)) * g.uniform(0.9, 1.1, (n, 1, 1))
        params = estimate.params.copy()
        params[:, 4:] *= 0.9
        cls.estimate = exactly_normed(SE3(params), g)
        cls.reference_file = cls.write("gt.tum", cls.times, cls.truth)
        cls.estimate_file = cls.write("est.tum", cls.times, cls.estimate)
        cls.with_covariances = cls.write("rows.tum", cls.times, cls.estimate, cls.covariance)

    @classmethod
    def tearDownClass(cls):
        cls.directory.cleanup()

    @classmethod
    def write(cls, name, times, poses, covariances=None):
        path = os.path.join(cls.directory.name, name)
        quaternions, positions = poses.params[:, :4], poses.params[:, 4:]
        columns = [times[:, None], positions, quaternions]
        if covariances is not None:
            columns.append(covariances.reshape(-1, 36))
        np.savetxt(path, np.concatenate(columns, axis=1), fmt="%.17g")
        return path

    def run_program(self, *arguments):
        words = ("--format", "tum", "--cov-layout", "full36", "--cov-from", "right")
        return program("evaluate", self.reference_file, self.with_covariances, *words, *arguments, codes=(0, 3))

    def run_module(self, covariances=True, **options):
        matrices = self.covariance if covariances else None
        return liestat.evaluate_trajectory(
            self.truth, self.estimate, matrices, reference_times=self.times, times=self.times, **options
        )

    def compare(self, run, result, path):
        self.assertIs(run["estimates"][0]["consistent"], result.consistent, path)
        for name in SETTING:
            self.assertEqual(run[name], plain(result[name]), f"{path}: {name}")
        self.assert_equal_results(run["estimates"][0], result, SETTING + SERIES, path)
        self.assertGreaterEqual(len(result.segments), 3, path)

    def test_settings(self):
        verdicts = set()
        for arguments, options in SETTINGS:
            with self.subTest(" ".join(arguments)):
                result = self.run_module(**options)
                verdicts.add(result.consistent)
                self.compare(self.run_program(*arguments), result, " ".join(arguments))
        self.assertEqual(verdicts, {True, False})

    def test_scale_correction(self):
        # Lengths are off by a tenth: with its scale the estimate is consistent, without it NEES is many times too large.
        for arguments, alignment in ((["-s", "--verdict-alignment", "sim3"], "scale"), (["-a", "-s"], "sim3")):
            result = self.run_module(alignment=alignment)
            self.assertEqual(result.weighted_alignment.model, "sim3")
            self.assertIs(self.run_program(*arguments)["estimates"][0]["consistent"], True)
            self.assertIs(result.consistent, True, result.verdict)
        self.assertGreater(self.run_module(alignment="se3").tests.joint_nees.ratio, 10)

    def test_wrong_covariances(self):
        path = self.write("small.tum", self.times, self.estimate, 0.25 * self.covariance)
        words = ("--format", "tum", "--cov-layout", "full36", "--cov-from", "right")
        run = program("evaluate", self.reference_file, path, *words, "-a", "-s")
        result = liestat.evaluate_trajectory(
            self.truth,
            self.estimate,
            0.25 * self.covariance,
            reference_times=self.times,
            times=self.times,
            alignment="sim3",
        )
        self.assertIs(result.consistent, False)
        self.assertTrue(result.verdict.startswith("OVERCONFIDENT"))
        self.compare(run, result, "wrong covariances")

    def test_without_covariances(self):
        run = program("evaluate", self.reference_file, self.estimate_file, "-a")
        result = self.run_module(covariances=False, alignment="se3")
        self.assertIsNone(result.consistent)
        self.compare(run, result, "without covariances")

    def test_defaults(self):
        defaults = liestat._core.evaluation_options()
        signature = inspect.signature(liestat.evaluate_trajectory).parameters
        arrays = {"reference", "estimate", "covariances", "reference_times", "times", "reference_covariances"}
        self.assertEqual({n: p.default for n, p in signature.items() if n not in arrays}, defaults)
        explicit = []
        for name, value in defaults.items():
            if value is not None and value is not False:
                explicit += [f"--{name}", str(value)]
        self.assertGreaterEqual(len(explicit), 2 * 10)
        implicit, given = self.run_program(), self.run_program(*explicit)
        for run in (implicit, given):
            run.pop("command_line")
        self.assertEqual(implicit, given)

    def test_faults(self):
        late = self.write("late.tum", self.times + 1000, self.estimate)
        try:
            program("evaluate", self.reference_file, late)
        except AssertionError as error:
            message = str(error)
        with self.assertRaisesRegex(ValueError, "do not overlap those of the reference"):
            liestat.evaluate_trajectory(
                self.truth, self.estimate, reference_times=self.times, times=self.times + 1000
            )
        self.assertIn("its times, 1000 to 1019.9 s, do not overlap", message)
        with self.assertRaisesRegex(ValueError, "errors in m have no unit deg"):
            self.run_module(change_unit="deg")
        with self.assertRaisesRegex(ValueError, "all pairs overlap"):
            self.run_module(all_pairs=True, pairs_model="chain")
        with self.assertRaisesRegex(ValueError, "pairs_model: expected one of 'independent', 'chain', got 'ring'"):
            self.run_module(pairs_model="ring")
        with self.assertRaisesRegex(ValueError, "downsample: got -1"):
            self.run_module(downsample=-1)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            line = SE3.exp(np.outer(np.arange(10.0), [1, 0, 0, 0, 0, 0]))
            r = liestat.evaluate_trajectory(line, line, alignment="se3")
        self.assertFalse(r.alignment.ok)
        self.assertIn("collinear", r.alignment.fault)
        self.assertIsNone(r.consistent)
        self.assertTrue(np.isnan(r.ape.rmse))
        self.assertIn("collinear", str(caught[0].message))


if __name__ == "__main__":
    unittest.main()
