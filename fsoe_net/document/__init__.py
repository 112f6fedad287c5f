"""Documents as data, and the writers that make pages, text and JSON of them."""
