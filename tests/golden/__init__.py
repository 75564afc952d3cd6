"""The golden record: small runs through the command line, kept and compared number by number."""
