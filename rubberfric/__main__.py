"""`python -m rubberfric`: the command, where its script is not on the path."""

from rubberfric.commands.main import main

if __name__ == "__main__":
    raise SystemExit(main())
