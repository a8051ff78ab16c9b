"""States that merge."""

import pathlib
import pickle
import tempfile
import unittest

import numpy as np
import support

import liestat
from liestat import S2, SO2, SO3, State

STATES = pathlib.Path(__file__).resolve().parents[2] / "tests/data/states"


def passes(feature, parts):
    """The states of all passes over parts."""
    state = None
    while True:
        state = sum(State(feature, state).add(part) for part in parts)
        yield state
        if state.kind == "sums" and not state.result()["another_pass"]:
            return


class States(unittest.TestCase):
    def test_bytes_of_the_library(self):
        """Every engine makes these bytes of these rows, in any order and partition."""
        n = np.arange(2000)
        headings = (n * 29 % 1440) / 16 - 20
        quaternions = np.array([[0.6, 0, 0, 0.8], [0.28, 0, 0, 0.96], [0, 0, 0.28, 0.96], [0.352, 0, 0, 0.936]])[n % 4]
        for feature, rows in (("heading", headings), ("rotation", quaternions)):
            golden = (STATES / f"engine_{feature}s.state").read_bytes()
            rng = np.random.default_rng(1)
            for parts in (1, 7, 64):
                shuffled = np.array_split(rng.permutation(rows), parts)
                states = [pickle.loads(pickle.dumps(State(feature).add(part))) for part in shuffled]
                self.assertEqual(bytes(sum(states)), golden)
            # A column of a larger array, backwards.
            wide = np.zeros((2000, 9))
            if feature == "rotation":
                wide[:, 3:7] = rows
                self.assertEqual(bytes(State(feature).add(wide[::-1, 3:7])), golden)
            self.assertEqual(State.from_bytes(golden), State(feature).add(rows))

    def test_headings_are_so2(self):
        degrees = np.array([350.0, 355, 5, 10, 30])
        x = SO2.from_angle(degrees, degrees=True)
        self.assertEqual(bytes(State("heading").add(x)), bytes(State("heading").add(degrees)))
        np.testing.assert_allclose(x.as_angle(degrees=True), degrees, atol=1e-13)
        np.testing.assert_allclose(SO2.from_angle(np.deg2rad(degrees)).params, x.params, atol=1e-15)
        np.testing.assert_array_equal(SO2.from_angle([90, -180.0], degrees=True).params, [[0, 1], [-1, 0]])
        self.assertEqual(SO2.from_angle(-1e-300).as_angle(), 0)
        mean = liestat.mean(x)
        self.assertAlmostEqual(mean.mean.as_angle(degrees=True), 6, places=12)
        self.assertEqual((mean.status, mean.unique, mean.covariance.shape), ("ok", "unique", (1, 1)))
        # Opposite headings have two means.
        self.assertNotEqual(liestat.mean(SO2.from_angle([0, 180.0], degrees=True)).status, "ok")
        with self.assertRaisesRegex(ValueError, "SO2 for a state of rotations"):
            State("rotation").add(x)
        with self.assertRaises(ValueError):
            SO2.from_angle([1.0, np.nan])
        with tempfile.TemporaryDirectory() as directory:
            path = pathlib.Path(directory) / "wind.csv"
            path.write_text("heading_deg\n" + "\n".join(map(str, degrees)))
            read = liestat.read_features(path).features
            self.assertIsInstance(read, SO2)
            np.testing.assert_array_equal(read.params, x.params)

    def test_passes_give_the_mean(self):
        x = support.features("SO3", 300)
        known = liestat.mean(x)
        states = list(passes("rotation", np.array_split(x.as_quat(), 5)))
        result = states[-1].result()
        self.assertEqual((result["status"], known.status), ("ok", "ok"))
        self.assertLess(np.linalg.norm(known.mean.local(SO3(result["mean"]))), 1e-12)
        np.testing.assert_allclose(result["covariance"], known.covariance, rtol=1e-9, atol=1e-14)
        self.assertEqual([s.passes for s in states], list(range(1, len(states) + 1)))
        chordal = states[0].result()
        self.assertEqual(chordal["status"], "ok")
        self.assertLess(np.linalg.norm(known.mean.local(SO3(chordal["mean"]))), 0.1)
        weights = np.linspace(0.5, 4, 300)
        first = State("rotation", largest_weight=4).add(x, weights)
        second = State("rotation", first).add(x, weights)
        third = State("rotation", second).add(x, weights)
        self.assertLess(np.linalg.norm(liestat.mean(x, weights).mean.local(SO3(third.result()["mean"]))), 1e-12)

    def test_headings(self):
        self.assertEqual(State("heading").add([350, 10]).result()["degrees"] % 360, 0)
        cancelled = State("heading").add([10, 100, 190, 280]).result()
        self.assertEqual(cancelled["status"], "ill_defined")
        self.assertTrue(np.isnan(cancelled["degrees"]))
        empty = State("heading").result()
        self.assertEqual((empty["status"], empty["n"], empty["covariance"]), ("too_few", 0, None))

    def test_bad_input(self):
        state = State("direction").add([[0, 0, 1], [np.nan, 0, 1], [0, 0, 2]])
        self.assertEqual((state.n, state.left_out), (1, 2))
        before = bytes(state)
        for error, call in (
            ("expected 'heading'", lambda: State("point")),
            ("expected shape", lambda: state.add([[1, 2]])),
            ("a weight is", lambda: state.add([[0, 0, 1]], [2.0])),
            ("SO3 for a state of directions", lambda: state.add(SO3.identity())),
            ("do not merge", lambda: state + State("heading")),
            ("not the bytes", lambda: State.from_bytes(b"liestat")),
            ("newer version", lambda: State.from_bytes(before[:7] + b"\2" + before[8:])),
            ("damaged", lambda: State.from_bytes(before[:16] + b"\5" + before[17:])),
            ("no mean", lambda: State("direction", State("direction"))),
            ("expected a State", lambda: State("direction", State("heading"))),
        ):
            with self.subTest(error), self.assertRaisesRegex(ValueError, error):
                call()
        self.assertEqual(bytes(state), before)
        self.assertEqual(State("direction").add(S2([0, 0, 1])), State("direction").add([0, 0, 1]))


if __name__ == "__main__":
    unittest.main()
