"""Columns by name."""

import unittest

import numpy as np
import support

import liestat


class Columns(unittest.TestCase):
    def test_round_trips(self):
        for name in support.TYPES:
            x = support.features(name, 6)
            with self.subTest(name):
                if name in ("SO2", "SE2"):
                    with self.assertRaises(TypeError):
                        liestat.columns(x)
                    continue
                table = liestat.columns(x)
                back = liestat.from_columns(type(x), {"other": ["a"] * 6, **table})
                np.testing.assert_allclose(back.params, x.params, atol=1e-15)
                structured = np.rec.fromarrays(list(table.values()), names=list(table))
                np.testing.assert_array_equal(liestat.from_columns(type(x), structured).params, back.params)
        self.assertEqual(list(liestat.columns(liestat.SE3.identity(2))), "qx qy qz qw tx ty tz".split())

    def test_refusals(self):
        table = liestat.columns(liestat.SO3.identity(3))
        with self.assertRaisesRegex(ValueError, "SE3 needs the columns qx qy qz qw tx ty tz; tx"):
            liestat.from_columns(liestat.SE3, table)
        with self.assertRaisesRegex(ValueError, r"qw, shape \(3,\): not finite at index \(1,\)"):
            liestat.from_columns(liestat.SO3, {**table, "qw": [1, np.nan, 1]})
        with self.assertRaisesRegex(ValueError, "row 2: qx qy qz qw are zero"):
            liestat.from_columns(liestat.SO3, {**table, "qw": [1, 1, 0]})
        with self.assertRaisesRegex(ValueError, "lengths differ"):
            liestat.from_columns(liestat.SO3, {**table, "qw": [1, 1]})
        with self.assertRaisesRegex(ValueError, r"expected shape \(n,\), got \(\)"):
            liestat.columns(liestat.SO3.identity())


if __name__ == "__main__":
    unittest.main()
