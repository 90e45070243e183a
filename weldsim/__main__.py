"""`python -m weldsim` is the command line."""

import sys

from weldsim.cli import main

if __name__ == "__main__":
    sys.exit(main())
