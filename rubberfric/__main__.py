"""`python -m rubberfric`: the command, where its script is not on the path."""

from rubberfric.commands.main import main

raise SystemExit(main())
