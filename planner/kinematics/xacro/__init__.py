"""Expands templates of URDFs (xacro) without running anything that they hold.

A template is a stranger's file. Its expressions are read by a parser of arithmetic and names alone, its files come from
the robot's folder and from packages that the user has named, and its work is counted: a file that asks for more than
any robot needs is refused.
"""
