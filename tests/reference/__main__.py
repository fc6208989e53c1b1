"""Print the pages of `docs/reference/` that are made, or `--write` them."""

import sys

from tests.reference import PAGES, REFERENCE

if __name__ == "__main__":
    for name, made in PAGES.items():
        if sys.argv[1:] == ["--write"]:
            (REFERENCE / name).write_text(made())
        else:
            sys.stdout.write(made())
