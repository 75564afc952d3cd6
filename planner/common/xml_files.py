"""Reads XML that a stranger may have written: no entities, no documents elsewhere, no depth without end."""

import xml.etree.ElementTree as ET
from xml.parsers import expat


class XmlError(ValueError):
    """What is wrong with a document."""


class LocatedElement(ET.Element):
    """An element that knows the line of the file on which it begins; 0 where it stands in none."""

    line: int = 0


def line_of(element: ET.Element) -> int:
    """Return the line on which an element begins, 0 where that is not known."""
    return getattr(element, "line", 0)


def parse_xml(data: bytes, comments: bool = False) -> ET.Element:
    """Return the root of a document; names keep their prefixes as they are written, elements know their lines.

    Args:
        data: the file's bytes.
        comments: whether comments become part of the tree.

    Raises:
        XmlError: the bytes are no XML, declare an entity, or nest deeper than any robot's file.
    """
    builder = ET.TreeBuilder(element_factory=LocatedElement, insert_comments=comments)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        """Begin an element inside the one that is open."""
        most_depth = 100  # of elements in one another; a URDF has about ten
        nonlocal depth
        depth += 1
        if depth > most_depth:
            raise XmlError(f"more than {most_depth} elements stand in one another")
        builder.start(tag, attributes).line = parser.CurrentLineNumber  # type: ignore[attr-defined]

    def end(tag: str) -> None:
        """End the element that is open."""
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse_entity(name: str, *_: object) -> None:
        """Refuse entities: a few lines of them fill any memory."""
        raise XmlError(f"declares the entity '{name}': entities are not read, write out what it stands for")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.EntityDeclHandler = refuse_entity
    if comments:
        parser.CommentHandler = builder.comment
    try:
        parser.Parse(data, True)
    except expat.ExpatError as err:
        raise XmlError(str(err)) from err
    return builder.close()
