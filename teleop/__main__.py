"""`python -m teleop`."""

from teleop.cli import main

raise SystemExit(main())
