"""The draw of mistakes, and their places in another revision."""

from __future__ import annotations

import fnmatch
import io
import random
import subprocess
import tarfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from .mistakes import KINDS, Mistake, mistakes_of
from .rust import Source

# Files of tests, whether or not their parent modules say so.
TEST_FILES = ("*/tests.rs", "*/tests/*")


class Sources:
    """The code of some packages at a revision that mistakes can be made in."""

    def __init__(self, root: Path, revision: str, packages: list[str], left_out: list[str]) -> None:
        self.files: dict[str, Source] = {}
        self.lines: Counter[str] = Counter()
        self._places: dict[str, list[list[Mistake]]] = {}
        self._by_identity: dict[tuple, list[Mistake]] = defaultdict(list)
        for package in packages:
            files = _archive(root, revision, package)
            tests = {file for name, source in files.items() for file in _test_files(name, source)}
            self._places[package] = []
            for name, source in files.items():
                path = PurePosixPath(name).with_suffix("")
                in_tests = any(str(parent) in tests for parent in [path, *path.parents])
                if in_tests or any(fnmatch.fnmatch(name, glob) for glob in [*TEST_FILES, *left_out]):
                    continue
                self.files[name] = source
                self.lines[package] += source.code_lines()
                self._places[package] += mistakes_of(package, name, source)
            for place in self._places[package]:
                for mistake in place:
                    self._by_identity[_identity(mistake)].append(mistake)

    def places(self, package: str, kind: str) -> list[list[Mistake]]:
        """The places for mistakes of a kind in a package, with all that can be made there."""
        return [place for place in self._places[package] if place[0].kind == kind]

    def locate(self, mistake: Mistake) -> Mistake | None:
        """The mistake as it is made here, by function and lines, if need be in the file they moved to."""
        candidates = self._by_identity[_identity(mistake)]
        same_file = [candidate for candidate in candidates if candidate.file == mistake.file]
        candidates = same_file or candidates
        return candidates[0] if len(candidates) == 1 else None


@dataclass
class Slot:
    """One of the mistakes that are asked for, with replacements in case it does not compile."""

    number: int
    package: str
    kind: str
    candidates: Iterator[Mistake]
    # None where the candidates are exhausted.
    mistake: Mistake | None = None
    # Reason why the mistake is not planted: `absent` or `does not compile`.
    obstacle: str = ""
    # Test that caught a replayed mistake, as in the results.
    killer: dict | None = None

    @property
    def planted(self) -> bool:
        """Returns true if the mistake is compiled in."""
        return self.mistake is not None and not self.obstacle

    def advance(self, sources: Sources) -> None:
        """Takes the next candidate, as it stands in the revision that is tested."""
        drawn = next(self.candidates, None)
        located = drawn and sources.locate(drawn)
        self.mistake = located or drawn
        self.obstacle = "absent" if drawn and not located else ""
        if located:
            self.package = located.package

    def drop(self, sources: Sources) -> None:
        """Replaces a mistake that does not compile; without a replacement it stays, marked."""
        last = self.mistake
        self.advance(sources)
        if self.mistake is None:
            self.mistake, self.obstacle = last, "does not compile"


def draw(sources: Sources, seed: int, count: int) -> list[Slot]:
    """Draws mistakes: packages by their lines of code, kinds evenly as far as a package has them.

    A slot has candidates of its own, so that which of them compile changes no other slot.
    """
    packages = [package for package in sources.lines if sources.lines[package]]
    quotas = _quotas({package: sources.lines[package] for package in packages}, count)
    order = [package for package in packages for _ in range(quotas[package])]
    random.Random(f"{seed} packages").shuffle(order)
    places = {(package, kind): sources.places(package, kind) for package in packages for kind in KINDS}
    taken: Counter[tuple[str, str]] = Counter()
    kinds: Counter[str] = Counter()
    drawn = []
    ties = random.Random(f"{seed} kinds")
    for package in order:
        # A kind of few places keeps some of them for replacements.
        left = [kind for kind in KINDS if 2 * taken[package, kind] < len(places[package, kind])]
        if not left:
            continue
        kind = min(left, key=lambda kind: (kinds[kind], ties.random()))
        drawn.append((package, kind, taken[package, kind]))
        taken[package, kind] += 1
        kinds[kind] += 1
    for (package, kind), list_of_places in places.items():
        random.Random(f"{seed} {package} {kind}").shuffle(list_of_places)
    drawn.sort(key=lambda slot: (packages.index(slot[0]), KINDS.index(slot[1]), slot[2]))
    slots = []
    for number, (package, kind, rank) in enumerate(drawn, 1):
        own = places[package, kind][rank :: taken[package, kind]]
        choice = random.Random(f"{seed} {package} {kind} {rank}")
        candidates = [choice.choice(place) for place in own]
        slots.append(Slot(number, package, kind, iter(candidates)))
    return slots


def replay(results: dict) -> list[Slot]:
    """The mistakes of an earlier run, under their numbers."""
    slots = []
    for entry in results["mistakes"]:
        mistake = Mistake(
            **{key: entry[key] for key in ("package", "file", "function", "kind", "line")},
            **{key: entry[key] for key in ("right", "wrong", "occurrence")},
            start=0,
            end=0,
            new="",
            scope=(0, 0),
        )
        slot = Slot(entry["number"], mistake.package, mistake.kind, iter([mistake]))
        slot.killer = entry.get("caught_by")
        slots.append(slot)
    return slots


def _identity(mistake: Mistake) -> tuple:
    return (mistake.function, mistake.kind, mistake.right, mistake.wrong, mistake.occurrence)


def _quotas(weights: dict[str, int], count: int) -> dict[str, int]:
    """Divides a count by weights; the largest remainders are rounded up."""
    total = sum(weights.values())
    shares = {name: count * weight / total for name, weight in weights.items()}
    quotas = {name: int(share) for name, share in shares.items()}
    by_remainder = sorted(shares, key=lambda name: quotas[name] - shares[name])
    for name in by_remainder[: count - sum(quotas.values())]:
        quotas[name] += 1
    return quotas


def _archive(root: Path, revision: str, package: str) -> dict[str, Source]:
    """The sources of a package as committed at a revision; empty if the revision lacks the package."""
    command = ["git", "-C", str(root), "archive", "--format=tar", revision, f"{package}/src"]
    ran = subprocess.run(command, capture_output=True)
    if ran.returncode != 0:
        return {}
    files = {}
    with tarfile.open(fileobj=io.BytesIO(ran.stdout)) as archive:
        for member in archive:
            if member.isfile() and member.name.endswith(".rs"):
                text = archive.extractfile(member).read().decode()
                try:
                    files[member.name] = Source.read(text)
                except ValueError as error:
                    raise SystemExit(f"{revision}:{member.name}: {error}") from error
    return dict(sorted(files.items()))


def _test_files(name: str, source: Source) -> Iterator[str]:
    """The paths, without ending, of the modules of a file that only tests see."""
    path = PurePosixPath(name)
    folder = path.parent if path.name in ("lib.rs", "main.rs", "mod.rs") else path.with_suffix("")
    for module in source.test_modules:
        yield str(folder / module)
