"""Physical objects: fields that say what they are, and classes that check, save and show themselves by them."""
