"""What several formats use: files, text, XML, YAML, numbers, names."""
