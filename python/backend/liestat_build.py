"""PEP 517 backend that builds the module with CMake; nothing but the standard library, CMake and a compiler.

Environment: CMAKE_GENERATOR, CMAKE_CXX_COMPILER_LAUNCHER and the like are CMake's own; CMAKE_BUILD_PARALLEL_LEVEL sets
how many compilers run at once (default: one for each processor and gigabyte of free memory); LIESTAT_BUILD_DIRECTORY is
where the build is kept (default: build/python-<version>), so that the next one is quick.
"""

import base64
import hashlib
import io
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def _project():
    with open(ROOT / "pyproject.toml", "rb") as file:
        project = tomllib.load(file)["project"]
    text = (ROOT / "CMakeLists.txt").read_text(encoding="utf-8")
    project["version"] = re.search(r"project\(liestat VERSION (\S+)", text).group(1)
    return project


def _metadata():
    project = _project()
    lines = [
        "Metadata-Version: 2.1",
        f"Name: {project['name']}",
        f"Version: {project['version']}",
        f"Summary: {project['description']}",
        f"License: {project['license']['text']}",
        f"Requires-Python: {project['requires-python']}",
        *(f"Requires-Dist: {dependency}" for dependency in project["dependencies"]),
    ]
    return "\n".join(lines) + "\n"


def _tag():
    abi = sysconfig.get_config_var("SOABI").split("-")[1]
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    platform = re.sub(r"[.-]", "_", sysconfig.get_platform())
    return f"{python}-cp{abi}-{platform}"


def _jobs():
    jobs = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            kilobytes = int(re.search(r"MemAvailable:\s*(\d+)", file.read()).group(1))
        jobs = min(jobs, kilobytes >> 20)
    except OSError:
        pass
    return str(max(jobs, 1))


def _build():
    """Builds the package; returns the directory that holds it."""
    cmake = shutil.which("cmake")
    if cmake is None:
        raise SystemExit("liestat: CMake is missing; ./run install python installs what the module needs")
    directory = Path(
        os.environ.get("LIESTAT_BUILD_DIRECTORY") or ROOT / "build" / f"python-{sysconfig.get_config_var('SOABI')}"
    )
    configure = [cmake, "-S", str(ROOT), "-B", str(directory), "-DCMAKE_BUILD_TYPE=Release"]
    if not (directory / "CMakeCache.txt").exists() and "CMAKE_GENERATOR" not in os.environ and shutil.which("ninja"):
        configure += ["-G", "Ninja"]
    for part in ("CLI", "TESTS", "BENCHMARKS", "EXAMPLES"):
        configure.append(f"-DLIESTAT_BUILD_{part}=OFF")
    configure += [
        "-DLIESTAT_BUILD_PYTHON=ON",
        "-DLIESTAT_INSTALL=OFF",
        f"-DPython3_EXECUTABLE={sys.executable}",
        "-DPython3_FIND_VIRTUALENV=ONLY",
    ]
    environment = dict(os.environ)
    environment.setdefault("CMAKE_BUILD_PARALLEL_LEVEL", _jobs())
    subprocess.run(configure, check=True, env=environment)
    subprocess.run(
        [cmake, "--build", str(directory), "--target", "liestat_python_package"], check=True, env=environment
    )
    return directory / "python"


class _Wheel:
    """Writes a wheel: the files, their hashes, the metadata."""

    def __init__(self, directory, name):
        self.path = Path(directory) / name
        self._zip = zipfile.ZipFile(self.path, "w", zipfile.ZIP_DEFLATED)
        self._record = []

    def add(self, name, content, executable=False):
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        self._record.append(f"{name},sha256={digest},{len(content)}")
        info = zipfile.ZipInfo(name, date_time=(2020, 1, 1, 0, 0, 0))
        info.compress_type = zipfile.ZIP_DEFLATED
        info.external_attr = (0o755 if executable else 0o644) << 16
        self._zip.writestr(info, content)

    def close(self, info):
        self.add(f"{info}/METADATA", _metadata().encode())
        wheel = f"Wheel-Version: 1.0\nGenerator: liestat_build\nRoot-Is-Purelib: false\nTag: {_tag()}\n"
        self.add(f"{info}/WHEEL", wheel.encode())
        self.add(f"{info}/LICENSE", (ROOT / "LICENSE").read_bytes())
        record = "\n".join([*self._record, f"{info}/RECORD,,"]) + "\n"
        self._zip.writestr(zipfile.ZipInfo(f"{info}/RECORD", date_time=(2020, 1, 1, 0, 0, 0)), record)
        self._zip.close()


def get_requires_for_build_wheel(config_settings=None):
    return []


def get_requires_for_build_sdist(config_settings=None):
    return []


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    project = _project()
    package = _build() / "liestat"
    wheel = _Wheel(wheel_directory, f"liestat-{project['version']}-{_tag()}.whl")
    suffix = sysconfig.get_config_var("EXT_SUFFIX")
    for path in sorted(package.iterdir()):
        if path.suffix in (".py", ".pyi") or path.name in ("py.typed", f"_core{suffix}"):
            wheel.add(f"liestat/{path.name}", path.read_bytes(), executable=path.suffix == ".so")
    wheel.close(f"liestat-{project['version']}.dist-info")
    return wheel.path.name


def build_sdist(sdist_directory, config_settings=None):
    project = _project()
    base = f"liestat-{project['version']}"
    path = Path(sdist_directory) / f"{base}.tar.gz"
    names = ["CMakeLists.txt", "pyproject.toml", "LICENSE", "README.md", "cmake"]
    names += ["lie", "stats", "fusion", "formats", "report", "experiments", "cli", "python"]

    def clean(info):
        return None if "__pycache__" in info.name else info

    with tarfile.open(path, "w:gz") as archive:
        for name in names:
            archive.add(ROOT / name, f"{base}/{name}", filter=clean)
        content = _metadata().encode()
        info = tarfile.TarInfo(f"{base}/PKG-INFO")
        info.size = len(content)
        archive.addfile(info, io.BytesIO(content))
    return path.name
