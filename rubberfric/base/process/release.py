"""The version; pyproject.toml reads it here, so that a package that is not installed has it, too."""

VERSION = "0.1.0"
