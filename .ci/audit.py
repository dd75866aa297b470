"""Ask whether an advisory is known of any version in the lock files: `make audit`.

pip-audit is installed, locked, into an environment of its own. A known advisory fails, and so does a lock
file that cannot be read. Where no service of advisories answers, one sentence says so, and of which day the
last answer is, and nothing fails.
"""

from __future__ import annotations

import datetime
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENT = ROOT / ".venv-audit"
PYTHON = ENVIRONMENT / "bin" / "python"
LAST_ANSWER = ENVIRONMENT / "last-answer"
SERVICES = ("pypi", "osv")
MOST_SECONDS = 600

Packages = list[dict[str, Any]]
"""As pip-audit prints them: name, and version and vulns or else skip_reason."""


def install() -> str:
    """Install pip-audit; give why that failed, empty where it did not."""
    lock = str(ROOT / "requirements-audit.lock")
    if not PYTHON.exists():
        failed = _run([sys.executable, "-m", "venv", str(ENVIRONMENT)])[1]
        if failed:
            return failed
    return _run([str(PYTHON), "-m", "pip", "install", "--quiet", "--require-hashes", "-r", lock])[1]


def ask(service: str) -> tuple[Packages, str]:
    """What a service knows of the packages of all lock files, or why it gave no answer."""
    packages: Packages = []
    for lock in locks():
        said, failed = _run(_command(lock, f"--vulnerability-service={service}", "--format=json"))
        try:
            packages += json.loads(said)["dependencies"]
        except (ValueError, KeyError):
            return [], failed or "no answer"
    if all("skip_reason" in package for package in packages):
        return [], str(packages[0]["skip_reason"]) if packages else "no answer"
    return list({package["name"] + package.get("version", ""): package for package in packages}.values()), ""


def locks() -> list[Path]:
    """Every lock file; they need not agree, so each is read by itself."""
    return sorted(ROOT.glob("requirements*.lock"))


def unreadable() -> str:
    """Why pip-audit cannot read the lock files, without asking anybody; empty where it can."""
    failures = (_run(_command(lock, "--dry-run"))[1] for lock in locks())
    return next(filter(None, failures), "")


def _command(lock: Path, *options: str) -> list[str]:
    program = [str(PYTHON), "-m", "pip_audit", "--require-hashes", "--disable-pip", "--progress-spinner=off"]
    return [*program, *options, "-r", str(lock)]


def _run(command: list[str]) -> tuple[str, str]:
    """Give what a command printed, and the last line of its complaint where it failed."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=MOST_SECONDS, cwd=ROOT, check=False
        )
    except subprocess.TimeoutExpired:
        return "", "no answer in time"
    lines = done.stderr.strip().splitlines() or ["it failed"]
    return done.stdout, lines[-1][:120] if done.returncode else ""


def verdict(packages: Packages) -> tuple[list[str], int]:
    """What to print of an answer, and the exit code: 1 where an advisory is known."""
    known = [
        f"{package['name']} {package['version']}: {found['id']}, "
        + (f"fixed in {', '.join(found['fix_versions'])}" if found["fix_versions"] else "not fixed yet")
        for package in packages
        for found in package.get("vulns", [])
    ]
    skipped = [package["name"] for package in packages if "skip_reason" in package]
    lines = [f"audit: {len(packages) - len(skipped)} packages, {len(known)} known advisories", *known]
    if skipped:
        lines.append(f"audit: could not ask about {', '.join(skipped)}")
    return lines, int(bool(known))


def main() -> int:
    """Install, ask one service after the other, print the verdict; give the exit code."""
    reasons = [failed] if (failed := install()) else []
    if not reasons and (failed := unreadable()):
        print(f"audit: the lock files cannot be read: {failed}")
        return 1
    for service in () if reasons else SERVICES:
        packages, failed = ask(service)
        if not failed:
            lines, code = verdict(packages)
            print("\n".join(lines))
            LAST_ANSWER.write_text(f"{datetime.datetime.now(datetime.UTC).date()}, {service}")
            return code
        reasons.append(f"{service}: {failed}")
    last = LAST_ANSWER.read_text() if LAST_ANSWER.exists() else "none yet"
    print(f"audit: could not ask for advisories ({'; '.join(reasons)}); the last answer: {last}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
