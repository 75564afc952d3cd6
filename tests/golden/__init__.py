"""The record: small runs through the command line, and a table of their quantities with units and tolerances."""
