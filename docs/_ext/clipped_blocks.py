"""List the code blocks and tables of the built site that are wider than their box.

    python docs/_ext/clipped_blocks.py docs/_build 1280 1920

A headless Chromium opens each page of the folder, except the API pages, in each width. The exit
code is 1 if a block or a table must be scrolled sideways. The script needs playwright and a
Chromium of the system.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from playwright.sync_api import Route, sync_playwright

BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
FIND = """() => {
  const all = [...document.querySelectorAll(".bd-article pre, .bd-article table")];
  const shown = all.filter((one) => one.clientWidth && !one.closest("td.linenos"));
  return shown.map((one) => [one.tagName, one.clientWidth, one.scrollWidth,
    one.textContent.trim().split("\\n")[0].slice(0, 60)]);
}"""


def local_only(route: Route) -> None:
    """Load only files: the pages must not wait for another server."""
    if route.request.url.startswith("file:"):
        route.continue_()
    else:
        route.abort()


def main() -> int:
    """Print the clipped blocks, and how many there are in each width."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("site", type=Path)
    parser.add_argument("widths", type=int, nargs="+")
    options = parser.parse_args()
    pages = sorted(options.site.glob("*.html")) + sorted(options.site.glob("generated/gallery/*"))
    pages = [page for page in pages if page.suffix == ".html"]
    clipped = 0
    with sync_playwright() as playwright:
        path = next((found for name in BROWSERS if (found := shutil.which(name))), None)
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        for width in options.widths:
            tab = browser.new_page(viewport={"width": width, "height": 720})
            tab.route("**/*", local_only)
            counts = {"PRE": [0, 0], "TABLE": [0, 0]}
            for page in pages:
                tab.goto(page.resolve().as_uri(), wait_until="domcontentloaded")
                for kind, box, content, start in tab.evaluate(FIND):
                    counts[kind][0] += 1
                    if content > box + 1:
                        counts[kind][1] += 1
                        print(f"{width} {page.stem} {kind.lower()} {content} > {box}: {start}")
            tab.close()
            for kind, (number, wide) in counts.items():
                print(f"{width} pixels, {kind.lower()}: {wide} of {number} clipped")
                clipped += wide
        browser.close()
    return int(clipped > 0)


if __name__ == "__main__":
    sys.exit(main())
