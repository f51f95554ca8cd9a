"""The file: chunks, index, check, repair, writer, bag; it knows bytes and channels, not what they mean."""
