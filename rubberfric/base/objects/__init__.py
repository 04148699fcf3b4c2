"""Physical objects: fields that say what they are, and classes that are checked and shown by them."""
