"""Run the README's Python example in this folder and compare with the output printed there."""

import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).resolve().parent.parent / "README.md"
EXAMPLE = re.compile(r"```python\n(?P<code>.*?)```\n```\n(?P<output>.*?)```", re.DOTALL)


def main() -> int:
    found = EXAMPLE.search(README.read_text())
    if found is None:
        print("the README has no Python example with its output")
        return 1
    command = [sys.executable, "-W", "error", "-c", found["code"]]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    if printed != found["output"]:
        print(f"the README says:\n{found['output']}\nthe example prints:\n{printed}")
        return 1
    print("the README's example prints what the README says")
    return 0


if __name__ == "__main__":
    sys.exit(main())
