"""Files into the model and back, every value with its place; mistakes become diagnostics.

Add here: a folder per format with its `Format`, reader, writer and limits; commands find it by
themselves. A file is hostile until it is checked. Do not add: rules over several files (`rules`,
`compare`).
"""
