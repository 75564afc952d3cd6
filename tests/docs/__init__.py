"""The pages: commands, links, words and pictures."""
