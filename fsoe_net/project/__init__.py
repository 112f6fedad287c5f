"""Operations on the files of a network, without a terminal: load, check, edit, convert.

Add here: an operation that needs several formats and rules and has no package of its own. Do not
add: options and output (`cli`), rules (`rules`), formats (`formats`), signed documents
(`acceptance`).
"""
