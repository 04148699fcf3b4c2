"""What a fit gives back: report, file, pictures."""
