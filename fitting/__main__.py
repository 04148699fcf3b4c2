"""`python -m fitting`: the command `rubberfric-fit`, where its script is not on the path."""

from fitting.commands.main import main

if __name__ == "__main__":
    raise SystemExit(main())
