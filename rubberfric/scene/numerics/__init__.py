"""What a scene asks of numbers: nodes enough, and what single precision holds."""
