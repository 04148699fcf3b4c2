"""`python -m fitting`: the command `rubberfric-fit`, where its script is not on the path."""

from fitting.commands.main import main

raise SystemExit(main())
