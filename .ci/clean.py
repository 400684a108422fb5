"""Refuse what must not be committed: registry addresses, machine paths, lock files."""

import re
import subprocess
import sys
from pathlib import Path

FORBIDDEN = {
    # Spelled so that this file does not match itself.
    "a registry or download address": re.compile(
        r"files\.pythonhosted\." + r"org|pypi\." + r"org/|registry\.npmjs\." + r"org"
    ),
    "a machine path": re.compile(r"(?<![\w.])/(root|work|home/\w+)/"),
}
NOT_TEXT = {".png", ".jpg", ".npz", ".gz", ".bin"}


def main() -> int:
    listed = subprocess.run(["git", "ls-files", "-z"], check=True, capture_output=True, text=True)
    problems = []
    for name in filter(None, listed.stdout.split("\0")):
        path = Path(name)
        if path.name == "uv.lock":
            problems.append(f"{name}: lock files carry download addresses")
        if path.suffix in NOT_TEXT or not path.is_file():
            continue
        for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
            problems += [
                f"{name}:{number}: {what}" for what, rule in FORBIDDEN.items() if rule.search(line)
            ]
    print("\n".join(problems) or "clean")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
