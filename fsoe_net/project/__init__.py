"""What commands do with the files of a network, without a terminal: load, check, edit, convert.

Add here: a job that needs several formats and rules together and has no room of its own. Do not
add: options and output (`cli`), rules (`rules`), formats (`formats`), what is signed
(`acceptance`).
"""
