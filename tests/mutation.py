"""Mutation testing: does a test fail when an important line is wrong? Prints a table in Markdown.

    python tests/mutation.py [--trust] [NUMBER ...]

Each mutant of `MUTANTS` changes one line in a copy of the tracked files, in which the fast test
files that are named with it are run: it is caught if one of them fails, and survives if none does.
The tests are run without a mutant first, unless they are to be trusted. Takes some ten minutes of
one core, at the lowest priority. Exit code 0: at least `GOAL` are caught.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
GOAL = 0.9
LIBRARIES = (
    "hypothesis", "manifold3d", "matplotlib.figure", "ompl.base", "pyarrow.parquet", "pydrake.all",
    "rich.console", "scipy.optimize", "scipy.stats", "trimesh", "tyro", "yaml",
)  # fmt: skip
CPU_LIMIT = 180  # [s] Of the tests of one mutant: one that loops for ever is caught by it.


@dataclass(frozen=True)
class Mutant:
    """One wrong line.

    Attributes:
        wrong: What the code does wrongly then.
        file: In which.
        old: Text that occurs once in it.
        new: What stands there instead.
        tests: Names of test files, without ``test_`` and ending.
    """

    wrong: str
    file: str
    old: str
    new: str
    tests: str


GRASPING, CONDITIONS = "planning/operations/grasping.py", "cell/simulation/conditions.py"
SIMULATION, JIG = "cell/simulation/simulation.py", "cell/fixtures/soft_jig"
POLICY, THREAD = "cell/link_policy.py", "cell/workpieces/thread.py"
THREADS, ALGORITHM = "cell/workpieces/threads.py", "planning/feasibility/algorithm.py"
FEASIBILITY, CAMPAIGNS = "planning/feasibility", "experiments/campaigns"
PRODUCT_FILE = "cell/products/product_file.py"

MUTANTS = (
    # Guards and conditions.
    Mutant("a lost grasp is noticed late", GRASPING, "held - LOST)", "held - 2 * LOST)", "guards"),
    Mutant(
        "a part left behind is not noticed",
        GRASPING, "LEFT_BEHIND = 0.03", "LEFT_BEHIND = 0.3", "guards",
    ),
    Mutant(
        "the guard of the force reads a torque",
        CONDITIONS, "force = float(np.linalg.norm(sensed.wrench[self.arm][3:]))",
        "force = float(np.linalg.norm(sensed.wrench[self.arm][:3]))", "guards",
    ),
    Mutant(
        "an insertion does not watch the grip",
        "planning/operations/mating.py", "FirstOf((lost_grasp(station), TooMuchForce(",
        "FirstOf((TooMuchForce(", "guards",
    ),
    Mutant(
        "a push from below counts with the wrong sign",
        CONDITIONS, "bool(sensed.wrench[self.arm][5] >= self.force)",
        "bool(-sensed.wrench[self.arm][5] >= self.force)", "guards",
    ),
    Mutant(
        "a time-out comes a second late",
        SIMULATION, "if sensed.time > phase.timeout:", "if sensed.time > phase.timeout + 1.0:",
        "guards",
    ),
    Mutant(
        "a command that is not finite is noticed only if all of it is not",
        SIMULATION, "if not all(np.isfinite(value).all() for value in values):",
        "if not any(np.isfinite(value).all() for value in values):", "guards",
    ),
    Mutant(
        "a quantity that is not a number keeps its limit",
        "planning/operations/limits.py", "not abs(value) <= limit.limit",
        "abs(value) > limit.limit", "measures operations",
    ),
    Mutant(
        "a reading counts as steady before it was watched",
        CONDITIONS, "self._last, self._since = here, sensed.time", "self._last = here", "waiting",
    ),
    # Units and signs.
    Mutant(
        "angles of a product file are taken for radians",
        PRODUCT_FILE, 'np.deg2rad(pose.vector("rpy_deg"))', 'pose.vector("rpy_deg")',
        "loading parts tray",
    ),
    Mutant(
        "the width of a grasp is read in centimetres",
        PRODUCT_FILE, 'fields.positive("width_mm") * 1e-3', 'fields.positive("width_mm") * 1e-2',
        "loading parts",
    ),
    Mutant(
        "wrenches are those on the tool, not on the sensor",
        "cell/machines/sensors.py", "return -(R_WJc.matrix()", "return (R_WJc.matrix()", "jig_base",
    ),
    Mutant(
        "the tray is turned the other way",
        "experiments/assembly/prepare.py", "nominal.tray_yaw_deg + self.yaw_deg",
        "nominal.tray_yaw_deg - self.yaw_deg", "station tray",
    ),
    Mutant(
        "the upper end of a range is refused",
        "cell/setting.py", "number <= self.at_most)\n", "number < self.at_most)\n", "setting",
    ),
    Mutant(
        "turns of a bolt count backwards",
        THREADS, "(self.engagement(root, bolt).caught_angle - angle)",
        "(angle - self.engagement(root, bolt).caught_angle)", "thread",
    ),
    Mutant(
        "a part in the hand follows it the wrong way round",
        "planning/perception/belief.py", "X_WH @ X_WH_then.inverse() @ X_WP",
        "X_WH_then @ X_WH.inverse() @ X_WP", "belief",
    ),
    # Threads and links.
    Mutant(
        "a thread catches a bolt that is far below",
        THREAD, "abs(self.axial) <= gate.axial", "self.axial <= gate.axial", "thread",
    ),
    Mutant(
        "a bolt is not locked when the spindle stops",
        THREADS, "row = replace(row, state=ThreadState.LOCKED)",
        "row = replace(row, state=ThreadState.CAUGHT)", "thread",
    ),
    Mutant(
        "a head is linked while it turns",
        POLICY, "is ThreadState.LOCKED or None", "is ThreadState.CAUGHT or None", "contact_links",
    ),
    Mutant(
        "a part is linked to the soft bed",
        POLICY, "return self.fixture.fixed(root) or None", "return True", "contact_links",
    ),
    Mutant(
        "what is being mated is linked",
        POLICY, "return None if frozenset(names) in mating else rule.until(self, root, *names)",
        "return rule.until(self, root, *names)", "contact_links",
    ),
    # The jig.
    Mutant(
        "a bag with less vacuum than the pump's never freezes",
        f"{JIG}/dynamics.py", "vacuum.jam_fraction * memory.target:",
        "vacuum.jam_fraction * vacuum.pressure:", "soft_jig ports",
    ),
    Mutant(
        "the time constant of the pump is inverted",
        f"{JIG}/dynamics.py", "-np.expm1(-dt / vacuum.time_constant)",
        "-np.expm1(-dt * vacuum.time_constant)", "soft_jig",
    ),
    Mutant(
        "cohesion goes with the sine of the friction angle",
        f"{JIG}/frozen/yielding.py", "confinement * np.tan(soil.friction_angle)",
        "confinement * np.sin(soil.friction_angle)", "yielding",
    ),
    Mutant(
        "a wall yields actively, not passively",
        f"{JIG}/frozen/yielding.py", "np.tan(np.pi / 4 + soil.friction_angle / 2)",
        "np.tan(np.pi / 4 - soil.friction_angle / 2)", "yielding",
    ),
    Mutant(
        "a seal that was broken seals again",
        f"{JIG}/frozen/suction.py", "self.intact = np.minimum(self.intact, closed)",
        "self.intact = closed", "suction",
    ),
    Mutant(
        "the bag closes in proportion to the vacuum",
        f"{JIG}/parameters.py", "(vacuum / FULL_VACUUM) ** self.contraction_exponent",
        "(vacuum / FULL_VACUUM)", "soft_jig jam_postures",
    ),
    Mutant(
        "a part may be pulled out while the vacuum still holds it",
        f"{JIG}/jig.py", "return self.memory(root).pressure < VENTED",
        "return self.memory(root).target < VENTED", "soft_jig",
    ),
    Mutant(
        "more vacuum than the pump has is drawn in silence",
        f"{JIG}/jig.py", "if not -ROUNDING <= wanted <= most + ROUNDING:",
        "if not -ROUNDING <= wanted:", "soft_jig ports",
    ),
    # The planner.
    Mutant(
        "the highest centre of gravity is preferred",
        ALGORITHM, "lowest = min(heights[j] for j in candidates)",
        "lowest = max(heights[j] for j in candidates)", "algorithm",
    ),
    Mutant(
        "upright postures are not preferred",
        ALGORITHM, "candidates = upright or names", "candidates = names", "algorithm",
    ),
    Mutant(
        "the part that comes from above is fixed",
        ALGORITHM, "if posture == opposite(up):", "if posture == up:", "algorithm",
    ),
    Mutant(
        "parts leave where one of their pairs is free",
        f"{FEASIBILITY}/matrices.py", "int(touches and bool(free[j][pairs].all()))",
        "int(touches and bool(free[j][pairs].any()))", "matrices algorithm",
    ),
    Mutant(
        "the reversed motion is entered for the same pair",
        f"{FEASIBILITY}/interference.py", "free[forward][i, k] = free[opposite(forward)][k, i]",
        "free[forward][i, k] = free[opposite(forward)][i, k]", "interference",
    ),
    # Campaigns, files, comparison.
    Mutant(
        "trials of other seeds are the same",
        f"{CAMPAIGNS}/code_version.py", "config.to_dict(), seed, dict(options)",
        "config.to_dict(), dict(options)", "campaigns",
    ),
    Mutant(
        "a changed script is not seen",
        f"{CAMPAIGNS}/code_version.py", "    digest.update(script.read_bytes())\n", "", "campaigns",
    ),
    Mutant(
        "an error is a verdict that stands",
        f"{CAMPAIGNS}/trial.py", 'DONE = ("success", "failure")',
        'DONE = ("success", "failure", "error")', "campaign_runs",
    ),
    Mutant(
        "two writers share a temporary file",
        "cell/whole_file.py", "secrets.token_hex(8)", '"0" * 16', "output folders",
    ),
    Mutant(
        "the smaller of two tolerances applies",
        "experiments/compare/tolerances.py", "return max(self.absolute,",
        "return min(self.absolute,", "compare",
    ),
    Mutant(
        "two runs write into one folder",
        "experiments/reporting/folder_lock.py", "fcntl.LOCK_EX |", "fcntl.LOCK_SH |", "folders",
    ),
)  # fmt: skip


def copied(folder: Path) -> Path:
    """Copy the tracked files, as they are now, into a folder; return it."""
    names = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout
    for name in filter(None, names.split("\0")):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def tested(folder: Path, tests: str) -> tuple[int, str]:
    """Run test files in a copy, up to the first failure; return pytest's exit code and output.

    In a child of this process, which has imported the libraries already, but nothing of ours.
    """
    files = [f"tests/test_{name}.py" for name in tests.split()]
    log = folder / "mutation.log"
    child = os.fork()
    if child == 0:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT, CPU_LIMIT))
        os.chdir(folder)
        os.environ["PYTHONPATH"] = sys.path[0] = str(folder)
        output = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(output, 1)
        os.dup2(output, 2)
        options = ["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist"]
        code = int(pytest.main([*options, *files]))
        sys.stdout.flush()
        os._exit(code)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), log.read_text(errors="replace")


def outcome(folder: Path, mutant: Mutant, number: int) -> str:
    """Return which test catches a mutant, or "survives"."""
    file = folder / mutant.file
    text, times = file.read_text(), file.stat()
    if text.count(mutant.old) != 1:
        raise SystemExit(f"{mutant.file}: {text.count(mutant.old)} times '{mutant.old}'.")
    file.write_text(text.replace(mutant.old, mutant.new))
    # Python knows its compiled files by the time and size of the source.
    os.utime(file, (times.st_atime, times.st_mtime + number))
    try:
        code, output = tested(folder, mutant.tests)
    finally:
        file.write_text(text)
        os.utime(file, (times.st_atime, times.st_mtime))
    if code == 0:
        return "survives"
    failed = [line for line in output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    if failed:
        return failed[0].split(" - ")[0].removeprefix("FAILED ").removeprefix("ERROR ")
    return "ran too long" if code < 0 else f"exit code {code}"


def main() -> int:
    """Print the table; return 0 if the goal is met."""
    os.nice(19)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # A process with threads is not to be forked.
    for name in LIBRARIES:
        with suppress(ImportError):
            import_module(name)
    words = [word for word in sys.argv[1:] if word != "--trust"]
    numbers = [int(word) for word in words] or range(1, len(MUTANTS) + 1)
    chosen = {number: MUTANTS[number - 1] for number in numbers}
    with tempfile.TemporaryDirectory() as temporary:
        folder = copied(Path(temporary))
        files = dict.fromkeys(name for mutant in chosen.values() for name in mutant.tests.split())
        code, output = (0, "") if "--trust" in sys.argv else tested(folder, " ".join(files))
        if code != 0:
            print(output[-3000:], file=sys.stderr)
            raise SystemExit("The tests fail without any mutant.")
        print("| | what is wrong | file | caught by |\n|--:|---|---|---|", flush=True)
        survivors = 0
        for number, mutant in chosen.items():
            found = outcome(folder, mutant, number)
            survivors += found == "survives"
            cells = (number, mutant.wrong, mutant.file, found.removeprefix("tests/"))
            print("|", " | ".join(map(str, cells)), "|", flush=True)
    caught = len(chosen) - survivors
    print(
        f"\n{caught} of {len(chosen)} caught: {caught / len(chosen):.0%}; {GOAL:.0%} are asked for."
    )
    return 0 if caught >= GOAL * len(chosen) else 1


if __name__ == "__main__":
    sys.exit(main())
