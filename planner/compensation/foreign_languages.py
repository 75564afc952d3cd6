"""Robot languages that are not read here, by what their files are called and by what stands in them."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from planner.common.errors import InputError
from planner.common.files import read_bytes
from planner.compensation.languages import corrected_dialects, corrected_languages

_LINES = re.IGNORECASE | re.MULTILINE
_TABLE = "Read the joint angles out as a table (CSV: q1_deg …), and correct that"


@dataclass(frozen=True)
class ForeignLanguage:
    """A language that is recognised and not corrected.

    Attributes:
        name: of the language, with its maker.
        suffixes: of its files alone.
        signs: regular expressions; a text in which all of them stand is in this language.
        cure: what a person can do instead.
    """

    name: str
    suffixes: tuple[str, ...]
    signs: tuple[str, ...]
    cure: str = _TABLE


FOREIGN_LANGUAGES: Sequence[ForeignLanguage] = (
    ForeignLanguage(
        "Karel (FANUC)",
        (".kl",),
        (
            r"^[ \t]*PROGRAM[ \t]+\w+",
            r"^[ \t]*%(?:NO(?:LOCKGROUP|ABORT|PAUSE|BUSYLAMP)|STACKSIZE|ENVIRONMENT|INCLUDE|COMMENT|ALPHABETIZE"
            r"|CMOSVARS|TIMESLICE|TPMOTION|DEFGROUP|LOCKGROUP|UNINITVARS)"
            r"|\bXYZWPR(?:EXT)?\b|\$(?:MOTYPE|TERMTYPE|USEMAXACCEL)\b|\bCURJ?POS\s*\(|\bSET_JPOS_REG\b"
            r"|\bWRITE\s+TPDISPLAY\b|(?<![$\w])[DR]OUT\s*\[",
        ),
        "Of FANUC robots TP programs are read, as text (.LS)",
    ),
    ForeignLanguage(
        "V+ (Adept, Stäubli)",
        (".v2",),
        (r"^[ \t]*\.PROGRAM[ \t]+[\w.]+[ \t]*\(", r"^[ \t]*(?:MOVES?T?|APPROS?|DEPARTS?)[ \t]+[#\w]"),
    ),
    ForeignLanguage(
        "DRL (Doosan)",
        (".drl",),
        (r"\bpos[jx]\s*\(|^[ \t]*(?:from|import)[ \t]+(?:DRCF|DR_\w+|DSR_ROBOT2?)\b|\bamove[jlc]x?\s*\(",),
    ),
    ForeignLanguage(
        "MELFA-BASIC (Mitsubishi)",
        (".mb4", ".mb5", ".mb6"),
        (
            r"^[ \t]*(?:\d+[ \t]+)?(?:Mov|Mvs|Mvr2?|Mva)[ \t]+[\w(]",
            r"^[ \t]*(?:\d+[ \t]+)?(?:Servo[ \t]+O(?:n|ff)|(?:J?Ovrd|Spd|Dly)[ \t]+\w|H(?:Open|Close)[ \t]+\d|Hlt\b)"
            r"|=[ \t]*\([-+0-9., \t]+\)[ \t]*\([ \t]*\d+[ \t]*,[ \t]*\d+[ \t]*\)",
        ),
    ),
    ForeignLanguage("Python for xArm (UFACTORY)", (), (r"\bXArmAPI\b|^[ \t]*(?:from|import)[ \t]+xarm\b",)),
    ForeignLanguage(
        "PacScript (Denso)",
        (".pcs", ".pac"),
        (
            r"^[ \t]*(?:TakeArm|GiveArm)\b|^'!TITLE\b|^[ \t]*(?:Approach|Depart)[ \t]+[PLC][ \t]*,"
            r"|^[ \t]*Move[ \t]+[PLC][ \t]*,[ \t]*@",
        ),
    ),
    ForeignLanguage("SLIM (Nachi)", (), (r"^[ \t]*MOVEX[ \t]+\w+=",)),
    ForeignLanguage(
        "HRBASIC (Hyundai)",
        (),
        (
            r"^Hyundai[ \t]+Robot[ \t]+Job"
            r"|^[ \t]*(?:S\d+[ \t]+)?S?MOVE[ \t]+[PLC][ \t]*,.*\bS[ \t]*=[ \t]*[\d.]+[ \t]*(?:%|mm|cm|sec)",
        ),
    ),
    ForeignLanguage("HRSS (HIWIN)", (".hrb",), (r"^[ \t]*(?:PTP|LIN)[ \t]+\w++(?>.*?\bCONT=\d+%).*\bTOOL\[\d+\]",)),
    ForeignLanguage("SPEL+ (Epson)", (), (r"^[ \t]*Function[ \t]+\w+", r"^[ \t]*Fend\b")),
    ForeignLanguage("CSR (Panasonic)", (".csr",), (r"^\[Description\]", r"^[ \t]*MOVE[PLC]\b")),
    ForeignLanguage(
        "a program tree of PolyScope (Universal Robots)", (".urp",), (r"<URProgram\b",), "Save it as URScript (.script)"
    ),
    ForeignLanguage(
        "the list of modules of a RAPID program (ABB)",
        (".pgf",),
        (r"<Program\b[^<>]*>\s*<Module>",),
        "Give the module that it names",
    ),
    ForeignLanguage("a binary TP program (FANUC)", (".tp",), (), "Print it as text (.LS)"),
    ForeignLanguage("Java for Sunrise (KUKA)", (".java",), (r"\bRoboticsAPIApplication\b|\bcom\.kuka\.roboticsAPI\b",)),
    ForeignLanguage(
        "Python",
        (".py", ".ipynb"),
        (r"^[ \t]*(?:import[ \t]+\w[\w.]*(?:[ \t]+as[ \t]+\w+)?|from[ \t]+[\w.]+[ \t]+import\b.*)[ \t]*(?:#.*)?\r?$",),
    ),
)


def refuse_foreign_language(path: Path, by_suffix: bool) -> None:
    """Refuse a file in a language that is not read here: by what stands in it, then by its suffix, text or not.

    Args:
        path: of the file.
        by_suffix: whether the suffix counts; it does not where a person has named the language.

    Raises:
        InputError: naming the language, what is read, and what can be done.
    """
    text = read_bytes(path).decode("latin-1")
    ours = {end for d in corrected_dialects() for end in (*d.extensions, *d.reading.suffixes)}
    foreign = [f for f in FOREIGN_LANGUAGES if ours.isdisjoint(f.suffixes)]  # the others have a dialect by now
    said = (f for f in foreign if f.signs and all(re.search(sign, text, _LINES) for sign in f.signs))
    named = (f for f in foreign if by_suffix and path.suffix.lower() in f.suffixes)
    if found := next(chain(said, named), None):
        raise InputError(
            f"{path}: is {found.name}, which is not read here; read are {corrected_languages()}. {found.cure}"
        )
