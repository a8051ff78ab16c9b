"""`doctor` of the program and `diagnose_conventions`: the same fields, values and verdict on the same files."""

import os
import subprocess
import tempfile
import unittest

import numpy as np
from parity import PROGRAM, ParityTest, plain, program
from support import generator

import liestat
from liestat import SE3

EXIT_CODES = {True: 0, None: 4, False: 5}


def scene(n, seed, dead_reckoning=False, scale=1.0):
    """A path in all directions, an estimate of it, and the covariances from which its errors are drawn."""
    rng = generator(seed)
    steps = SE3.exp(rng.standard_normal((n, 6)) * [0.3, 0.3, 0.3, 0.4, 0.4, 0.4])
    sigmas = [0.01, 0.012, 0.015, 0.002, 0.0025, 0.003]
    roots = rng.standard_normal((n, 6, 6)) * 0.4 + np.eye(6)
    covariances = np.einsum("i,nij,nkj,k->nik", sigmas, roots, roots, sigmas)
    errors = np.einsum("nij,nj->ni", np.linalg.cholesky(covariances), rng.standard_normal((n, 6)))
    truth, motions = [SE3.identity()], [SE3.identity()]
    estimate = [truth[0]]
    for i in range(1, n):
        truth.append(truth[-1] * steps[i])
        motions.append(steps[i] * SE3.exp(-errors[i]))
        if dead_reckoning:
            estimate.append(estimate[-1] * motions[-1])
            adjoint = motions[-1].inv().Adj()
            covariances[i] += adjoint @ covariances[i - 1] @ adjoint.T
        else:
            estimate.append(truth[-1] * SE3.exp(-errors[i]))
    if not dead_reckoning:
        estimate[0] = truth[0] * SE3.exp(-errors[0])
    join = lambda poses: SE3(np.array([p.params for p in poses]))  # noqa: E731
    return join(truth), join(estimate), scale * covariances


def rounded(value, digits):
    if isinstance(value, dict):
        return {name: rounded(v, digits) for name, v in value.items()}
    if isinstance(value, list):
        return [rounded(v, digits) for v in value]
    return float(f"{value:.{digits}g}") if isinstance(value, float) else value


class DoctorParity(ParityTest):
    function = "diagnose_conventions"

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.directory = directory.name

    def path(self, name):
        return os.path.join(self.directory, name)

    def estimate(self, name, poses, covariances, convention, times):
        """TUM with 36 numbers more in each row."""
        matrices = liestat.convert_trajectory(poses, covariances, "right", convention).matrices
        with open(self.path(name), "w", encoding="utf-8") as file:
            for t, p, m in zip(times, poses.params, matrices):
                row = [t, *p[4:], *p[:4], *m.ravel()]
                file.write(" ".join(repr(float(x)) for x in row) + "\n")
        return self.path(name)

    def truth(self, name, poses, times):
        """The file, and the poses as they are read from it: normalised."""
        liestat.write_trajectory(self.path(name), poses, format="tum", times=times)
        return self.path(name), liestat.read_trajectory(self.path(name)).poses

    def compare(self, words, ours, digits=None, read=()):
        """With `digits` numbers are equal to so many. `read`: files as read_trajectory returns them, whose notes the
        program says first."""
        decided = ours.decided
        theirs = program("doctor", *words, codes=(EXIT_CODES[decided],))
        for name, file in read:
            for note in file.notes:
                self.assertEqual(theirs["file_notes"].pop(0), f"{name}: {note}")
        # The program's notes name files.
        for names, word in ((theirs.pop("files"), "the estimate"), ([theirs.pop("reference")], "the truth")):
            for name in filter(None, names):
                theirs["file_notes"] = [note.replace(name, word) for note in theirs["file_notes"]]
        if digits is None:
            self.assert_equal_results(theirs, ours)
        else:
            self.assert_equal_results(rounded(theirs, digits), rounded(plain(ours), digits))
        if ours.mode != "plan":
            said = subprocess.run([PROGRAM, "doctor", *words], capture_output=True, text=True).stdout
            self.assertEqual(said.splitlines()[0], ours.sentence)
        return ours

    def read(self, path):
        return liestat.read_trajectory(path, "unknown", layout="full36", format="tum")

    def test_errors_against_a_truth(self):
        times = np.arange(80) * 0.1 + 5
        words = ["--format", "tum", "--cov-layout", "full36"]
        for convention, scale, accepted, decided in (
            ("ros-fixed", 1, "ros-fixed", True),
            ("left,order=rt,content=information", 1, "left,order=rt,content=information", True),
            ("right,unit=deg,content=sigmas", 1, "right,unit=deg,content=sigmas", True),
            ("left", 0.25, "left", False),
        ):
            with self.subTest(convention):
                truth, poses, covariances = scene(80, 11, scale=scale)
                estimate = self.estimate("est.txt", poses, covariances, convention, times)
                reference, truth = self.truth("gt.tum", truth, times)
                read = self.read(estimate)
                ours = liestat.diagnose_conventions(
                    read.poses, read.matrices, truth, times=read.times, truth_times=times
                )
                self.compare([estimate, reference, *words], ours)
                self.assertEqual(ours.accepted, [accepted], ours.sentence)
                self.assertIs(ours.decided, decided)
        # A level of the user's, and a truth in another world.
        stamps = {"times": times, "truth_times": times}
        ours = liestat.diagnose_conventions(read.poses, read.matrices, truth, **stamps, alpha=0.01)
        self.compare([estimate, reference, *words, "--alpha", "0.01"], ours)
        world = SE3.exp(np.array([1.0, 2, 3, 0.3, -0.5, 0.7]))
        moved, moved_truth = self.truth("moved.tum", world * truth, times)
        for align in ("se3", "posyaw"):
            ours = liestat.diagnose_conventions(
                read.poses, read.matrices, moved_truth, times=times, truth_times=times, align=align
            )
            self.compare([estimate, moved, *words, "--align", align], ours)

    def test_misfit(self):
        truth, poses, covariances = scene(60, 13)
        times = np.arange(60) * 0.1
        inverted = self.estimate("est.txt", poses.inv(), covariances, "right", times)
        reference, truth = self.truth("gt.tum", truth, times)
        read = self.read(inverted)
        ours = liestat.diagnose_conventions(
            read.poses, read.matrices, truth, times=read.times, truth_times=times, misfit=True
        )
        self.assertEqual(ours.misfit.explanations[0].faults, ["inverse"], ours.sentence)
        self.assertTrue(ours.sentence.startswith("MISFIT: explained"), ours.sentence)
        self.compare([inverted, reference, "--format", "tum", "--cov-layout", "full36", "--misfit"], ours)

    def test_association(self):
        truth, poses, covariances = scene(60, 12)
        times = np.arange(60) * 0.1
        some = np.arange(0, 60, 2)
        estimate = self.estimate("est.txt", poses[some], covariances[some], "right", times[some] + 0.004)
        # Gaps of 0.4 s and of 1 s: within five median steps, and beyond them.
        keep = np.delete(np.arange(60), [5, 6, 7, *range(20, 29)])
        reference, truth = self.truth("gt.tum", truth[keep], times[keep])
        read = self.read(estimate)
        words = [estimate, reference, "--format", "tum", "--cov-layout", "full36"]
        for flags, options in (
            ([], {}),
            (["--interpolation", "slerp", "--max-gap", "2"], {"interpolation": "slerp", "max_gap": 2}),
            (["--association", "nearest"], {"association": "nearest"}),
            (
                ["--association", "nearest", "--t_max_diff", "0.003", "--t_offset=-0.002"],
                {"association": "nearest", "max_difference": 0.003, "offset": -0.002},
            ),
            (["--t_start", "1", "--t_end", "4.5"], {"start": 1, "end": 4.5}),
        ):
            ours = liestat.diagnose_conventions(
                read.poses, read.matrices, truth, times=read.times, truth_times=times[keep], **options
            )
            self.compare([*words, *flags], ours)
        self.assertLess(ours.n, 20)
        self.assertEqual(ours.file_notes, [f"{ours.n} of 30 poses of the estimate have a partner in the truth"])

    def test_quaternions_with_w_first(self):
        truth, poses, covariances = scene(60, 14)
        times = np.arange(60) * 0.1
        wrong = SE3(poses.params[:, [3, 0, 1, 2, 4, 5, 6]])
        estimate = self.estimate("est.txt", wrong, covariances, "right", times)
        reference, truth = self.truth("gt.tum", truth, times)
        read = self.read(estimate)
        ours = liestat.diagnose_conventions(read.poses, read.matrices, truth, times=times, truth_times=times)
        self.compare([estimate, reference, "--format", "tum", "--cov-layout", "full36"], ours)
        self.assertRegex(ours.file_notes[0], "quaternions of the estimate look as if w came first")

    def test_dead_reckoning_and_the_plan(self):
        truth, poses, covariances = scene(60, 13, dead_reckoning=True)
        times = np.arange(60) * 0.1
        estimate = self.estimate("est.txt", poses, covariances, "right,unit=half", times)
        reference, truth = self.truth("gt.tum", truth, times)
        words = ["--format", "tum", "--cov-layout", "full36"]
        read = self.read(estimate)
        ours = liestat.diagnose_conventions(read.poses, read.matrices, truth, times=times, truth_times=times)
        self.compare([estimate, reference, *words], ours)
        self.assertTrue(ours.correlated)
        self.assertEqual(ours.accepted, ["right,unit=half"])
        ours = liestat.diagnose_conventions(read.poses, read.matrices, no_truth=True)
        self.compare([estimate, "--no-truth", *words], ours)
        self.assertEqual(ours.chain.accepted, ["right,unit=half"])
        self.assertEqual(ours.mode, "chain")
        for flags, options in ([], {}), (["--all-units"], {"all_units": True}):
            ours = liestat.diagnose_conventions(read.poses, read.matrices, plan=True, **options)
            self.compare([estimate, "--plan", *flags, *words], ours)
            self.assertEqual(len(ours.plan), 72 if flags else 18)
            self.assertIn(f"of {len(ours.plan)} conventions", ours.sentence)

    def test_several_runs(self):
        files, runs = [], []
        times = np.arange(15) * 0.1
        truth, _, _ = scene(15, 20)
        for run in range(12):
            path_truth, poses, covariances = scene(15, 30 + run, dead_reckoning=True)
            moved = SE3(np.array([(t * (e.inv() * p).inv()).params for t, e, p in zip(truth, poses, path_truth)]))
            files.append(self.estimate(f"{run}.txt", moved, covariances, "left", times))
            runs.append(self.read(files[-1]))
        reference, truth = self.truth("gt.tum", truth, times)
        words = [*files, reference, "--format", "tum", "--cov-layout", "full36"]
        for flags, options in ([], {}), (["--at", "0.72"], {"at": 0.72}):
            ours = liestat.diagnose_conventions(
                [r.poses for r in runs],
                [r.matrices for r in runs],
                truth,
                times=[r.times for r in runs],
                truth_times=times,
                **options,
            )
            self.compare([*words, *flags], ours)
            self.assertEqual([ours.n, ours.what], [12, "runs at 0.72 s" if flags else "runs at 1.4 s"])

    def test_edges(self):
        truth, poses, covariances = scene(40, 17)
        matrices = liestat.convert_trajectory(poses, covariances, "right", "g2o-half").matrices
        upper = np.triu_indices(6)

        def line(tag, ids, pose, numbers=()):
            p = pose.params
            return " ".join([tag, *map(str, ids), *(repr(float(x)) for x in [*p[4:], *p[:4], *numbers])]) + "\n"

        vertices = [SE3.identity()]
        for t in truth:
            vertices.append(vertices[-1] * t)
        known = "".join(line("VERTEX_SE3:QUAT", [i], v) for i, v in enumerate(vertices))
        edges = "".join(
            line("EDGE_SE3:QUAT", [i, i + 1], poses[i], matrices[i][upper]) for i in range(len(poses))
        )
        for name, text in ("edges.g2o", known + edges), ("truth.g2o", known):
            with open(self.path(name), "w", encoding="utf-8") as file:
                file.write(text)
        graph = liestat.read_pose_graph(self.path("edges.g2o"))
        at = {int(k): p for k, p in zip(graph.ids, liestat.read_pose_graph(self.path("truth.g2o")).poses)}
        relative = [(at[s].inv() * at[t]).params for s, t in zip(graph.sources, graph.targets)]
        ours = liestat.diagnose_conventions(graph.measurements, graph.matrices, SE3(np.array(relative)), edges=True)
        # The module's products of poses round otherwise than the program's.
        self.compare([self.path("edges.g2o"), self.path("truth.g2o")], ours, digits=8)
        self.assertEqual(ours.what, "edges")
        self.compare(
            [self.path("edges.g2o"), "--plan"],
            liestat.diagnose_conventions(graph.measurements, graph.matrices, plan=True, edges=True),
        )

    def test_formats_fix_the_order(self):
        truth, poses, covariances = scene(60, 18)
        times = np.arange(60) * 0.1 + 1
        estimate = self.path("vins.txt")
        liestat.write_trajectory(
            estimate, poses, covariances, format="openvins", times=times, convention="openvins"
        )
        read = liestat.read_trajectory(estimate, "unknown")
        self.assertEqual(read.order, "rt")
        reference, truth = self.truth("gt.tum", truth, times)
        ours = liestat.diagnose_conventions(
            read.poses, read.matrices, truth, times=read.times, truth_times=times, order=read.order
        )
        self.compare([estimate, reference], ours)
        self.assertIn("the cross block is unknown: only the two blocks are tested", ours.structure)

    @unittest.skipUnless(os.environ.get("LIESTAT_DATA"), "LIESTAT_DATA is not set")
    def test_real_data(self):
        folder = os.path.join(os.environ["LIESTAT_DATA"], "evaluate")
        truth = liestat.read_trajectory(os.path.join(folder, "reference.tum"))
        estimate = liestat.read_trajectory(os.path.join(folder, "estimate.tum"))
        sigmas = np.diag([0.02, 0.02, 0.02, 0.01, 0.01, 0.01]) ** 2
        path = self.estimate(
            "est.txt", estimate.poses, np.broadcast_to(sigmas, (len(estimate.poses), 6, 6)), "ros-fixed", estimate.times
        )
        read = self.read(path)
        ours = liestat.diagnose_conventions(
            read.poses, read.matrices, truth.poses, times=read.times, truth_times=truth.times, align="se3"
        )
        reference = os.path.join(folder, "reference.tum")
        words = [path, reference, "--format", "tum", "--cov-layout", "full36", "--align", "se3"]
        self.assertRegex(truth.notes[0], "836 rotations were normalised, off by 1.7e-05")
        self.compare(words, ours, read=((reference, truth), (path, read)))

    def test_wrong_input_is_named(self):
        truth, poses, covariances = scene(20, 19)
        for message, arguments, options in (
            ("no ground truth", (poses, covariances), {}),
            ("exclude each other", (poses, covariances), {"plan": True, "no_truth": True}),
            ("alpha: expected", (poses, covariances, truth), {"alpha": 0.9}),
            ("align: expected one of", (poses, covariances, truth), {"align": "origin"}),
            ("10 true poses of 20", (poses, covariances, truth[:10]), {}),
            ("truth_times without times", (poses, covariances, truth), {"truth_times": np.arange(20.0)}),
            ("times: expected 20 ascending", (poses, covariances, truth), {"times": np.zeros(20)}),
            ("start and end: expected truth_times", (poses, covariances, truth), {"start": 1.0}),
            (
                "no pose of the truth is between",
                (poses, covariances, truth),
                {"times": np.arange(20.0), "truth_times": np.arange(20.0), "start": 30.0},
            ),
            ("several runs", ([poses, poses], [covariances] * 2), {"no_truth": True}),
        ):
            with self.assertRaisesRegex(ValueError, message):
                liestat.diagnose_conventions(*arguments, **options)
        few = liestat.diagnose_conventions(poses[:5], covariances[:5], truth[:5])
        self.assertIsNone(few.decided)
        self.assertEqual(few.sentence, "UNDECIDABLE: 5 poses with a matrix are too few, at least ten are needed")


if __name__ == "__main__":
    unittest.main()
