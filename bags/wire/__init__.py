"""The messages: the table of topics, records and their bytes."""
