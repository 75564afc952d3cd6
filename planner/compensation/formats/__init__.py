"""The formats of programs and lists of targets that are corrected, a file each."""
