"""Parts of the pictures of a fit."""
