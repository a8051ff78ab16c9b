"""The package: examples, docstrings, stubs, the time of its import."""

import doctest
import inspect
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import liestat
from liestat import _manifolds, _statistics

CONFIGURATION = Path(__file__).resolve().parent / "stubtest.ini"
EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


class Examples(unittest.TestCase):
    def test_they_run(self):
        self.assertGreaterEqual(len(EXAMPLES), 5)
        with tempfile.TemporaryDirectory() as directory:
            for path in EXAMPLES:
                with self.subTest(path.name):
                    run = subprocess.run([sys.executable, path], cwd=directory, capture_output=True, text=True)
                    self.assertEqual(run.returncode, 0, run.stderr)
                    self.assertTrue(run.stdout.strip())


class Documentation(unittest.TestCase):
    def test_everything_public_has_a_docstring(self):
        for name, value in vars(liestat).items():
            if name.startswith("_") or inspect.ismodule(value) or not callable(value):
                continue
            with self.subTest(name):
                self.assertTrue(inspect.getdoc(value))
            if inspect.isclass(value):
                for member, function in inspect.getmembers(value):
                    if not member.startswith("_") and callable(function):
                        self.assertTrue(inspect.getdoc(function), f"{name}.{member}")

    def test_examples_in_docstrings(self):
        for module in (_manifolds, _statistics):
            result = doctest.testmod(module)
            self.assertGreater(result.attempted, 0)
            self.assertEqual(result.failed, 0)


@unittest.skipUnless(shutil.which("mypy"), "mypy is not there")
class Types(unittest.TestCase):
    """Debian's mypy runs with the system's Python, for which the package is built."""

    def environment(self):
        package = Path(liestat.__file__).resolve().parents[1]
        return {**os.environ, "MYPYPATH": str(package), "MYPY_CACHE_DIR": tempfile.gettempdir() + "/liestat-mypy"}

    def test_examples_are_strictly_typed(self):
        run = subprocess.run(
            ["mypy", "--strict", *map(str, EXAMPLES)], env=self.environment(), capture_output=True, text=True
        )
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)

    @unittest.skipUnless(shutil.which("stubtest"), "stubtest is not there")
    def test_stubs_agree_with_the_module(self):
        run = subprocess.run(
            ["stubtest", "liestat", "--ignore-missing-stub", "--mypy-config-file", str(CONFIGURATION)],
            env=self.environment(),
            capture_output=True,
            text=True,
        )
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)


class Import(unittest.TestCase):
    def test_time(self):
        """At most 0.05 s beyond NumPy's; the least of several, for the machine does other things."""
        code = "import time, numpy; t = time.perf_counter(); import liestat; print(time.perf_counter() - t)"
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}

        def seconds():
            run = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True)
            return float(run.stdout)

        seconds()  # compiles the package, as an installation does
        times = [seconds() for _ in range(5)]
        self.assertLess(min(times), 0.05, times)

    def test_scipy_is_not_imported(self):
        code = "import liestat, sys; print('scipy' in sys.modules)"
        run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        self.assertEqual(run.stdout.strip(), "False")


if __name__ == "__main__":
    unittest.main()
