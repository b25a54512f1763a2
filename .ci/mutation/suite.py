"""The tests, each run in a process of its own.

A test is run by its full name, so that its result is the code of its process, its time is its own
and it ends at once. The first run, without a mistake, notes the time of each test and the mistakes
that it reaches; only tests that reach a mistake are run with it.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from .plant import Copy, git

# Tests below this time come first, whichever package they belong to.
QUICK_S = 1.0
# Longest time of a test without a mistake.
LONGEST_S = 7200.0
# The largest file that a test may write, in blocks of 512 bytes: 4 GiB.
FILE_BLOCKS = 8 * 1024 * 1024


@dataclass(frozen=True)
class Executable:
    """An executable of tests."""

    package: str
    target: str
    path: Path
    folder: Path


@dataclass
class Test:
    """A test. It runs once at a time, as some tests write files of fixed names."""

    executable: Executable
    name: str
    seconds: float = 0.0
    reached: frozenset[int] = frozenset()
    unreliable: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def label(self) -> str:
        return f"{self.executable.package}/{self.executable.target}::{self.name}"


@dataclass(frozen=True)
class Outcome:
    """The end of a test: `passes`, `fails`, `crashes` or `hangs`."""

    how: str
    seconds: float
    output: str
    reached: frozenset[int]


@dataclass(frozen=True)
class Verdict:
    """The tests' verdict on a mistake: `caught`, `survives`, `unreached` or `open`."""

    verdict: str
    seconds: float
    # Number of tests that reach the mistake.
    reaching: int
    test: Test | None = None
    how: str = ""


class Suite:
    """All tests of a copy in which mistakes are planted."""

    def __init__(
        self, copy: Copy, metadata: dict, selection: list[str], memory_gib: float, jobs: int
    ) -> None:
        self._metadata = metadata
        self._memory_kib = int(memory_gib * 1024 * 1024)
        self._jobs = jobs
        self._running: set[int] = set()
        self._guard = threading.Lock()
        self._stopped = False
        self._environment = {
            **copy.environment,
            # The seed of `.ci/run`; a failing test neither keeps its case nor looks for a smaller one.
            "PROPTEST_RNG_SEED": str(int(git(copy.root, "rev-parse", "--short=12", copy.revision), 16)),
            "PROPTEST_DISABLE_FAILURE_PERSISTENCE": "1",
            "PROPTEST_MAX_SHRINK_ITERS": "0",
        }
        self.tests = [test for executable in self._build(copy, selection) for test in self._list(executable)]
        self._dependencies = _dependencies(metadata)

    def keep(self, names: set[str]) -> None:
        """Leaves out all tests but those of some names."""
        self.tests = [test for test in self.tests if test.name in names]

    def run_unmutated(self, progress: Callable[[Test], None]) -> list[tuple[Test, Outcome]]:
        """Runs all tests without a mistake; returns those that fail."""
        failing = []

        def run(test: Test) -> None:
            outcome = self._run(test, 0, LONGEST_S, notes=True)
            test.seconds, test.reached = outcome.seconds, outcome.reached
            if outcome.how != "passes":
                failing.append((test, outcome))
            progress(test)

        self.each(self.tests, run)
        return failing

    def judge(self, number: int, package: str, killer: dict | None, killer_only: bool) -> Verdict:
        """Runs the tests that reach a mistake, or its killer alone, until one fails because of it."""
        tests = [test for test in self.tests if number in test.reached and not test.unreliable]
        if killer_only:
            tests = [test for test in tests if _is(test, killer)]
        distances = self._distances(package)

        def order(test: Test) -> tuple:
            distance = distances.get(test.executable.package, len(distances))
            return (not _is(test, killer), test.seconds > QUICK_S, distance, test.seconds)

        begin = time.monotonic()
        for test in sorted(tests, key=order):
            with test.lock:
                how = self._failure(test, number)
            if how:
                return Verdict("caught", time.monotonic() - begin, len(tests), test, how)
        verdict = "open" if killer_only else "survives" if tests else "unreached"
        return Verdict(verdict, time.monotonic() - begin, len(tests))

    def cost(self, number: int) -> float:
        """The time in seconds of all tests that reach a mistake."""
        return sum(test.seconds for test in self.tests if number in test.reached)

    def each(self, items: Iterable, act: Callable) -> None:
        """Acts on each item, on several threads; an interrupt ends all tests that are running."""
        pool = ThreadPoolExecutor(self._jobs)
        try:
            for future in [pool.submit(act, item) for item in items]:
                future.result()
        except BaseException:
            self._stopped = True
            raise
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            with self._guard:
                for group in self._running:
                    os.killpg(group, signal.SIGKILL)
            pool.shutdown()

    def _build(self, copy: Copy, selection: list[str]) -> list[Executable]:
        code, messages, said = copy.cargo(["test", "--tests", "--no-run", *selection])
        if code != 0:
            raise SystemExit(f"the tests do not build:\n{said}")
        names = {package["id"]: package["name"] for package in self._metadata["packages"]}
        return [
            Executable(
                names[message["package_id"]],
                message["target"]["name"],
                Path(message["executable"]),
                Path(message["manifest_path"]).parent,
            )
            for message in messages
            if message["reason"] == "compiler-artifact"
            and message["profile"]["test"]
            and message["executable"]
        ]

    def _list(self, executable: Executable) -> list[Test]:
        """The tests of an executable, without those that are ignored."""

        def names(*arguments: str) -> list[str]:
            command = [executable.path, "--list", "--format", "terse", *arguments]
            ran = subprocess.run(
                command,
                cwd=executable.folder,
                env=self._environment,
                capture_output=True,
                text=True,
                check=True,
            )
            return [
                line.removesuffix(": test") for line in ran.stdout.splitlines() if line.endswith(": test")
            ]

        ignored = set(names("--ignored"))
        return [Test(executable, name) for name in names() if name not in ignored]

    def _failure(self, test: Test, number: int) -> str:
        """The way in which a test fails because of a mistake; empty if it passes, or fails anyway."""
        outcome = self._run(test, number, _limit_s(test))
        if outcome.how == "passes":
            return ""
        again = self._run(test, 0, LONGEST_S)
        if again.how != "passes":
            test.unreliable = True
            return ""
        busier = again.seconds > test.seconds
        test.seconds = max(test.seconds, again.seconds)
        # A hang is waited for once more only if the machine has become busier since the first run.
        if busier or outcome.how != "hangs":
            outcome = self._run(test, number, _limit_s(test))
        return "" if outcome.how == "passes" else outcome.how

    def _run(self, test: Test, number: int, limit_s: float, notes: bool = False) -> Outcome:
        """Runs a test with a mistake, or without one if the number is 0."""
        if self._stopped:
            raise InterruptedError
        executable = test.executable
        scratch = Path(tempfile.mkdtemp(prefix="foxhunt-mutants-"))
        output, reached = scratch / "output", scratch / "reached"
        temporary = scratch / "tmp"
        temporary.mkdir()
        environment = {
            **self._environment,
            "CARGO_MANIFEST_DIR": str(executable.folder),
            "CARGO_PKG_NAME": executable.package,
            "TMPDIR": str(temporary),
            "FOXHUNT_MUTANT": str(number),
            **({"FOXHUNT_MUTANTS_REACHED": str(reached)} if notes else {}),
        }
        limits = f'ulimit -v {self._memory_kib} && ulimit -f {FILE_BLOCKS} && ulimit -c 0 && exec "$@"'
        command = ["sh", "-c", limits, "sh", str(executable.path), "--exact", test.name, "--test-threads=1"]
        begin = time.monotonic()
        try:
            with open(output, "wb") as stream:
                process = subprocess.Popen(
                    command,
                    cwd=executable.folder,
                    env=environment,
                    stdin=subprocess.DEVNULL,
                    stdout=stream,
                    stderr=stream,
                    start_new_session=True,
                )
            in_time = self._wait(process, limit_s)
            seconds = time.monotonic() - begin
            with open(output, "rb") as stream:
                text = b"".join(deque(stream, 30)).decode(errors="replace")
            if not in_time:
                how = "hangs"
            elif process.returncode < 0:
                how = "crashes"
            else:
                how = "passes" if process.returncode == 0 and "1 passed" in text else "fails"
            numbers = reached.read_text().split() if reached.exists() else []
            return Outcome(how, seconds, text, frozenset(map(int, numbers)))
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def _wait(self, process: subprocess.Popen, limit_s: float) -> bool:
        """Waits for a process and ends its group; returns true if it ended by itself in time."""
        with self._guard:
            self._running.add(process.pid)
            if self._stopped:
                os.killpg(process.pid, signal.SIGKILL)
        late = threading.Event()

        def end() -> None:
            late.set()
            os.killpg(process.pid, signal.SIGKILL)

        timer = threading.Timer(limit_s, end)
        timer.start()
        # The process is not reaped yet, so that its group cannot be another one's.
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        timer.cancel()
        timer.join()
        with self._guard:
            self._running.discard(process.pid)
            # Programs that a test started end with it.
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        return not late.is_set()

    def _distances(self, package: str) -> dict[str, int]:
        """The number of dependencies from each package down to one, by the shortest way."""
        name = next(
            entry["name"]
            for entry in self._metadata["packages"]
            if Path(entry["manifest_path"]).parent == Path(self._metadata["workspace_root"]) / package
        )
        distances = {name: 0}
        layer, steps = [name], 0
        while layer:
            steps += 1
            layer = [
                above
                for above, below in self._dependencies.items()
                if above not in distances and not below.isdisjoint(layer)
            ]
            distances |= dict.fromkeys(layer, steps)
        return distances


def _limit_s(test: Test) -> float:
    """The time after which a test with a mistake hangs."""
    return 5.0 * test.seconds + 60.0


def _dependencies(metadata: dict) -> dict[str, set[str]]:
    """The packages of the workspace that each one depends on, its tests included."""
    names = {package["id"]: package["name"] for package in metadata["packages"]}
    members = set(metadata["workspace_members"])
    return {
        names[node["id"]]: {names[below] for below in node["dependencies"] if below in members}
        for node in metadata["resolve"]["nodes"]
        if node["id"] in members
    }


def _is(test: Test, killer: dict | None) -> bool:
    """Returns true if a test is the one that caught a mistake before, wherever it stands now."""
    return killer is not None and test.name == killer["test"]
