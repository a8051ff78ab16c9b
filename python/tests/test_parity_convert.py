"""`convert` of the program and of the module: the same figures, notes, verdict and files, and the readers and the
writer of trajectories behind them."""

import os
import re
import subprocess
import tempfile
import unittest
import warnings

import numpy as np
from parity import PROGRAM, ParityTest, program
from support import generator

import liestat
from liestat import SE3

FORMATS = ["tum", "kitti", "euroc", "csv", "openvins", "ros-json", "ros-yaml", "ros-csv", "mavlink-json", "mavlink-csv"]


def some_poses(n, scale=1e-4, distance=3.0, seed=3):
    """Poses with full covariances and times whose digits are kept."""
    rng = generator(seed)
    params = np.concatenate([rng.standard_normal((n, 4)), distance * rng.standard_normal((n, 3))], axis=1)
    params[:, :4] /= np.linalg.norm(params[:, :4], axis=1, keepdims=True)
    roots = np.sqrt(scale) * rng.standard_normal((n, 6, 6))
    covariances = roots @ np.swapaxes(roots, 1, 2) + scale * np.eye(6)
    return SE3(params), covariances, [f"17{k // 10:08}.{k % 10}5" for k in range(n)]


def with_flags(notes):
    """The library puts names of options between backquotes; the program writes them as its options."""
    return [re.sub("`(\\w+)`", lambda m: "--" + m[1].replace("_", "-"), note) for note in notes]


class ConvertParity(ParityTest):
    function = "convert_trajectory"

    def setUp(self):
        directory = tempfile.TemporaryDirectory()
        self.addCleanup(directory.cleanup)
        self.directory = directory.name

    def path(self, name):
        return os.path.join(self.directory, name)

    def text(self, name):
        with open(self.path(name), encoding="utf-8") as file:
            return file.read()

    def write(self, name, *arguments, **options):
        liestat.write_trajectory(self.path(name), *arguments, **options)
        return self.path(name)

    def refused(self, *arguments):
        """The line that the program says, without its own name."""
        run = subprocess.run([PROGRAM, "convert", *arguments], capture_output=True, text=True)
        self.assertEqual(run.returncode, 2, run.stderr)
        return run.stderr.strip()

    def compare(self, path, to_format, source, to, flags=(), codes=(0,), reading=None, **options):
        """One conversion by both: the JSON, and the files."""
        flags = [*flags, "--to", to_format, "--cov-to", to, *(["--cov-from", source] if source else [])]
        theirs = program("convert", path, self.path("theirs"), *flags, codes=codes)
        read = liestat.read_trajectory(path, source, **(reading or {}))
        target = liestat._core.convention_to_write(to_format, to)
        given = read.convention + (",layout=" + theirs["covariance_from"]["layout"])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            ours = liestat.convert_trajectory(read.poses, read.matrices, given, target, lines=read.lines, **options)
            written = liestat.write_trajectory(
                self.path("ours"),
                read.poses,
                ours.matrices,
                format=to_format,
                times=read.time_texts,
                source=target,
                convention=to,
                frames=read.frames,
            )
        self.assertEqual(ours.decided, theirs["exit_code"] == 0, ours.sentence)
        self.assertEqual([theirs.pop("from"), theirs.pop("to")], [read.format, to_format])
        self.assertEqual(theirs.pop("poses"), len(read.poses))
        files = theirs.pop("files")
        self.assertEqual(theirs.pop("notes"), read.notes + with_flags(ours.notes) + written.notes)
        self.assertEqual(ours.faults, [])
        self.assert_equal_results(theirs, ours, series=("matrices", "faults", "notes", "sentence", "decided"))
        self.assertEqual(len(files), len(written.files))
        for suffix in ("", ".cov")[: len(files)]:
            self.assertEqual(self.text("ours" + suffix), self.text("theirs" + suffix))
        return ours

    def test_every_format_and_convention(self):
        poses, covariances, times = some_poses(7)
        for i, form in enumerate(FORMATS):
            for source in ("ros-fixed", "left,order=rt", "mrpt-ypr,unit=deg"):
                if form == "openvins" and source.startswith("left"):
                    continue
                stamps = None if form == "kitti" else times
                path = self.write("given", poses, covariances, format=form, times=stamps, convention=source)
                for to_format in ("csv", FORMATS[(i + 3) % len(FORMATS)]):
                    if form == "kitti" and to_format not in ("csv", "ros-json", "ros-yaml", "kitti"):
                        continue
                    if form == "openvins" and to_format not in ("csv", "tum", "euroc", "openvins"):
                        continue
                    with self.subTest(form, source=source, to=to_format):
                        self.compare(path, to_format, source, "ros-body-ori")
                        self.assertEqual(liestat.read_trajectory(path, source).format, form)
                for name in ("given", "given.cov"):
                    if os.path.exists(self.path(name)):
                        os.remove(self.path(name))

    def test_figures_of_what_is_lost(self):
        poses, covariances, _ = some_poses(6)
        unknown = covariances.copy()
        unknown[0] = np.nan
        unknown[1, :3, 3:] = unknown[1, 3:, :3] = np.nan
        unknown[2, 2, :] = unknown[2, :, 2] = 0
        path = self.write("unknown.csv", poses, unknown, format="csv")
        ours = self.compare(path, "csv", None, "ros-fixed")
        self.assertEqual([ours.unknown, ours.partly_unknown, ours.zero_variances], [1, 1, 1])
        ours = self.compare(path, "csv", None, "left", ["--assume-uncorrelated"], assume_uncorrelated=True)
        self.assertEqual(ours.assumed_uncorrelated, 1)
        large, big, _ = some_poses(3, 0.03)
        path = self.write("large.csv", large, big, format="csv")
        self.assertEqual(self.compare(path, "csv", None, "ros-fixed").beyond_first_order, 3)
        flags = ["--sampled", "--samples", "500", "--seed", "7"]
        sampled = self.compare(path, "csv", None, "ros-fixed", flags, sampled=True, samples=500, seed=7)
        self.assertGreater(sampled.sampling_error, 0)
        # The defaults of samples and seed are the program's.
        self.compare(path, "csv", None, "ros-fixed", ["--sampled"], sampled=True)
        far, precise, _ = some_poses(2, 1e-6, 5e6)
        path = self.path("far.csv")
        with open(path, "w", encoding="utf-8") as file:
            file.write("# liestat-covariance 1\n# order: tr\n# perturbation: left\n# unit: rad\n")
            file.write("# content: covariance\n# layout: upper21\n")
            adjoint = far.Adj()
            file.write(self.csv(far, adjoint @ precise @ np.swapaxes(adjoint, 1, 2)))
        ours = self.compare(path, "csv", None, "right")
        self.assertTrue(any("2 matrices are about an origin so far away" in note for note in ours.notes), ours.notes)

    @staticmethod
    def csv(poses, covariances):
        names = "tx,ty,tz,qx,qy,qz,qw," + ",".join(f"cov_{i}{j}" for i in range(6) for j in range(i, 6))
        order = [4, 5, 6, 0, 1, 2, 3]
        upper = np.triu_indices(6)
        rows = [",".join(repr(float(x)) for x in [*p[order], *c[upper]]) for p, c in zip(poses.params, covariances)]
        return "\n".join([names, *rows]) + "\n"

    def test_verdict_is_the_exit_code(self):
        poses, covariances, _ = some_poses(4)
        covariances[2, 0, 1] = covariances[2, 1, 0] = 1
        path = self.path("indefinite.csv")
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.csv(poses, covariances))
        ours = self.compare(path, "csv", None, "left", codes=(3,))
        self.assertEqual(ours.indefinite, 1)
        self.assertEqual(ours.sentence, "not trusted: 1 of 4 matrices are indefinite")
        with self.assertWarnsRegex(UserWarning, "not trusted"):
            liestat.convert_trajectory(poses, covariances, "right", "left")

    def test_faults_have_the_programs_message(self):
        poses, covariances, _ = some_poses(3)
        far = SE3(poses.params + np.array([0, 0, 0, 0, 5e6, 0, 0]) * np.array([[0], [1], [0]]))
        cross = covariances.copy()
        cross[1, :3, 3:] = cross[1, 3:, :3] = np.nan
        for name, x, c, to in (
            ("far_origin", far, covariances, "left"),
            ("unknown_cross", poses, cross, "g2o-full"),
            ("undefined_angles", poses, 100 * covariances / covariances.max(), "ros-rpy"),
        ):
            path = self.path("given.csv")
            with open(path, "w", encoding="utf-8") as file:
                file.write(self.csv(x, c))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                ours = liestat.convert_trajectory(x, c, "right", to)
            fault = ours.faults[0]
            self.assertEqual(fault.fault, name)
            self.assertIs(ours.decided, False)
            said = self.refused(path, self.path("never.csv"), "--to", "csv", "--cov-to", to)
            expected = f", expected {with_flags([fault.expected])[0]}" if fault.expected else ""
            self.assertTrue(said.endswith(f"given.csv:{fault.row + 2}: {fault.found}{expected}"), said)
            with self.assertRaisesRegex(ValueError, re.escape(fault.found)):
                self.write("never.csv", x, c, format="csv", convention=to)
            self.assertFalse(os.path.exists(self.path("never.csv")))

    def test_reading_in_a_convention(self):
        poses, covariances, times = some_poses(4)
        path = self.write("m.json", poses, covariances, format="ros-json", times=times, convention="ros-fixed")
        with self.assertRaisesRegex(ValueError, "the format ros-json does not say what its covariances mean"):
            liestat.read_trajectory(path)
        raw = liestat.read_trajectory(path, "unknown")
        self.assertIsNone(raw.covariances)
        read = liestat.read_trajectory(path, "ros-fixed")
        np.testing.assert_allclose(read.covariances, covariances, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(read.matrices, raw.matrices)
        self.assertEqual(read.time_texts[1].rstrip("0"), times[1].rstrip("0"))
        path = self.write("a.tum", poses, covariances, format="tum", times=times, convention="left")
        read = liestat.read_trajectory(path)
        self.assertEqual([read.convention, read.stated_convention, read.format], ["left", "left", "tum"])
        np.testing.assert_allclose(read.covariances, covariances, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(read.poses.params, poses.params)
        with self.assertRaisesRegex(ValueError, "its covariances are 'left', and convention says 'right'"):
            liestat.read_trajectory(path, "right")

    def test_pose_graphs(self):
        edge = "EDGE_SE3:QUAT 0 7 1 2 3 0 0.6 0 0.8 10 1 0 0.5 0 0 20 2 0 0.25 0 30 0 0 1 400 5 0 500 7 600\n"
        path = self.path("a.g2o")
        with open(path, "w", encoding="utf-8") as file:
            file.write("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 7 1 2 3 0 0.6 0 0.8\n" + edge)
        graph = liestat.read_pose_graph(path)
        self.assertEqual([list(graph.ids), list(graph.sources), list(graph.targets)], [[0, 7], [0], [7]])
        theirs = program("convert", path, self.path("a.toro"), "--to", "toro", "--cov-from", "g2o-half")
        ours = liestat.convert_trajectory(
            graph.measurements, graph.matrices, "g2o-half", "toro", lines=graph.lines
        )
        for name in ("from", "to", "poses", "files"):
            theirs.pop(name)
        self.assertEqual(theirs.pop("notes"), with_flags(ours.notes))
        self.assert_equal_results(theirs, ours, series=("matrices", "faults", "notes", "sentence", "decided"))
        np.testing.assert_allclose(
            liestat.read_pose_graph(self.path("a.toro")).matrices, ours.matrices, rtol=1e-13, atol=1e-13
        )

    def test_wrong_input_is_named(self):
        poses, covariances, _ = some_poses(3)
        with self.assertRaisesRegex(ValueError, "there is no convention 'rgiht'"):
            liestat.convert_trajectory(poses, covariances, "rgiht", "left")
        with self.assertRaisesRegex(ValueError, r"expected shape \(3, 6, 6\), got \(2, 6, 6\)"):
            liestat.convert_trajectory(poses, covariances[:2], "right", "left")
        with self.assertRaisesRegex(TypeError, "poses: expected SE3"):
            liestat.convert_trajectory(covariances, covariances, "right", "left")
        with self.assertRaisesRegex(ValueError, "the file has no times"):
            self.write("never.tum", poses, format="tum")
        with self.assertRaisesRegex(ValueError, "format: expected one of"):
            liestat.read_trajectory("x", format="bagpipe")
        path = self.path("bad.tum")
        with open(path, "w", encoding="utf-8") as file:
            file.write("1 2 3 4 0 0 0 1\n2 1 2 3 0 0 0 2\n")
        with self.assertRaisesRegex(ValueError, "bad.tum:2: the norm of the quaternion is 2, expected 1 within 0.001"):
            liestat.read_trajectory(path)


if __name__ == "__main__":
    unittest.main()
