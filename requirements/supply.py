"""What picoradar is built from: ``./run lock``, ``./run audit``, ``./run sbom``.

The tools for it (pip-tools, pip-audit, cyclonedx-bom; `tools.in`) live in an environment of their own, `.venv/tools`,
installed from `tools.txt` with their hashes checked, so that they change nothing in the one that is looked at.
"""

import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
TOOLS = ROOT / ".venv" / "tools"
BIN = TOOLS / ("Scripts" if os.name == "nt" else "bin")
STAMP = TOOLS / "picoradar-tools-done"
DEV, TOOLS_LOCK, TOOLS_NEEDS = HERE / "dev.txt", HERE / "tools.txt", HERE / "tools.in"
BUILD_NEEDS = TOOLS / "build.in"  # of pyproject.toml, so that nothing is fetched beside the lock to install the project
KNOWN_BAD = "pyyaml==5.3"  # PYSEC-2020-96 and others: a database that does not know these tells nothing by its silence
CANARY = TOOLS / "canary.txt"
SBOM = ROOT / "dist" / "picoradar.cdx.json"
# No address of an index, and no name of this computer's folders, gets into the files.
COMPILE = [
    "--generate-hashes",
    "--no-emit-index-url",
    "--no-emit-find-links",
    "--no-emit-trusted-host",
    "--strip-extras",
    "--allow-unsafe",
    "--no-header",
    "--no-annotate",
    "--quiet",
]
JOBS = {  # of pip-compile: what stands in a file, and from what it is resolved
    TOOLS_LOCK: [str(TOOLS_NEEDS)],
    DEV: ["--extra", "dev", str(ROOT / "pyproject.toml"), str(BUILD_NEEDS)],
}


def say(text):
    print(text, file=sys.stderr, flush=True)


def tools_there():
    """Whether the tools are installed, or could be installed now."""
    lock = TOOLS_LOCK.read_bytes() if TOOLS_LOCK.exists() else b""
    wanted = hashlib.sha256(lock + TOOLS_NEEDS.read_bytes() + sys.version.encode()).hexdigest()
    if STAMP.exists() and STAMP.read_text() == wanted:
        return True
    say("run: setting up the tools in .venv/tools (once)")
    shutil.rmtree(TOOLS, ignore_errors=True)
    if subprocess.run([sys.executable, "-m", "venv", str(TOOLS)], check=False).returncode:
        return False
    pip = [str(BIN / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    locked = (
        bool(lock) and subprocess.run([*pip, "--require-hashes", "-r", str(TOOLS_LOCK)], check=False).returncode == 0
    )
    if not locked:
        say("run: the tools are not locked for this system, or their packages cannot be had; trying the ranges")
        if subprocess.run([*pip, "-r", str(TOOLS_NEEDS)], check=False).returncode:
            return False
    STAMP.write_text(wanted)
    return True


def lock():
    """Resolve all versions anew, and write them with the hashes of all their wheels."""
    if not tools_there():
        say("run: no lock was written: the tools cannot be installed (see above)")
        return 3
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]["requires"]
    BUILD_NEEDS.write_text("\n".join(build), encoding="utf-8")
    system = f"{platform.python_implementation()} {sys.version_info[0]}.{sys.version_info[1]} {sys.platform}"
    for path, needs in JOBS.items():
        say(f"run: resolving {path.name}")
        new = path.with_suffix(".new")
        step = [str(BIN / "pip-compile"), *COMPILE, "--output-file", str(new), *needs]
        code = subprocess.run(step, cwd=ROOT, check=False).returncode
        text = new.read_text(encoding="utf-8") if new.exists() else ""
        new.unlink(missing_ok=True)
        if code or not text:
            return code or 3
        head = f"# Written by ./run lock; resolved for: {system} {platform.machine()}\n"
        # The project itself is named too, by its folder, because its extra "dev" takes in another one.
        kept = [
            line for line in text.splitlines(keepends=True) if not line.startswith(("picoradar @", "# WARN", "# Cons"))
        ]
        path.write_text(head + "".join(kept), encoding="utf-8")
    return 0


def audit():
    """Ask the Python packaging advisory database about every locked version; without a network that is skipped."""
    if not tools_there():
        return skipped("the tools cannot be installed")
    CANARY.write_text(f"{KNOWN_BAD} --hash=sha256:{'0' * 64}\n", encoding="utf-8")
    asked, known = advisories(CANARY)
    if not asked:
        return skipped(f"the database cannot be asked: {known}")
    if not known:
        return skipped(f"the database that can be reached here knows nothing against {KNOWN_BAD}, so it knows nothing")
    asked, known = advisories(DEV)
    if not asked:
        return skipped(f"the database cannot be asked: {known}")
    for name, version, one in known:
        mended = ", ".join(one["fix_versions"]) or "none yet"
        say(f"run: {name} {version}: {one['id']} ({', '.join(one['aliases'])}); mended in: {mended}")
    say(
        f"run: audit: {asked} packages, {len(known)} known vulnerabilities"
        + ("; renew them: ./run lock" if known else "")
    )
    return 1 if known else 0


def advisories(requirements):
    """Number of packages asked about and what is known against them: (name, version, advisory); or 0 and why not."""
    found = TOOLS / "audit.json"
    found.unlink(missing_ok=True)
    step = [str(BIN / "pip-audit"), "--require-hashes", "--disable-pip", "--requirement", str(requirements)]
    step += ["--format", "json", "--output", str(found), "--progress-spinner", "off", "--timeout", "15"]
    done = subprocess.run(step, stderr=subprocess.PIPE, text=True, check=False)
    try:
        packages = json.loads(found.read_text(encoding="utf-8"))["dependencies"]
    except (OSError, ValueError, KeyError):
        return 0, (done.stderr.strip().splitlines() or ["no answer"])[-1][:200]
    return len(packages), [(p["name"], p["version"], one) for p in packages for one in p.get("vulns", ())]


def skipped(why):
    say(f"run: AUDIT SKIPPED, nothing is known about vulnerabilities: {why}")
    return 0


def sbom():
    """Write what is installed in .venv as a CycloneDX bill of materials."""
    if not tools_there():
        say("run: no SBOM was written: the tools cannot be installed (see above)")
        return 3
    SBOM.parent.mkdir(exist_ok=True)
    step = [str(BIN / "cyclonedx-py"), "environment", sys.executable, "--pyproject", str(ROOT / "pyproject.toml")]
    step += ["--output-reproducible", "--output-format", "JSON", "--output-file", str(SBOM)]
    code = subprocess.run(step, check=False).returncode
    if code == 0:
        print(SBOM)
    return code


if __name__ == "__main__":
    sys.exit({"lock": lock, "audit": audit, "sbom": sbom}[sys.argv[1]]())
