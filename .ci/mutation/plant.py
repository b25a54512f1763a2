"""Plants mistakes in a copy of the checkout, all at once, each behind a switch read at run time.

A function with a mistake gets a second body: `{ if crate::mutant::on(7) { wrong } else { right } }`.
So one build serves all mistakes. Where the function returns `impl Trait`, two bodies would have two
types, and the closure that holds the mistake is written twice instead.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from .draw import Slot, Sources
from .mistakes import Mistake

# `on` costs one relaxed load. In the first run, without a mistake, it notes the switches that a test
# reaches: a test that never asks for a mistake cannot find it. The attribute `deprecated` makes the
# compiler's warnings tell which switches are compiled at all.
SWITCH = """\
extern crate std as planted_std;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};
use planted_std::io::Write as _;
const UNREAD: u32 = u32::MAX;
const NOTES: u32 = u32::MAX - 1;
const NOTED_IN: &str = "FOXHUNT_MUTANTS_REACHED";
static ACTIVE: AtomicU32 = AtomicU32::new(UNREAD);
static REACHED: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];
#[deprecated]
#[inline(always)]
pub(crate) fn on(mistake: u32) -> bool {
    let active = ACTIVE.load(Relaxed);
    if active < NOTES { active == mistake } else { read_or_note(mistake) }
}
#[cold]
#[inline(never)]
fn read_or_note(mistake: u32) -> bool {
    if ACTIVE.load(Relaxed) == UNREAD {
        let given = planted_std::env::var("FOXHUNT_MUTANT").ok();
        let notes = planted_std::env::var_os(NOTED_IN).map(|_| NOTES);
        ACTIVE.store(notes.or(given.and_then(|given| given.parse().ok())).unwrap_or(0), Relaxed);
        return on(mistake);
    }
    if !REACHED[mistake as usize].load(Relaxed) && !REACHED[mistake as usize].swap(true, Relaxed) {
        let path = planted_std::env::var_os(NOTED_IN).unwrap_or_default();
        let file = planted_std::fs::OpenOptions::new().append(true).create(true).open(path);
        let _ = file.and_then(|mut file| file.write_all(planted_std::format!("{mistake}\\n").as_bytes()));
    }
    false
}
"""
SWITCHED_ON = re.compile(r"mutant::on\((\d+)\)")


@dataclass(frozen=True)
class Region:
    """Lines of a file with mistakes in them: one wrong branch, or all branches of a span."""

    first: int
    last: int
    numbers: tuple[int, ...]


class Copy:
    """A copy of the checkout at a revision, in a folder that holds its target folder, too."""

    def __init__(self, root: Path, revision: str, work: Path, cargo_args: str) -> None:
        self.work = work
        self.root = work / "checkout"
        self.revision = git(root, "rev-parse", "--verify", f"{revision}^{{commit}}")
        self.cargo_args = shlex.split(cargo_args)
        self.regions: dict[str, list[Region]] = {}
        self.environment = {
            **os.environ,
            "CARGO_TARGET_DIR": os.environ.get("CARGO_TARGET_DIR", str(work / "target")),
            "CARGO_INCREMENTAL": "0",
            "CARGO_PROFILE_DEV_DEBUG": "none",
            "CARGO_TERM_COLOR": "never",
        }
        if not (self.root / ".git").exists():
            work.mkdir(parents=True, exist_ok=True)
            subprocess.run(
                ["git", "clone", "--quiet", "--shared", "--no-checkout", str(root), str(self.root)],
                check=True,
            )
        self.restore()
        self._link_recordings(root)

    def restore(self) -> None:
        """Takes all mistakes out of the sources; tests that read sources see the right ones."""
        git(self.root, "checkout", "--quiet", "--force", "--detach", self.revision)
        git(self.root, "clean", "--quiet", "--force", "-d")

    def metadata(self) -> dict:
        """Cargo's description of the workspace."""
        command = ["cargo", "metadata", "--format-version", "1", "--locked"]
        ran = subprocess.run(command, cwd=self.root, env=self.environment, capture_output=True, check=True)
        return json.loads(ran.stdout)

    def plant(self, slots: list[Slot], sources: Sources) -> None:
        """Writes the sources with all mistakes of the slots."""
        by_file: dict[str, list[tuple[int, Mistake]]] = defaultdict(list)
        for slot in slots:
            if slot.planted:
                by_file[slot.mistake.file].append((slot.number, slot.mistake))
        untouched = set(self.regions) - set(by_file)
        for file in untouched:
            self._write(file, sources.files[file].text)
        self.regions = {}
        for file, mistakes in by_file.items():
            text, self.regions[file] = render(sources.files[file].text, mistakes)
            self._write(file, text)
        count = max((slot.number for slot in slots), default=0) + 1
        for package in {slot.package for slot in slots if slot.planted}:
            self._write(f"{package}/src/mutant.rs", SWITCH.replace("COUNT", str(count)))
            library = f"{package}/src/lib.rs"
            text = (self.root / library).read_text()
            if "mod mutant;" not in text:
                self._write(library, f"{text}\nmod mutant;\n")

    def settle(
        self, slots: list[Slot], sources: Sources, command: list[str], say: Callable[[str], None]
    ) -> None:
        """Compiles, and replaces mistakes that do not compile, until all do."""
        while True:
            self.plant(slots, sources)
            say(f"cargo {shlex.join(command)}")
            errors, compiled = self._compile(command)
            culprits = self._culprits(errors)
            if not errors:
                culprits = self._unseen(slots, compiled)
            if not culprits:
                return
            for slot in slots:
                if slot.number in culprits:
                    say(f"{slot.number} {slot.mistake.identity}: {culprits[slot.number]}")
                    slot.drop(sources)

    def cargo(self, command: list[str]) -> tuple[int, list[dict], str]:
        """Runs cargo; returns its code, its messages and the last that it said otherwise."""
        command = ["cargo", *command, *self.cargo_args, "--message-format", "json"]
        log = self.work / "cargo.log"
        with open(log, "w") as stderr:
            ran = subprocess.run(
                command, cwd=self.root, env=self.environment, stdout=subprocess.PIPE, stderr=stderr, text=True
            )
        messages = [json.loads(line) for line in ran.stdout.splitlines() if line.startswith("{")]
        return ran.returncode, messages, "\n".join(log.read_text().splitlines()[-20:])

    def _compile(self, command: list[str]) -> tuple[list[dict], set[int]]:
        """The errors of a build, and the numbers of the switches that are compiled."""
        code, messages, said = self.cargo(command)
        errors, compiled = [], set()
        for message in messages:
            if message["reason"] != "compiler-message":
                continue
            diagnostic = message["message"]
            if (diagnostic.get("code") or {}).get("code") == "deprecated":
                for span in diagnostic["spans"]:
                    for line in span["text"]:
                        compiled |= {int(number) for number in SWITCHED_ON.findall(line["text"])}
            elif diagnostic["level"].startswith("error") and diagnostic["spans"]:
                errors.append(diagnostic)
        if code != 0 and not errors:
            raise SystemExit(f"cargo fails:\n{said}")
        return errors, compiled

    def _unseen(self, slots: list[Slot], compiled: set[int]) -> dict[int, str]:
        """The mistakes in code that is not compiled."""
        planted = [slot for slot in slots if slot.planted]
        for package in sorted({slot.package for slot in planted}):
            if not any(slot.number in compiled for slot in planted if slot.package == package):
                raise SystemExit(f"no test that is built depends on {package}")
        reason = "is not compiled with the features of the tests"
        return {slot.number: reason for slot in planted if slot.number not in compiled}

    def _culprits(self, errors: list[dict]) -> dict[int, str]:
        """The mistakes that errors lie in, with the error."""
        culprits = {}
        for error in errors:
            spans = sorted(error["spans"], key=lambda span: not span["is_primary"])
            regions = [region for span in spans if (region := self._region(span))]
            if not regions:
                raise SystemExit(f"an error outside of the planted mistakes:\n{error['rendered']}")
            # A single branch blames one mistake, a whole span all of them.
            region = min(regions, key=lambda region: len(region.numbers))
            for number in region.numbers:
                culprits.setdefault(number, error["message"])
        return culprits

    def _region(self, span: dict | None) -> Region | None:
        """The smallest region that holds a place, or the place that a macro was called at."""
        while span is not None:
            regions = self.regions.get(span["file_name"], [])
            holding = [region for region in regions if region.first <= span["line_start"] <= region.last]
            if holding:
                return min(holding, key=lambda region: (len(region.numbers), region.last - region.first))
            span = (span.get("expansion") or {}).get("span")
        return None

    def _write(self, file: str, text: str) -> None:
        path = self.root / file
        if not path.exists() or path.read_text() != text:
            path.write_text(text)

    def _link_recordings(self, root: Path) -> None:
        """Tests look for recordings beside the checkout, of which this may be a worktree."""
        main = Path(git(root, "rev-parse", "--path-format=absolute", "--git-common-dir")).parent
        link = self.work / "shared"
        for beside in (root.parent / "shared", main.parent / "shared"):
            if beside.is_dir() and not link.exists():
                link.symlink_to(beside)


def render(text: str, mistakes: list[tuple[int, Mistake]]) -> tuple[str, list[Region]]:
    """A file with its mistakes behind switches, and the lines in which they stand."""
    parts: list[str] = []
    regions: list[Region] = []
    line = 1

    def write(part: str) -> None:
        nonlocal line
        parts.append(part)
        line += part.count("\n")

    def copy(span: tuple[int, int], mistakes: list[tuple[int, Mistake]]) -> None:
        position = span[0]
        scopes = {mistake.scope for _, mistake in mistakes}
        for start, end in sorted(scopes, key=lambda scope: (scope[0], -scope[1])):
            # A scope inside of the one before is copied with that one.
            if start >= position:
                write(text[position:start])
                switch((start, end), [m for m in mistakes if start <= m[1].scope[0] and m[1].scope[1] <= end])
                position = end
        write(text[position : span[1]])

    def switch(scope: tuple[int, int], mistakes: list[tuple[int, Mistake]]) -> None:
        start, end = scope
        begins = line
        for number, mistake in mistakes:
            if mistake.scope == scope:
                write(f" if crate::mutant::on({number}) {{\n")
                first = line
                write(text[start : mistake.start] + mistake.new + text[mistake.end : end])
                regions.append(Region(first, line, (number,)))
                write("\n} else ")
        write("{\n")
        copy(scope, [m for m in mistakes if m[1].scope != scope])
        write("\n}")
        regions.append(Region(begins, line, tuple(number for number, _ in mistakes)))

    copy((0, len(text)), mistakes)
    return "".join(parts), regions


def git(root: Path, *arguments: str) -> str:
    """The output of a git command in a folder."""
    ran = subprocess.run(["git", "-C", str(root), *arguments], capture_output=True, text=True)
    if ran.returncode != 0:
        raise SystemExit(f"git {shlex.join(arguments)}: {ran.stderr.strip()}")
    return ran.stdout.strip()
