"""`python -m hose_mj`: the command line, where the console script is not on the PATH."""

import sys

from hose_mj.cli.main import main

sys.exit(main())
