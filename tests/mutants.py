#!/usr/bin/env python3
"""The steps of tests/mutants.sh: plants the faults of mutants.txt, builds once, runs, and says what found them."""

import argparse
import contextlib
import csv
import hashlib
import json
import os
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


class Mutant:
    """One line of the list: in `file`, what stands between the marks of `original` becomes `mutated`."""

    def __init__(self, file, line, number):
        kind, _, rest = line.partition(": ")
        original, arrow, mutated = rest.rpartition(" =>")
        if not arrow or original.count("«") != 1 or original.count("»") != 1:
            raise ValueError(f"tests/mutants.txt:{number}: expected kind: text with one «part» => other part")
        self.file, self.kind, self.number, self.mutated = file, kind, number, mutated.strip()
        self.before, self.part, self.after = re.split("[«»]", original)
        self.text = f"{original.strip()} => {self.mutated}"
        # Independent of the neighbours, so that a new entry rebuilds only what includes its file. 0 and 1 are taken.
        self.id = hashlib.sha1(f"{file}\n{self.text}".encode()).hexdigest()[:8]
        self.name = f"{self.file} [{self.kind}] {self.text}"

    def switched(self, part):
        on = f"::liestat_mutants::on<0x{self.id}u>()"
        if self.part.strip().endswith((";", "}")):
            return f"if ({on}) {{ {self.mutated} }} else {{ {part} }}"
        plain = "::liestat_mutants::plain"
        return f"({on} ? {plain}({self.mutated}) : {plain}({part}))"


def squeezed(text):
    """The text without blanks, and where each of its characters stood."""
    places = [i for i, c in enumerate(text) if not c.isspace()]
    return "".join(text[i] for i in places), places


def find(mutant, source, places):
    """Begin and end of the marked part in a source that is given squeezed."""
    before, part, after = (squeezed(x)[0] for x in (mutant.before, mutant.part, mutant.after))
    whole, hits, at = before + part + after, [], -1
    while (at := source.find(whole, at + 1)) >= 0:
        hits.append(at + len(before))
    if len(hits) != 1:
        raise ValueError(f"tests/mutants.txt:{mutant.number}: {mutant.file} has it {len(hits)} times: {mutant.text}")
    return places[hits[0]], places[hits[0] + len(part) - 1] + 1


def read_list():
    mutants, file = [], None
    for number, line in enumerate((ROOT / "tests/mutants.txt").read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        if line.startswith("["):
            file = line[1:-1]
        else:
            mutants.append(Mutant(file, line, number))
    return mutants


def planted(file, mutants):
    """The source of a file with the switches of its mutants. Parts may lie within one another."""
    text = (ROOT / file).read_text()
    source, places = squeezed(text)
    edits = []
    for m in mutants:
        begin, end = find(m, source, places)
        edits.append((begin, end, m))

    def rewritten(begin, end, inside):
        result, at = "", begin
        inside = sorted(inside, key=lambda e: (e[0], -e[1]))
        while inside:
            b, e, m = inside.pop(0)
            if e > end or b < at:
                raise ValueError(f"tests/mutants.txt:{m.number}: overlaps another entry: {m.text}")
            within = [x for x in inside if x[0] < e]
            inside = inside[len(within):]
            result += text[at:b] + m.switched(rewritten(b, e, within))
            at = e
        return result + text[at:end]

    return "#include <liestat_mutants.hpp>\n" + rewritten(0, len(text), edits)


def write_if_changed(path, data):
    if path.exists() and path.read_bytes() == data:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


def make_tree(tree, mutants):
    """A copy of the sources with the faults in it. What has not changed keeps its time, and is not built again."""
    by_file = defaultdict(list)
    for m in mutants:
        by_file[m.file].append(m)
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True,
                            capture_output=True, text=True).stdout.split("\n")
    files = {f for f in listed if f and (ROOT / f).is_file()}
    wrong = []
    for file in sorted(files):
        try:
            data = planted(file, by_file[file]).encode() if file in by_file else (ROOT / file).read_bytes()
        except ValueError as e:
            wrong.append(str(e))
            continue
        write_if_changed(tree / file, data)
        shutil.copymode(ROOT / file, tree / file)
    wrong += [f"there is no {f}, which tests/mutants.txt names" for f in sorted(set(by_file) - files)]
    if wrong:
        sys.exit("\n".join(wrong))
    write_if_changed(tree / "liestat_mutants.hpp", (ROOT / "tests/mutants.hpp").read_bytes())
    for path in tree.rglob("*"):
        name = path.relative_to(tree).as_posix()
        if path.is_file() and name not in files and name != "liestat_mutants.hpp":
            path.unlink()


def configure(args, tree, build):
    compiler = args.compiler or shutil.which("clang++") or "c++"
    timer = [sys.executable, str(ROOT / "tests/mutants.py"), "--timed", str(build.parent / "compiled.tsv")]
    own = os.environ.get("CMAKE_CXX_COMPILER_LAUNCHER", "")
    launcher = ";".join(timer + ([own] if own else []))
    subprocess.run(["cmake", "-S", tree, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release",
                    f"-DCMAKE_CXX_COMPILER={compiler}", f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
                    f"-DCMAKE_CXX_LINKER_LAUNCHER={';'.join(timer)}", "-DLIESTAT_THOROUGH_TESTS=ON",
                    "-DLIESTAT_WERROR=OFF", "-DLIESTAT_BUILD_BENCHMARKS=OFF", "-DLIESTAT_BUILD_EXAMPLES=ON"],
                   check=True, stdout=subprocess.DEVNULL)


def programs_of(build, pattern):
    """The test programs that ninja can build, by the targets' names."""
    out = subprocess.run(["ninja", "-C", build, "-t", "targets", "all"], check=True, capture_output=True,
                         text=True).stdout
    names = re.findall(r"^((?:tests/bin|examples)/\w+): CXX_EXECUTABLE_LINKER", out, re.M)
    return [n for n in names if pattern.search(os.path.basename(n))]


def check_syntax(args, build):
    """Compiles the units without code: whether all faults of what they instantiate are C++."""
    pattern, failed = re.compile(args.syntax), 0
    for unit in json.loads((build / "compile_commands.json").read_text()):
        if not pattern.search(unit["file"]):
            continue
        command = re.sub(r"-Xclang -include-pch -Xclang \S+|-o \S+| -c |^.* --timed \S+ ", " ", unit["command"])
        start = time.time()
        code = subprocess.run(shlex.split(command) + ["-fsyntax-only", "-w"], cwd=unit["directory"]).returncode
        failed += code != 0
        print(f"{time.time() - start:6.1f} s  {'ok' if code == 0 else 'FAILED'}  {unit['file']}", flush=True)
    return 1 if failed else 0


class Test:
    """A test of ctest: its command, and the built program that it runs."""

    def __init__(self, entry, build, hashes):
        self.name, self.command = entry["name"], entry["command"]
        properties = {p["name"]: p["value"] for p in entry.get("properties", [])}
        self.directory = properties.get("WORKING_DIRECTORY", str(build))
        self.labels = properties.get("LABELS", [])
        self.environment = dict(x.split("=", 1) for x in properties.get("ENVIRONMENT", []))
        self.timeout = float(properties.get("TIMEOUT", 1500))
        places = {str(build / "tests/bin"), str(build / "examples")}
        self.path = next((a for a in self.command if os.path.dirname(a) in places and os.path.exists(a)), None)
        self.program = os.path.basename(self.path) if self.path else None
        if self.path:
            self.stamp = hashes(self.path)

    def run(self, environment, timeout):
        """The verdict, seconds of a processor, seconds of the clock."""
        start, expired = time.time(), threading.Event()
        with tempfile.TemporaryFile() as output:
            process = subprocess.Popen(self.command, cwd=self.directory, stdin=subprocess.DEVNULL, stdout=output,
                                       stderr=subprocess.STDOUT, start_new_session=True,
                                       env={**os.environ, **self.environment, "GTEST_FAIL_FAST": "1", **environment})

            def kill():
                expired.set()
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)

            timer = threading.Timer(timeout, kill)
            timer.start()
            _, status, usage = os.wait4(process.pid, 0)
            timer.cancel()
            process.returncode = os.waitstatus_to_exitcode(status)
            output.seek(0)
            empty = b"Running 0 tests" in output.read()
        verdict = ("timeout" if expired.is_set() else "crashed" if process.returncode < 0 else
                   "failed" if process.returncode > 0 else "empty" if empty else "passed")
        return verdict, round(usage.ru_utime + usage.ru_stime, 3), round(time.time() - start, 3)


def program_hashes(build):
    """What a test's result depends on: its program, and the program liestat if it runs that."""
    cache = {}

    def of(path):
        if path not in cache:
            data = Path(path).read_bytes()
            digest = hashlib.sha1(data)
            liestat = build / "liestat"
            if str(liestat).encode() in data and liestat.exists():
                digest.update(liestat.read_bytes())
            cache[path] = digest.hexdigest()[:12]
        return cache[path]

    return of


def load_tests(build, pattern):
    out = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], check=True, capture_output=True,
                         text=True).stdout
    hashes = program_hashes(build)
    tests = [Test(e, build, hashes) for e in json.loads(out)["tests"] if "command" in e]
    return [t for t in tests if t.program and pattern.search(t.program)]


class Log:
    """Lines of JSON, one for each run. Those of a former build do not count."""

    def __init__(self, path):
        self.path, self.lock, self.lines = path, threading.Lock(), []
        if path.exists():
            for line in path.read_text().splitlines():
                try:
                    self.lines.append(json.loads(line))
                except json.JSONDecodeError:  # the line at which a run was killed
                    pass

    def add(self, **fields):
        with self.lock:
            self.lines.append(fields)
            with open(self.path, "a") as file:
                file.write(json.dumps(fields) + "\n")


def run_all(args, out, tests, mutants):
    log = Log(out / "results.jsonl")
    known = {(r["test"], r["stamp"], r["mutant"]): r for r in log.lines}
    ids = {m.id for m in mutants}

    def baseline(test):
        if (test.name, test.stamp, "") in known:
            return
        directory = out / "reached" / re.sub(r"\W", "_", test.name)
        shutil.rmtree(directory, ignore_errors=True)
        directory.mkdir(parents=True)
        verdict, seconds, clock = test.run({"LIESTAT_MUTANTS_REACHED": str(directory)}, test.timeout)
        reached = sorted({i for f in directory.iterdir() for i in f.read_text().split()})
        if verdict == "passed":
            verdict, seconds, clock = test.run({"LIESTAT_MUTANT": "0"}, test.timeout)
        log.add(test=test.name, stamp=test.stamp, mutant="", verdict=verdict, seconds=seconds, clock=clock,
                reached=reached)
        print(f"{seconds:8.2f} s  {verdict:8} reaches {len(reached):4}  {test.name}", flush=True)

    with ThreadPoolExecutor(args.jobs) as pool:
        list(pool.map(baseline, tests))
    known = {(r["test"], r["stamp"], r["mutant"]): r for r in log.lines}
    normal = {t.name: known[t.name, t.stamp, ""] for t in tests}

    pattern = re.compile(args.only)
    wanted = {m.id: m for m in mutants if pattern.search(m.name)}
    found = {r["mutant"] for r in log.lines if r["verdict"] in ("failed", "crashed", "timeout")}
    work = []
    for test in sorted(tests, key=lambda t: normal[t.name]["seconds"]):
        if normal[test.name]["verdict"] != "passed":
            continue
        for i in normal[test.name]["reached"]:
            if i in wanted and (test.name, test.stamp, i) not in known:
                work.append((test, i))
    total, done = len(work), 0

    def one(item):
        nonlocal done
        test, i = item
        done += 1
        if args.first and i in found:
            return
        verdict, seconds, clock = test.run({"LIESTAT_MUTANT": i}, 5 * normal[test.name]["clock"] + 10)
        if verdict != "passed":
            found.add(i)
        log.add(test=test.name, stamp=test.stamp, mutant=i, verdict=verdict, seconds=seconds, clock=clock)
        print(f"{done}/{total} {verdict:8} {test.name}: {wanted[i].name[:90]}", flush=True)

    with ThreadPoolExecutor(args.jobs) as pool:
        list(pool.map(one, work))
    stamps = {t.name: t.stamp for t in tests}
    return [r for r in log.lines if stamps.get(r["test"]) == r["stamp"] and (not r["mutant"] or r["mutant"] in ids)]


def timed(record, command):
    """What the compiler and the linker are called through: notes the seconds of a processor of each output."""
    code = subprocess.run(command).returncode
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    with open(record, "a") as file:
        output = command[command.index("-o") + 1] if "-o" in command else ""
        file.write(f"{usage.ru_utime + usage.ru_stime:.2f}\t{output}\n")
    return code


def compile_seconds(record):
    """Seconds for each program's own units and its link. A cache may have answered later, so that the most counts."""
    most, seconds = {}, defaultdict(float)
    for line in record.read_text().splitlines() if record.exists() else []:
        s, output = line.split("\t")
        most[output] = max(most.get(output, 0), float(s))
    for output, s in most.items():
        match = re.search(r"CMakeFiles/(\w+)\.dir/", output) or re.fullmatch(r"(?:tests/bin|examples)/(\w+)", output)
        if match:
            seconds[match[1]] += s
    return seconds


def cheapest(cost, finds):
    """Programs that together find everything, by greedy choice and without those that later ones made superfluous."""
    left, chosen = set().union(*finds.values()) if finds else set(), []
    while left:
        best = max(finds, key=lambda p: (len(finds[p] & left) / max(cost[p], 0.01), p))
        chosen.append(best)
        left -= finds[best]
    for p in sorted(chosen, key=lambda p: -cost[p]):
        others = set().union(*(finds[q] for q in chosen if q != p)) if len(chosen) > 1 else set()
        if finds[p] <= others:
            chosen.remove(p)
    return chosen


def report(args, out, tests, mutants, results):
    by_id = {m.id: m for m in mutants}
    label = {t.program: "--all" if "thorough" in t.labels else "test" for t in tests}
    program = {t.name: t.program for t in tests}
    compiled = compile_seconds(out / "compiled.tsv")
    ran, finds, reaches, broken = defaultdict(float), defaultdict(set), defaultdict(set), []
    ran_mutants = set()
    for r in results:
        p = program[r["test"]]
        if not r["mutant"]:
            ran[p] += r["seconds"]
            reaches[p] |= set(r["reached"]) & set(by_id)
            if r["verdict"] != "passed":
                broken.append(r["test"])
        else:
            ran_mutants.add(r["mutant"])
            if r["verdict"] in ("failed", "crashed", "timeout"):
                finds[p].add(r["mutant"])
    cost = {p: compiled[p] + ran[p] for p in ran}
    with open(out / "matrix.csv", "w", newline="") as file:
        writer = csv.writer(file)
        columns = sorted({r["test"] for r in results})
        verdicts = {(r["test"], r["mutant"]): r["verdict"] for r in results if r["mutant"]}
        writer.writerow(["id", "file", "kind", "mutant", *columns])
        for m in mutants:
            writer.writerow([m.id, m.file, m.kind, m.text, *(verdicts.get((c, m.id), "") for c in columns)])

    everything = set().union(*finds.values()) if finds else set()
    reached = set().union(*reaches.values()) if reaches else set()
    chosen = cheapest(cost, {p: f for p, f in finds.items() if f})
    alone = {p: {i for i in f if not any(i in g for q, g in finds.items() if q != p)} for p, f in finds.items()}
    pairs = sum(len(set(r["reached"]) & set(by_id)) for r in results if not r["mutant"] and r["verdict"] == "passed")
    done = len({(r["test"], r["mutant"]) for r in results if r["mutant"]})
    lines = [f"{len(mutants)} faults, {len(ran)} test programs: {len(reached)} reached, {len(ran_mutants)} tried, "
             f"{len(everything)} found. {done} of {pairs} pairs of a fault and a test that reaches it have run.", ""]
    lines += ["| room | faults | reached | found |", "| --- | --- | --- | --- |"]
    for room in sorted({m.file.split("/")[0] for m in mutants}):
        own = {m.id for m in mutants if m.file.startswith(room + "/")}
        lines.append(f"| {room}/ | {len(own)} | {len(own & reached)} | {len(own & everything)} |")
    if done == pairs:  # else the choice would depend on what happened to run
        lines += ["", f"The cheapest programs that find all of them: {sum(cost[p] for p in chosen):.0f} s of "
                  f"{sum(cost.values()):.0f} s.", "",
                  "| program | now in | compiler, s | run, s | finds | alone | keep |",
                  "| --- | --- | --- | --- | --- | --- | --- |"]
        for p in sorted(cost, key=lambda p: (p not in chosen, -len(alone.get(p, ())), -len(finds[p]), cost[p])):
            lines.append(f"| {p} | {label[p]} | {compiled[p]:.0f} | {ran[p]:.1f} | {len(finds[p])} | "
                         f"{len(alone.get(p, ()))} | {'yes' if p in chosen else ''} |")
        lacking = everything - set().union(*(finds[p] for p in finds if label[p] == "test"), set())
        lines += ["", f"Found by what only --all runs: {len(lacking)}.",
                  *(f"- `{by_id[i].name}`" for i in sorted(lacking, key=lambda i: by_id[i].number))]
    missed = sorted((ran_mutants & reached) - everything, key=lambda i: by_id[i].number)
    lines += ["", f"Reached, and found by nothing: {len(missed)}. Each is a missing test.",
              *(f"- `{by_id[i].name}`" for i in missed)]
    rest = [m for m in mutants if m.id not in reached]
    lines += ["", f"Reached by nothing that ran: {len(rest)}.", *(f"- `{m.name}`" for m in rest)]
    if broken:
        lines += ["", "Left out, since they fail without any fault: " + ", ".join(sorted(broken)) + "."]
    (out / "report.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 1 if broken else 0


def main():
    parser = argparse.ArgumentParser(prog="tests/mutants.sh", description=__doc__)
    parser.add_argument("--only", default="", metavar="REGEX", help="faults whose file, kind or text match")
    parser.add_argument("--tests", default="", metavar="REGEX", help="test programs to build and run (lie/)")
    parser.add_argument("--jobs", type=int, default=1, help="compilers and tests at a time (1)")
    parser.add_argument("--first", action="store_true",
                        help="leave a fault as soon as a test has found it: what nothing finds, in a part of the time")
    parser.add_argument("--compiler", help="clang++ if there is one")
    parser.add_argument("--syntax", metavar="REGEX", help="only compile the units whose paths match, without code")
    parser.add_argument("--report", action="store_true", help="only write the report of what has run")
    parser.add_argument("--out", default=str(ROOT / "build/mutants"), metavar="DIRECTORY")
    args = parser.parse_args()
    args.tests = args.tests.replace("/", "_")

    out = Path(args.out)
    tree, build = out / "tree", out / "build"
    mutants = read_list()
    if len({m.id for m in mutants}) != len(mutants):
        sys.exit("tests/mutants.txt: two entries are equal")
    tree.mkdir(parents=True, exist_ok=True)
    pattern = re.compile(args.tests)
    if not args.report:
        make_tree(tree, mutants)
        configure(args, tree, build)
        if args.syntax is not None:
            return check_syntax(args, build)
        # -k: a unit that does not compile leaves out its test, and is named by ninja.
        built = subprocess.run(["ninja", "-C", build, "-k", "0", "-j", str(args.jobs), *programs_of(build, pattern)])
        if built.returncode != 0:
            print("tests/mutants.sh: some programs were not built", file=sys.stderr)
    tests = load_tests(build, pattern)
    if args.report:
        stamps = {t.name: t.stamp for t in tests}
        results = [r for r in Log(out / "results.jsonl").lines if stamps.get(r["test"]) == r["stamp"]]
        results = [r for r in results if not r["mutant"] or r["mutant"] in {m.id for m in mutants}]
    else:
        results = run_all(args, out, tests, mutants)
    return report(args, out, tests, mutants, results)


if __name__ == "__main__":
    sys.exit(timed(sys.argv[2], sys.argv[3:]) if sys.argv[1:2] == ["--timed"] else main())
