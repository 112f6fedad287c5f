"""Files into the model, every value with its place; what is wrong becomes diagnostics."""
