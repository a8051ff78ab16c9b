"""The program's JSON and a result of the module, field by field. Both show what the library describes, so that they have
the same fields and the same values, to the last bit."""

import ast
import json
import math
import os
import subprocess
import tempfile
import unittest

import numpy as np

import liestat

PROGRAM = os.environ.get("LIESTAT_PROGRAM", "")
# Fields that belong to a run of the program.
ENVELOPE = {"schema_version", "program", "version", "command_line", "file", "seed"}


def program(*arguments, codes=(0,)):
    """The JSON of a run of the program that ends with one of these exit codes; `exit_code` is its own."""
    with tempfile.TemporaryDirectory() as directory:
        path = os.path.join(directory, "result.json")
        run = subprocess.run([PROGRAM, *map(str, arguments), "--json", path], capture_output=True, text=True)
        if run.returncode not in codes:
            raise AssertionError(f"exit code {run.returncode}, expected one of {codes}: {run.stderr}")
        with open(path, encoding="utf-8") as file:
            result = json.load(file)
    result["exit_code"] = run.returncode
    return result


def simulate(what, *arguments):
    """Runs `liestat simulate what`."""
    subprocess.run([PROGRAM, "simulate", what, *map(str, arguments)], check=True, capture_output=True)


def truth_of(path, start_ns):
    """EuRoC's ground truth as the module takes it: times, states, biases."""
    with open(path, encoding="utf-8") as file:
        rows = [line.split(",") for line in file if not line.startswith("#")]
    times = np.array([int(row[0]) - start_ns for row in rows]) * 1e-9
    n = np.array([[float(cell) for cell in row[1:]] for row in rows])
    # Quaternions are normalised as the program does it, to the bit.
    states = liestat.SE23._normalized(n[:, [4, 5, 6, 3, 0, 1, 2, 7, 8, 9]], "truth")
    return times, states, n[:, 10:16]


def plain(value):
    """A value of the module as JSON would have it."""
    if isinstance(value, liestat.Result):
        return {name: plain(value[name]) for name in value.keys()}
    if isinstance(value, dict):
        return {name: plain(v) for name, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def declarations():
    """What `__init__.pyi` declares: the attributes of each class with their annotations, and what functions return."""
    with open(os.path.join(os.path.dirname(liestat.__file__), "__init__.pyi"), encoding="utf-8") as file:
        nodes = ast.parse(file.read()).body
    found = {node.name: node for node in nodes if isinstance(node, ast.ClassDef)}

    def attributes(name):
        own = [line for line in found[name].body if isinstance(line, ast.AnnAssign)]
        bases = [ast.unparse(base) for base in found[name].bases]
        inherited = {k: v for base in bases if base in found for k, v in attributes(base).items()}
        return inherited | {line.target.id: ast.unparse(line.annotation) for line in own}

    functions = [node for node in nodes if isinstance(node, ast.FunctionDef) and node.returns]
    return {name: attributes(name) for name in found}, {node.name: ast.unparse(node.returns) for node in functions}


def undeclared(result, function):
    """Attributes of the result of a function that `__init__.pyi` does not declare, those of results inside too."""
    classes, returned = declarations()

    def missing(value, annotation, path):
        name = annotation.replace(" | None", "").removeprefix("list[").removesuffix("]")
        if isinstance(value, list):
            return [m for element in value[:1] for m in missing(element, annotation, path)]
        if not isinstance(value, liestat.Result) or not classes.get(name):
            return []
        declared = classes[name]
        found = [f"{path}.{key}" for key in value.keys() if key not in declared]
        return found + [m for key in value.keys() if key in declared for m in missing(value[key], declared[key], key)]

    return missing(result, returned[function], function)


@unittest.skipUnless(PROGRAM, "LIESTAT_PROGRAM is not set: ./run python sets it")
class ParityTest(unittest.TestCase):
    """`assert_equal_results(json, result, series)`: the fields are equal in name and value. `series` are names of fields
    that only the module has: one row for each pose, frame or window, which the program writes to its report."""

    maxDiff = None
    #: Function of the module whose results have the attributes that are declared.
    function = None

    def assert_equal_results(self, program_json, result, series=(), path=""):
        ours, theirs = plain(result), dict(program_json)
        if self.function and isinstance(result, liestat.Result):
            self.assertEqual(undeclared(result, self.function), [])
        for name in ENVELOPE | {"exit_code"}:
            theirs.pop(name, None)
        for name in series:
            self.assertIn(name, ours, f"{path}: the series {name}")
            ours.pop(name)
        self._compare(theirs, ours, path)

    def _compare(self, theirs, ours, path):
        if isinstance(theirs, dict):
            self.assertIsInstance(ours, dict, path)
            self.assertEqual(sorted(theirs), sorted(ours), f"fields of {path or 'the result'}")
            for name, value in theirs.items():
                self._compare(value, ours[name], f"{path}.{name}")
        elif isinstance(theirs, list):
            self.assertIsInstance(ours, list, path)
            self.assertEqual(len(theirs), len(ours), path)
            for i, value in enumerate(theirs):
                self._compare(value, ours[i], f"{path}[{i}]")
        else:
            self.assertEqual(theirs, ours, path)
