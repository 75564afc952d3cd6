"""The method of the EDBB paper, literally: every stage of a plan as section 2.1.3 there says it."""

from dataclasses import replace

from planner.cell.cell import Cell
from planner.common.errors import InputError
from planner.design.selection.pruning import EXACT_FROM
from planner.session.options import PlanOptions

LANGUAGES = ("bnr", "krl")  # G-code of the paper's controller, and KRL; each where the robot's file has its axes
WORDS = (
    "planned as published: {count} candidates in the gauge's shell, pruned by the condition number; order by the "
    "slowest axis; support poses by OMPL (PRM, and RRT-Connect between its parts)"
)


def follow_paper(cell: Cell, options: PlanOptions) -> tuple[Cell, PlanOptions, tuple[str, ...]]:
    """Return cell and options with the paper's method in every stage, and a note, where either asks for it.

    Raises:
        InputError: the gauge has no shell, or another option chooses the poses or their order.
    """
    if not (options.as_published or cell.file.plan.as_published):
        return cell, options, ()
    _check(cell, options)
    known = {axes.controller for axes in cell.robot.conventions}
    also = [name for name in LANGUAGES if name in known]
    dialects = options.dialect or tuple(dict.fromkeys((*cell.controller.dialects, *also)))
    options = replace(options, aim="index", index="O2", method="pruning", order="slowest-axis", dialect=dialects)
    said = cell.file.plan
    count = said.candidates if "candidates" in said.model_fields_set else EXACT_FROM
    file = cell.file.model_copy(update={"plan": said.model_copy(update={"candidates": count, "as_published": True})})
    cell = replace(cell, file=file, plan=replace(cell.plan, candidates=count))
    return cell, options, (WORDS.format(count=count),)


def _check(cell: Cell, options: PlanOptions) -> None:
    """Refuse what does not go together with the paper's method.

    Raises:
        InputError: with the option to leave out.
    """
    asked = "--as-published" if options.as_published else "plan.as_published = true"
    if not cell.has_bar():
        raise InputError(f"{cell.path}: {asked} plans for a bar or a wire, the gauge here is '{cell.gauge.kind}'")
    others = {
        "--aim": options.aim not in (None, "index"),
        "--index": options.index not in (None, "O2"),
        "--method": options.method not in (None, "pruning"),
        "--order": options.order not in (None, "slowest-axis"),
        "--separate": options.separate is not None,
        "--after": options.after is not None,
        "--until-mm": options.until_mm is not None,
    }
    if given := [name for name, is_given in others.items() if is_given]:
        raise InputError(
            f"{cell.path}: {asked} prunes by O2 and orders by the slowest axis; {given[0]} asks for something else: "
            "leave one out"
        )
