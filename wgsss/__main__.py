"""`python -m wgsss` is the `wgsss` command."""

from wgsss.cli import main

raise SystemExit(main())
