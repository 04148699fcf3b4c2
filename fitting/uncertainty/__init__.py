"""What the data say about the free parameters, and what they do not."""
