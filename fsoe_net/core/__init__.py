"""The C core from Python: a typed facade, the only importer of the compiled module.

Importing this package works without the compiled part; the first use then raises `CoreMissing`. Add
here: a function of `include/fsn` with its types, or a document written by C, as values
(`bus_documents.py`). Do not add: decisions about a bus (`live`), emulated devices (`simulate`).
"""
