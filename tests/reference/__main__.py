"""Print the pages of `docs/reference/` that are made, and the examples, or `--write` them."""

import sys

from tests.reference import FILES

if __name__ == "__main__":
    for path, made in FILES.items():
        if sys.argv[1:] == ["--write"]:
            path.write_text(made())
        else:
            sys.stdout.write(made())
