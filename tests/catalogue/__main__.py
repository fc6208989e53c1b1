"""Print the catalogues with the texts of now, or `--write` them."""

import sys

from tests.catalogue import FILES, renewed

if __name__ == "__main__":
    for language, path in FILES.items():
        if sys.argv[1:] == ["--write"]:
            path.write_bytes(renewed(language))
        else:
            sys.stdout.buffer.write(renewed(language))
