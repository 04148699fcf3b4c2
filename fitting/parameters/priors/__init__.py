"""What is known before the data: kinds of it, and the rows that stand beside the residuals."""
