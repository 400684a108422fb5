"""Start the installed `carstage gui`; fetch its page, the assets that it names, the datasets.

It fails if the interface reports an exception of any of its threads meanwhile.
"""

import json
import re
import subprocess
import sys
import tempfile
import urllib.request
from http.cookiejar import CookieJar

BROWSER = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(CookieJar()))


def fetch(url: str) -> bytes:
    with BROWSER.open(url, timeout=60) as answer:
        content: bytes = answer.read()
    return content


def main() -> int:
    command = ["carstage", "gui", "--port", "0", "--no-browser"]
    with (
        tempfile.TemporaryFile("w+") as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        assert process.stdout is not None
        try:
            match = re.search(r"http://\S+", process.stdout.readline())
            assert match is not None, "it printed no address"
            page = fetch(match[0]).decode()  # the token becomes a cookie
            address = match[0].partition("?")[0]
            assets = re.findall(r'(?:src|href)="\.?/(assets/[^"]+)"', page)
            assert assets, "the page names no asset"
            for asset in assets:
                assert fetch(address + asset), asset
            datasets = json.loads(fetch(f"{address}api/datasets"))["datasets"]
        finally:
            process.terminate()
        process.wait()
        errors.seek(0)
        said = errors.read()
    if "Traceback" in said:
        sys.exit(f"the interface reported an exception:\n{said}")
    print(f"page with {len(assets)} assets; datasets: {[d['dataset'] for d in datasets]}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
