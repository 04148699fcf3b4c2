"""Tables as instruments and other programs write them."""
